"""A rigid body whose angles are read 12 ms after its rates."""

from __future__ import annotations

import math

from twinloop_exam.zoo import rigid_body as body
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task

INERTIA = (0.02, 0.03, 0.04)
DAMPING = (0.02, 0.02, 0.03)
"""N m s."""


def torques(rates: Row, u: Row) -> Row:
    """Of the commands and of damping, N m."""
    return [one - d * rate for one, d, rate in zip(u, DAMPING, rates, strict=True)]


MECHANISM = Mechanism(runge_kutta(body.free(INERTIA, torques)), late=(6, 6, 6, 0, 0, 0))


def _task(_: Machine) -> Task:
    return Task(
        body.controller(INERTIA, {"kp": 80.0, "ki": 20.0, "kd": 20.0}),
        start=[0.0] * 6,
        target=[math.radians(30.0), math.radians(-25.0), math.radians(60.0), 0.0, 0.0, 0.0],
        duration=2.0,
        first=body.gains(INERTIA, 2.0, 0.2, 2.5),
    )


PLANT = Plant(
    "body-late",
    "rigid body, angles read 12 ms late",
    lambda seed: Machine(body.signals(0.02, 0.4), MECHANISM, [1e-3] * 3 + [5e-3] * 3, seed),
    _task,
    frozenset({"offset"}),
)
