"""The built-in quadrotor: as it is, and harsh."""

from __future__ import annotations

from twinloop.systems import Quadrotor
from twinloop.systems.quadrotor import gains_from_frequency
from twinloop_exam.zoo.plant import Plant, Task

NOISE = 1e-3
"""Of the sensors, rad; five times as much in rad/s."""


def _calm(seed: int | None) -> Quadrotor:
    return Quadrotor() if seed is None else Quadrotor(noise=NOISE, seed=seed)


def _harsh(seed: int | None) -> Quadrotor:
    harsh = Quadrotor.harsh(noise=NOISE, seed=seed or 0)
    return harsh if seed is not None else Quadrotor(drag=harsh.drag.tolist(), motor_lag=harsh.motor_lag)


def _task(system: Quadrotor, natural_frequency: float) -> Task:
    return Task(
        system.controller,
        system.initial_state,
        system.target_state,
        system.duration,
        gains_from_frequency(system.inertia.tolist(), natural_frequency),
    )


QUADROTOR = Plant("quadrotor", "the built-in quadrotor", _calm, lambda system: _task(system, 1.0))
HARSH = Plant(
    "quadrotor-harsh",
    "the built-in quadrotor with drag, slow motors and gusts",
    _harsh,
    lambda system: _task(system, 0.6),
    frozenset({"actuator", "lasting"}),
)
