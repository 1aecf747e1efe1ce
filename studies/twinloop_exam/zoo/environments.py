"""Environments of Gymnasium: the cart-pole, Pendulum-v1, and MuJoCo's double inverted pendulum."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.controllers import PID, StateFeedback
from twinloop.signals import Command, Signals, State
from twinloop.systems import Gymnasium
from twinloop_exam.zoo.plant import Plant, Task


def _noisy(noise: list[float], seed: int | None) -> dict[str, Any]:
    return {} if seed is None else {"noise": noise, "seed": seed}


def _pendulum_task(_: Gymnasium) -> Task:
    family = PID(
        axes=[("angle", "rate")],
        gains={"angle.kp": (5.5, 30.0), "angle.ki": (0.0, 20.0), "angle.kd": (0.2, 6.0)},
    )
    return Task(
        family,
        start=[0.3, 0.0],
        target=[0.0, 0.0],
        duration=3.0,
        first={"angle.kp": 6.5, "angle.ki": 0.5, "angle.kd": 2.5},
    )


def _cart_pole_task(_: Gymnasium) -> Task:
    family = StateFeedback(
        None,
        gains={
            "position": (-12.0, 0.0), "velocity": (-14.0, 0.0), "angle": (-150.0, -20.0), "rate": (-30.0, -2.0)
        },
    )  # fmt: skip
    return Task(
        family,
        start=[0.5, 0.0, 0.0, 0.0],
        target=[0.0, 0.0, 0.0, 0.0],
        duration=4.0,
        weights={"angle": 0.0},
        first={
            "position->force": -0.4, "velocity->force": -1.5, "angle->force": -35.0, "rate->force": -6.0
        },
    )  # fmt: skip


DOUBLE = Signals(
    [
        State("position", "m", 1.0, envelope=(-1.0, 1.0)),
        State("lower", "rad", 0.3, envelope=(-0.4, 0.4)),
        State("upper", "rad", 0.3, envelope=(-0.4, 0.4)),
        State("velocity", "m/s", 3.0, derivative_of="position"),
        State("lower_rate", "rad/s", 5.0, derivative_of="lower"),
        State("upper_rate", "rad/s", 5.0, derivative_of="upper"),
    ],
    [Command("drive", "", (-1.0, 1.0))],
    0.02,
)


def _double_state(seen: Floats) -> list[float]:
    """Position, angles (the upper one from the lower pole) and their rates, of an observation."""
    return [
        float(seen[0]),
        math.atan2(seen[1], seen[3]),
        math.atan2(seen[2], seen[4]),
        *(float(one) for one in seen[5:8]),
    ]


def _place_double(env: Any, state: Floats) -> Any:
    bodies = env.unwrapped
    bodies.set_state(np.array(state[:3]), np.array(state[3:]))
    return bodies._get_obs()


def _double(seed: int | None) -> Gymnasium:
    return Gymnasium(
        "InvertedDoublePendulum-v5",
        signals=DOUBLE,
        state=_double_state,
        place=_place_double,
        make={"frame_skip": 2},
        **_noisy([1e-3, 1e-3, 1e-3, 5e-3, 5e-3, 5e-3], seed),
    )


def _double_task(_: Gymnasium) -> Task:
    family = StateFeedback(
        None,
        gains={
            "position": (0.01, 8.0), "lower": (0.0, 40.0), "upper": (2.0, 50.0),
            "velocity": (0.03, 8.0), "lower_rate": (0.0, 12.0), "upper_rate": (0.2, 10.0),
        },
    )  # fmt: skip
    return Task(
        family,
        start=[0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
        target=[0.0] * 6,
        duration=4.0,
        weights={"lower": 0.0, "upper": 0.0},
        first={
            "position->drive": 0.012, "lower->drive": 0.577, "upper->drive": 4.207,
            "velocity->drive": 0.086, "lower_rate->drive": 0.487, "upper_rate->drive": 0.611,
        },
    )  # fmt: skip


PENDULUM = Plant(
    "pendulum",
    "Gymnasium's Pendulum-v1, kept upright",
    lambda seed: Gymnasium("Pendulum-v1", **_noisy([2e-3, 1e-2], seed)),
    _pendulum_task,
)
CART_POLE = Plant(
    "cart-pole",
    "Gymnasium's cart-pole",
    lambda seed: Gymnasium("CartPole-v1", **_noisy([1e-3, 5e-3, 1e-3, 5e-3], seed)),
    _cart_pole_task,
)
DOUBLE_PENDULUM = Plant("double-pendulum", "MuJoCo's double inverted pendulum", _double, _double_task)
