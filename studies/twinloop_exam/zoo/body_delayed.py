"""A rigid body whose torques come two periods late through a lag of 40 ms."""

from __future__ import annotations

import math

from twinloop_exam.zoo import rigid_body as body
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task

INERTIA = (0.01, 0.015, 0.02)
DAMPING = 0.005
"""N m s."""
LAG = 0.04
"""s."""


def derivative(z: Row, u: Row) -> Row:
    """Of six states and three torques that lag behind the commands."""
    rates, torques = z[3:6], z[6:9]
    net = [torque - DAMPING * rate for torque, rate in zip(torques, rates, strict=True)]
    return [
        *body.turning(z[:3], rates),
        *body.spinning(INERTIA, rates, net),
        *((one - torque) / LAG for one, torque in zip(u, torques, strict=True)),
    ]


MECHANISM = Mechanism(
    runge_kutta(derivative),
    inner=lambda x: [*x, 0.0, 0.0, 0.0],
    outer=lambda z: z[:6],
    delay=2,
    rest=(0.0, 0.0, 0.0),
)


def _task(_: Machine) -> Task:
    return Task(
        body.controller(INERTIA, {"kp": 40.0, "ki": 10.0, "kd": 12.0}),
        start=[0.0] * 6,
        target=[math.radians(20.0), math.radians(30.0), math.radians(-40.0), 0.0, 0.0, 0.0],
        duration=2.0,
        first=body.gains(INERTIA, 2.0, 0.1, 2.5),
    )


PLANT = Plant(
    "body-delayed",
    "rigid body, a delay beside a lag",
    lambda seed: Machine(body.signals(0.02, 0.25), MECHANISM, [1e-3] * 3 + [5e-3] * 3, seed),
    _task,
    frozenset({"actuator"}),
)
