"""Two tanks, one above the other, fed by a pump through a pipe that takes three samples."""

from __future__ import annotations

import math

from twinloop.controllers import PID
from twinloop.signals import Command, Signals, State
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task, about_rest

AREA, HOLES, PUMP, GRAVITY = 0.02, (1.6e-4, 1.5e-4), 8e-5, 9.81
"""m², m², m³/(s V), m/s²."""
DEAD_TIME = 3
"""Samples."""


def outflow(hole: float, level: float) -> float:
    """Torricelli's, m³/s."""
    return hole * math.sqrt(2.0 * GRAVITY * max(0.0, level))


def derivative(z: Row, u: Row) -> Row:
    """Of the levels, m, under the pump's voltage."""
    first, second = (outflow(hole, level) for hole, level in zip(HOLES, z, strict=True))
    return [(PUMP * u[0] - first) / AREA, (first - second) / AREA]


def rest(level: float) -> tuple[float, float]:
    """Level of the upper tank and voltage at which the lower one stays."""
    flow = outflow(HOLES[1], level)
    return (flow / HOLES[0]) ** 2 / (2.0 * GRAVITY), flow / PUMP


SIGNALS = Signals(
    [
        State("upper", "m", 0.3, envelope=(0.0, 0.6)),
        State("lower", "m", 0.3, envelope=(0.0, 0.5)),
    ],
    [Command("pump", "V", (0.0, 10.0))],
    1.0,
)
START, TARGET = 0.08, 0.2


def _task(_: Machine) -> Task:
    upper, voltage = rest(START)
    wanted, _more = rest(TARGET)
    family = PID(
        axes=[("lower", None)],
        gains={"lower.kp": (0.0, 150.0), "lower.ki": (0.0, 5.0), "lower.kd": (0.0, 800.0)},
        output=about_rest(voltage),
        anti_windup="clamping",
    )
    return Task(
        family,
        start=[upper, START],
        target=[wanted, TARGET],
        duration=100.0,
        first={"lower.kp": 7.0, "lower.ki": 0.1, "lower.kd": 0.0},
        weights={"upper": 0.0},
    )


def _made(seed: int | None) -> Machine:
    mechanism = Mechanism(runge_kutta(derivative), substeps=4, delay=DEAD_TIME, rest=(rest(START)[1],))
    return Machine(SIGNALS, mechanism, [5e-4, 5e-4], seed)


PLANT = Plant("tanks", "two tanks, three samples of dead time", _made, _task, frozenset({"actuator"}))
