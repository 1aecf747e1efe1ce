"""Sensor noise: drawn anew for each run of a system, the same for the same seed."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats

RATE_NOISE = 5.0
"""Noise of a rate over that of an angle, 1/s."""


def run_stream(seed: int, run: int, purpose: int | None = None) -> np.random.Generator:
    """The random numbers of one run.

    Args:
        seed: of the system.
        run: number of the run, from 0.
        purpose: None for the sensors; other numbers name streams that are drawn beside them.

    Returns:
        A generator that depends on these three and on nothing else.
    """
    sequence = np.random.SeedSequence([seed, run], spawn_key=() if purpose is None else (purpose,))
    return np.random.Generator(np.random.Philox(sequence))


def attitude_noise(stream: np.random.Generator, steps: int, noise: float) -> Floats:
    """What the sensors of an attitude add to each state.

    Args:
        stream: where it is drawn from.
        steps: number of periods, n.
        noise: standard deviation on angles, rad; five times as many rad/s on rates.

    Returns:
        Noise (n + 1, 6) of three angles and three rates.
    """
    deviations = noise * np.array([1.0, 1.0, 1.0, RATE_NOISE, RATE_NOISE, RATE_NOISE])
    return deviations * stream.standard_normal((steps + 1, 6))
