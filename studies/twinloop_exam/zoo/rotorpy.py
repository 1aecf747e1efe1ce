"""RotorPy's two vehicles."""

from __future__ import annotations

from twinloop.systems import RotorPy
from twinloop_exam.zoo.plant import Plant, Task

NOISE = 1e-3
"""Of the sensors, rad; five times as much in rad/s."""


def _made(vehicle: str, seed: int | None) -> RotorPy:
    return RotorPy(vehicle) if seed is None else RotorPy(vehicle, noise=NOISE, seed=seed)


def _task(system: RotorPy) -> Task:
    return Task(
        system.controller, system.initial_state, system.target_state, system.duration, system.default_gains
    )


# The wind that a vehicle makes by flying off is a hidden state; rotors lag.
HUMMINGBIRD = Plant(
    "rotorpy-hummingbird",
    "RotorPy's Hummingbird",
    lambda seed: _made("hummingbird", seed),
    _task,
    frozenset({"actuator", "hidden"}),
)
CRAZYFLIE = Plant(
    "rotorpy-crazyflie",
    "RotorPy's Crazyflie",
    lambda seed: _made("crazyflie", seed),
    _task,
    frozenset({"actuator", "hidden"}),
)
