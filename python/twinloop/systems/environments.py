"""Environments of Gymnasium that need no description: their states, how they are read, and how they are placed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.signals import Command, Signals, State


@dataclass(frozen=True)
class Environment:
    """What is known of an environment.

    Args:
        signals: of an environment that was made, `env.unwrapped`.
        state: of an observation, the state (n_x,).
        place: sets the state (n_x,) of an environment that was reset, and returns the observation there.
        levels: commands that its discrete actions stand for (actions, n_u); None where actions are continuous.
    """

    signals: Callable[[Any], Signals]
    state: Callable[[Any], Any]
    place: Callable[[Any, Floats], Any]
    levels: Callable[[Any], Any] | None = None


def _pendulum(env: Any) -> Signals:
    return Signals(
        states=[
            State("angle", "rad", math.pi, periodic=True),
            State(
                "rate",
                "rad/s",
                8.0,
                derivative_of="angle",
                envelope=(-float(env.max_speed), float(env.max_speed)),
            ),
        ],
        commands=[Command("torque", "N m", (-float(env.max_torque), float(env.max_torque)))],
        dt=float(env.dt),
    )


def _place_pendulum(env: Any, state: Floats) -> Any:
    env.unwrapped.state = np.array(state)
    return env.unwrapped._get_obs()


def _inverted_pendulum(env: Any) -> Signals:
    low, high = (float(bound[0]) for bound in (env.action_space.low, env.action_space.high))
    return Signals(
        states=[
            State("position", "m", 1.0, envelope=(-1.0, 1.0)),
            State("angle", "rad", 0.2, envelope=(-0.2, 0.2)),
            State("velocity", "m/s", 1.0, derivative_of="position"),
            State("rate", "rad/s", 2.0, derivative_of="angle"),
        ],
        commands=[Command("drive", "", (low, high))],
        dt=float(env.dt),
    )


def _place_bodies(env: Any, state: Floats) -> Any:
    bodies = env.unwrapped
    bodies.set_state(np.array(state[: bodies.model.nq]), np.array(state[bodies.model.nq :]))
    return bodies._get_obs()


def _cart_pole(env: Any) -> Signals:
    threshold, angle = float(env.x_threshold), float(env.theta_threshold_radians)
    return Signals(
        states=[
            State("position", "m", threshold, envelope=(-threshold, threshold)),
            State("velocity", "m/s", 2.0, derivative_of="position"),
            State("angle", "rad", angle, envelope=(-angle, angle)),
            State("rate", "rad/s", 2.0, derivative_of="angle"),
        ],
        commands=[Command("force", "N", (-float(env.force_mag), float(env.force_mag)))],
        dt=float(env.tau),
    )


def _place_cart_pole(env: Any, state: Floats) -> Any:
    env.unwrapped.state = np.array(state)
    return np.array(state, dtype=np.float32)


KNOWN = {
    "Pendulum-v1": Environment(
        _pendulum, lambda seen: (math.atan2(seen[1], seen[0]), float(seen[2])), _place_pendulum
    ),
    "InvertedPendulum-v5": Environment(_inverted_pendulum, lambda seen: seen, _place_bodies),
    "CartPole-v1": Environment(
        _cart_pole,
        lambda seen: seen,
        _place_cart_pole,
        lambda env: [[-float(env.force_mag)], [float(env.force_mag)]],
    ),
}
"""By their names at Gymnasium."""
