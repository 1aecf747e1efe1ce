"""Motors: one with dry friction, one with a load behind backlash, whose load is logged or not."""

from __future__ import annotations

import math

from twinloop.controllers import PID
from twinloop.signals import Command, Signals, State
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task

INERTIA, VISCOUS, DRY, BREAKAWAY, CREEP, STRIBECK = 0.01, 0.01, 0.06, 0.09, 0.02, 0.2
"""kg m², N m s, N m, N m, rad/s at which friction sets in, rad/s at which it has fallen."""


def friction(rate: float) -> float:
    """Viscous and dry, N m; it falls once the motor moves (Stribeck)."""
    dry = DRY + (BREAKAWAY - DRY) * math.exp(-((rate / STRIBECK) ** 2))
    return VISCOUS * rate + dry * math.tanh(rate / CREEP)


def rubbing(z: Row, u: Row) -> Row:
    """Of angle and rate under a torque."""
    return [z[1], (u[0] - friction(z[1])) / INERTIA]


MOTOR, LOAD = 0.004, 0.02
"""kg m²."""
GAP, STIFFNESS, DAMPING = 0.06, 30.0, 0.06
"""Half of the play in rad, N m/rad, N m s."""
BEARINGS = (0.02, 0.03)
"""N m s."""


def through_the_gap(twist: float, rate: float) -> float:
    """Torque of the shaft on the load, N m: none inside the gap, and it never pulls."""
    if abs(twist) <= GAP:
        return 0.0
    pressed = twist - math.copysign(GAP, twist)
    torque = STIFFNESS * pressed + DAMPING * rate
    return torque if torque * pressed > 0.0 else 0.0


def geared(z: Row, u: Row) -> Row:
    """Of the angles of motor and load and their rates, under a torque."""
    motor, load, p, q = z
    torque = through_the_gap(motor - load, p - q)
    return [p, q, (u[0] - torque - BEARINGS[0] * p) / MOTOR, (torque - BEARINGS[1] * q) / LOAD]


FRICTION_SIGNALS = Signals(
    [
        State("angle", "rad", 2.0, envelope=(-0.5, 2.0)),
        State("rate", "rad/s", 10.0, derivative_of="angle", envelope=(-15.0, 15.0)),
    ],
    [Command("torque", "N m", (-0.5, 0.5))],
    0.01,
)
_MOTOR = State("motor", "rad", 2.0, envelope=(-0.5, 2.0))
_MOTOR_RATE = State("motor_rate", "rad/s", 10.0, derivative_of="motor", envelope=(-15.0, 15.0))
_LOAD = State("load", "rad", 2.0, envelope=(-0.5, 2.0))
_LOAD_RATE = State("load_rate", "rad/s", 10.0, derivative_of="load", envelope=(-15.0, 15.0))
_TORQUE = Command("torque", "N m", (-0.6, 0.6))
LOGGED_SIGNALS = Signals([_MOTOR, _LOAD, _MOTOR_RATE, _LOAD_RATE], [_TORQUE], 0.01)
HIDDEN_SIGNALS = Signals([_MOTOR, _MOTOR_RATE], [_TORQUE], 0.01)


def _friction_task(_: Machine) -> Task:
    family = PID(
        axes=[("angle", "rate")],
        gains={"angle.kp": (0.0, 4.0), "angle.ki": (0.0, 4.0), "angle.kd": (0.0, 0.5)},
    )
    return Task(
        family,
        start=[0.0, 0.0],
        target=[1.0, 0.0],
        duration=1.5,
        first={"angle.kp": 0.2, "angle.ki": 0.05, "angle.kd": 0.05},
    )


def _backlash_task(system: Machine) -> Task:
    names = system.signals.state_names
    where = "load" if "load" in names else "motor"
    family = PID(
        axes=[(where, "motor_rate")],
        gains={f"{where}.kp": (0.0, 4.0), f"{where}.ki": (0.0, 2.0), f"{where}.kd": (0.0, 0.6)},
    )
    return Task(
        family,
        start=[0.0] * len(names),
        target=[1.0 if name in ("motor", "load") else 0.0 for name in names],
        duration=1.5,
        first={f"{where}.kp": 0.15, f"{where}.ki": 0.0, f"{where}.kd": 0.06},
        weights={name: float(name == where) for name in names},
    )


FRICTION = Plant(
    "motor-friction",
    "motor with dry friction",
    lambda seed: Machine(FRICTION_SIGNALS, Mechanism(runge_kutta(rubbing)), [1e-3, 1e-2], seed),
    _friction_task,
)
BACKLASH = Plant(
    "motor-backlash",
    "motor with a load behind backlash, logged",
    lambda seed: Machine(LOGGED_SIGNALS, Mechanism(runge_kutta(geared)), [1e-3, 1e-3, 1e-2, 1e-2], seed),
    _backlash_task,
)
BACKLASH_HIDDEN = Plant(
    "motor-backlash-hidden",
    "motor with a load behind backlash, not logged",
    lambda seed: Machine(
        HIDDEN_SIGNALS,
        Mechanism(
            runge_kutta(geared),
            inner=lambda x: [x[0], x[0], x[1], x[1]],
            outer=lambda z: [z[0], z[2]],
        ),
        [1e-3, 1e-2],
        seed,
    ),
    _backlash_task,
    frozenset({"hidden"}),
)
