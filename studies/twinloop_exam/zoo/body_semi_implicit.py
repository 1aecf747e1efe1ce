"""A rigid body in a simulator that takes one semi-implicit Euler step a period."""

from __future__ import annotations

import math

from twinloop_exam.zoo import rigid_body as body
from twinloop_exam.zoo.machine import Machine, Mechanism, Row
from twinloop_exam.zoo.plant import Plant, Task

INERTIA = (0.03, 0.02, 0.05)
DAMPING = 0.02
"""N m s."""


def advance(z: Row, u: Row, h: float) -> Row:
    """Rates a step on; then angles, with the rates that were found."""
    net = [one - DAMPING * rate for one, rate in zip(u, z[3:6], strict=True)]
    rates = [rate + h * a for rate, a in zip(z[3:6], body.spinning(INERTIA, z[3:6], net), strict=True)]
    angles = [angle + h * turn for angle, turn in zip(z[:3], body.turning(z[:3], rates), strict=True)]
    return [*angles, *rates]


MECHANISM = Mechanism(advance, substeps=1)


def _task(_: Machine) -> Task:
    return Task(
        body.controller(INERTIA, {"kp": 60.0, "ki": 15.0, "kd": 16.0}),
        start=[0.0] * 6,
        target=[math.radians(-25.0), math.radians(-30.0), math.radians(50.0), 0.0, 0.0, 0.0],
        duration=2.0,
        first=body.gains(INERTIA, 2.6, 0.2, 2.6),
    )


PLANT = Plant(
    "body-semi-implicit",
    "rigid body, one semi-implicit step a period",
    lambda seed: Machine(body.signals(0.025, 0.5), MECHANISM, [1e-3] * 3 + [5e-3] * 3, seed),
    _task,
)
