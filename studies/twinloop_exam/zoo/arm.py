"""An arm of two links in a vertical plane, a torque at each joint."""

from __future__ import annotations

import math

from twinloop.controllers import PID
from twinloop.signals import Command, Signals, State
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task

MASSES, LENGTHS, CENTRES, INERTIAS = (1.2, 0.8), (0.4, 0.35), (0.2, 0.17), (0.016, 0.0085)
GRAVITY = 9.81
FRICTION = (0.25, 0.15)
"""N m s."""


def derivative(z: Row, u: Row) -> Row:
    """Of (shoulder, elbow, their rates) under torques; angles from hanging down, the elbow's from the upper link."""
    a, b, p, q = z
    (m1, m2), (l1, _), (c1, c2), (i1, i2) = MASSES, LENGTHS, CENTRES, INERTIAS
    coupling = m2 * l1 * c2 * math.cos(b)
    m11 = i1 + i2 + m1 * c1 * c1 + m2 * (l1 * l1 + c2 * c2) + 2.0 * coupling
    m12 = i2 + m2 * c2 * c2 + coupling
    m22 = i2 + m2 * c2 * c2
    swirl = m2 * l1 * c2 * math.sin(b)
    lower = m2 * c2 * GRAVITY * math.sin(a + b)
    upper = (m1 * c1 + m2 * l1) * GRAVITY * math.sin(a)
    first = u[0] - FRICTION[0] * p + swirl * q * (2.0 * p + q) - upper - lower
    second = u[1] - FRICTION[1] * q - swirl * p * p - lower
    determinant = m11 * m22 - m12 * m12
    return [p, q, (m22 * first - m12 * second) / determinant, (m11 * second - m12 * first) / determinant]


def energy(z: Row) -> float:
    """Kinetic and potential, J."""
    a, b, p, q = z
    (m1, m2), (l1, _), (c1, c2), (i1, i2) = MASSES, LENGTHS, CENTRES, INERTIAS
    first = 0.5 * (i1 + m1 * c1 * c1) * p * p - m1 * GRAVITY * c1 * math.cos(a)
    vx = l1 * math.cos(a) * p + c2 * math.cos(a + b) * (p + q)
    vy = l1 * math.sin(a) * p + c2 * math.sin(a + b) * (p + q)
    second = 0.5 * m2 * (vx * vx + vy * vy) + 0.5 * i2 * (p + q) * (p + q)
    return first + second - m2 * GRAVITY * (l1 * math.cos(a) + c2 * math.cos(a + b))


SIGNALS = Signals(
    [
        State("shoulder", "rad", math.pi, envelope=(-2.0, 2.0)),
        State("elbow", "rad", math.pi, envelope=(-2.2, 2.2)),
        State("shoulder_rate", "rad/s", 8.0, derivative_of="shoulder", envelope=(-8.0, 8.0)),
        State("elbow_rate", "rad/s", 8.0, derivative_of="elbow", envelope=(-10.0, 10.0)),
    ],
    [
        Command("shoulder_torque", "N m", (-10.0, 10.0)),
        Command("elbow_torque", "N m at the elbow", (-4.0, 4.0)),
    ],
    0.02,
)


def _task(_: Machine) -> Task:
    family = PID(
        axes=[("shoulder", "shoulder_rate"), ("elbow", "elbow_rate")],
        gains={
            "shoulder.kp": (0.0, 60.0), "shoulder.ki": (0.0, 100.0), "shoulder.kd": (0.0, 8.0),
            "elbow.kp": (0.0, 20.0), "elbow.ki": (0.0, 40.0), "elbow.kd": (0.0, 2.0),
        },
    )  # fmt: skip
    return Task(
        family,
        start=[0.0, 0.0, 0.0, 0.0],
        target=[0.9, 0.7, 0.0, 0.0],
        duration=2.0,
        first={
            "shoulder.kp": 8.0, "shoulder.ki": 6.0, "shoulder.kd": 1.0,
            "elbow.kp": 3.0, "elbow.ki": 3.0, "elbow.kd": 0.3,
        },
    )  # fmt: skip


PLANT = Plant(
    "arm",
    "arm of two links",
    lambda seed: Machine(SIGNALS, Mechanism(runge_kutta(derivative)), [1e-3, 1e-3, 1e-2, 1e-2], seed),
    _task,
)
