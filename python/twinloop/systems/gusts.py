"""Gusts: random angular accelerations that last for a while, and what they add to a state in a period."""

from __future__ import annotations

import math

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import exp

CORRELATION_TIME = 0.2
"""Time after which a gust is forgotten to a share of 1/e, s."""


def gust_accelerations(stream: np.random.Generator, steps: int, deviation: float, dt: float) -> Floats:
    """Three Ornstein–Uhlenbeck processes, sampled exactly and stationary from the start.

    Args:
        stream: where they are drawn from.
        steps: number of periods, n.
        deviation: standard deviation of the acceleration, rad/s².
        dt: period, s.

    Returns:
        Angular accelerations (n, 3), rad/s², each held for a period.
    """
    kept = float(exp(-dt / CORRELATION_TIME))
    fresh = math.sqrt(1.0 - kept * kept)
    draws = deviation * stream.standard_normal((steps, 3))
    accelerations = np.empty_like(draws)
    for k, draw in enumerate(draws):
        accelerations[k] = draw if k == 0 else kept * accelerations[k - 1] + fresh * draw
    return accelerations


def as_disturbance(accelerations: Floats, dt: float) -> Floats:
    """What held angular accelerations add to the true state after each period.

    Args:
        accelerations: (n, 3), rad/s².
        dt: period, s.

    Returns:
        Increments (n, 6): of the three angles, a dt²/2 in rad, and of the three rates, a dt in rad/s.
    """
    return np.hstack([accelerations * (0.5 * dt * dt), accelerations * dt])
