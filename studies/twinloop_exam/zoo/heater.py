"""A plate that an element heats; it loses heat by convection and radiation."""

from __future__ import annotations

from twinloop.controllers import PID
from twinloop.signals import Command, Signals, State
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task, about_rest

CAPACITIES, CONDUCTANCE, CONVECTION, RADIATION = (40.0, 180.0), 4.0, 0.6, 3.4e-9
"""J/K, W/K, W/K, W/K⁴ (of 0.06 m² of a black surface)."""
AMBIENT = 295.0
"""K."""


def loss(plate: float) -> float:
    """Of the plate, W, where it is so many K above ambient."""
    kelvin = AMBIENT + plate
    return CONVECTION * plate + RADIATION * (kelvin**4 - AMBIENT**4)


def derivative(z: Row, u: Row) -> Row:
    """Of element and plate, K above ambient, under the power."""
    element, plate = z
    through = CONDUCTANCE * (element - plate)
    return [(u[0] - through) / CAPACITIES[0], (through - loss(plate)) / CAPACITIES[1]]


SIGNALS = Signals(
    [
        State("element", "K", 150.0, envelope=(-20.0, 250.0)),
        State("plate", "K", 100.0, envelope=(-20.0, 130.0)),
    ],
    [Command("power", "W", (0.0, 400.0))],
    2.0,
)


def _task(_: Machine) -> Task:
    family = PID(
        axes=[("plate", None)],
        gains={"plate.kp": (0.0, 40.0), "plate.ki": (0.0, 1.0), "plate.kd": (0.0, 200.0)},
        output=about_rest(0.0),
        anti_windup="clamping",
    )
    return Task(
        family,
        start=[0.0, 0.0],
        target=[80.0 + loss(80.0) / CONDUCTANCE, 80.0],
        duration=240.0,
        first={"plate.kp": 1.2, "plate.ki": 0.008, "plate.kd": 0.0},
        weights={"element": 0.0},
    )


PLANT = Plant(
    "heater",
    "heater with convection and radiation",
    lambda seed: Machine(SIGNALS, Mechanism(runge_kutta(derivative), substeps=4), [0.2, 0.1], seed),
    _task,
)
