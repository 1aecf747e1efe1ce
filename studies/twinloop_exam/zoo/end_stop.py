"""A mass on a rail that ends at a rubber stop."""

from __future__ import annotations

from twinloop.controllers import PID
from twinloop.signals import Command, Signals, State
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task

MASS, VISCOUS, STOP, STIFFNESS, DAMPING = 1.0, 0.8, 0.9, 3000.0, 15.0
"""kg, N s/m, m, N/m, N s/m."""


def contact(position: float, velocity: float) -> float:
    """Force of the stop, N: it pushes back and never pulls."""
    depth = position - STOP
    return min(0.0, -STIFFNESS * depth - DAMPING * velocity) if depth > 0.0 else 0.0


def derivative(z: Row, u: Row) -> Row:
    """Of position and velocity under a force."""
    position, velocity = z
    return [velocity, (u[0] - VISCOUS * velocity + contact(position, velocity)) / MASS]


SIGNALS = Signals(
    [
        State("position", "m", 1.0, envelope=(-0.3, 0.98)),
        State("velocity", "m/s", 3.0, derivative_of="position", envelope=(-4.0, 4.0)),
    ],
    [Command("force", "N", (-8.0, 8.0))],
    0.02,
)


def _task(_: Machine) -> Task:
    family = PID(
        axes=[("position", "velocity")],
        gains={"position.kp": (0.0, 80.0), "position.ki": (0.0, 20.0), "position.kd": (0.0, 25.0)},
    )
    return Task(
        family,
        start=[0.0, 0.0],
        target=[0.87, 0.0],
        duration=2.4,
        first={"position.kp": 1.5, "position.ki": 0.1, "position.kd": 0.6},
    )


PLANT = Plant(
    "end-stop",
    "mass with an end stop",
    lambda seed: Machine(SIGNALS, Mechanism(runge_kutta(derivative), substeps=20), [1e-3, 1e-2], seed),
    _task,
)
