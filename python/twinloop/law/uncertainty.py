"""Uncertainty: what the members of a committee, disturbances and sensors, drawn together, make of a test."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise
from twinloop.law.reports import reports_of
from twinloop.signals import Signals
from twinloop.test import Test

DRAWS = 12
"""Runs of each member of a committee that a band is made of."""
NINE_OF_TEN = 1.645
"""Standard deviations on either side of the mean between which nine of ten normal numbers lie."""


def committee_runs(
    members: Sequence[_core.Model],
    noise: Noise,
    test: Test | Replay,
    draws: int,
    limits: Limits,
    seed: int,
) -> tuple[Floats, Floats]:
    """Runs of a test by each member, under the same drawn disturbances and sensor noise.

    Args:
        members: of the committee, at least one.
        noise: of sensors and disturbances.
        test: what is flown.
        draws: for each member.
        limits: where a run counts as diverged.
        seed: of the random numbers.

    Returns:
        What is read but for the sensors' noise (members × draws, n + 1, n_x), NaN after a run has diverged, and that
        noise.
    """
    reports = reports_of(members[0], limits.signals.n_x)
    seen, moved = noise.drawn(draws, test.steps, Unit(seed).part(0).stream("band"), reports)
    runs = [drawn_runs(member, test, limits, noise=seen, disturbance=moved).read for member in members]
    return np.concatenate(runs), np.tile(seen, (len(runs), 1, 1))


def spread_of(states: Floats, signals: Signals) -> tuple[Floats, Floats]:
    """Mean and variance over the runs that last.

    Args:
        states: of each run (runs, n + 1, n_x), NaN after it has diverged.
        signals: of the system, for states that are periodic.

    Returns:
        Both (n + 1, n_x).
    """
    lasted = np.isfinite(states)
    count = np.maximum(1, lasted.sum(axis=0))
    # From one of the runs: sums of whole states round by more than runs may differ.
    origin = np.where(lasted[0], states[0], 0.0)
    off = np.where(lasted, signals.difference(states, origin), 0.0)
    middle = off.sum(axis=0) / count
    variance = np.where(lasted, np.square(off - middle), 0.0).sum(axis=0) / count
    return origin + middle, variance
