"""A rigid body in a fluid: its damping grows with the square of each rate."""

from __future__ import annotations

import math

from twinloop_exam.zoo import rigid_body as body
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task

INERTIA = (0.05, 0.08, 0.06)
DRAG = (0.05, 0.12, 0.08)
"""N m s²."""


def torques(rates: Row, u: Row) -> Row:
    """Of the commands and of drag, N m."""
    return [one - d * abs(rate) * rate for one, d, rate in zip(u, DRAG, rates, strict=True)]


MECHANISM = Mechanism(runge_kutta(body.free(INERTIA, torques)), substeps=6)


def _task(_: Machine) -> Task:
    return Task(
        body.controller(INERTIA, {"kp": 60.0, "ki": 15.0, "kd": 12.0}),
        start=[0.0] * 6,
        target=[math.radians(-35.0), math.radians(30.0), math.radians(45.0), 0.0, 0.0, 0.0],
        duration=2.4,
        first=body.gains(INERTIA, 1.5, 0.1, 1.5),
    )


PLANT = Plant(
    "body-drag",
    "rigid body, damping that grows with speed",
    lambda seed: Machine(body.signals(0.03, 0.6), MECHANISM, [2e-3] * 3 + [6e-3] * 3, seed),
    _task,
)
