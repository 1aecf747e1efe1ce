"""Copies of a flight: saved again with other digits, it has the same noise, which no two flights share."""

from __future__ import annotations

import math

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.data.reports import scatters
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory, completed

LIKE = 0.25
"""Share of a sensor's noise that two records of one flight differ by at most, root mean square; two flights: 1.4."""
ROUNDED = 0.01
"""The same for a reading without noise, as a share of its own spread, and for a command, of the width of its bounds."""
STEPPED = 0.35
"""The same for a column that was saved in steps, as a share of one: rounding leaves 1 / √12."""
FEWEST = 20
"""Steps from which on noise is told from motion."""
AS_LARGE = 3.0
"""Ratio of noise in differences of two orders, at most; of so few readings that of white noise may exceed 2."""
ORDER = 5
"""Of the differences that leave noise alone."""


def copied(one: Trajectory, other: Trajectory, signals: Signals) -> bool:
    """Whether the shorter of two runs is the beginning of the other one, saved again, or all of it.

    Without noise two flights may be equal, as those of an exact simulator are: of them it says no.

    Args:
        one: run; it may lack what is not measured.
        other: run; the same.
        signals: of the system.
    """
    steps = min(one.steps, other.steps)
    if steps < FEWEST:
        return False
    runs = [completed(run, signals) for run in (one, other)]
    pair = [run.states[: steps + 1] for run in runs]
    bounds = np.array([command.bounds for command in signals.commands])
    sent = _size(runs[0].commands[:steps] - runs[1].commands[:steps])
    if not (sent <= ROUNDED * (bounds[:, 1] - bounds[:, 0])).all():
        return False
    apart, noisy = _size(signals.difference(*pair)), False
    for i in signals.measured:
        columns = [states[:, i] for states in pair]
        # What rounding alone scatters, in one of the two, is no noise of the flight.
        scattering = all(scatters([readings], AS_LARGE) for readings in columns)
        like = (
            LIKE * min(_noise(readings) for readings in columns)
            if scattering
            else ROUNDED * min(float(readings.std()) for readings in columns)
        )
        # A column that was rounded coarsely says nothing of its noise; others have to.
        if apart[i] > max(like, STEPPED * max(_step(readings) for readings in columns)):
            return False
        noisy |= bool(scattering and apart[i] <= like)
    return noisy


def saved_again(run: Trajectory, told: Trajectory, signals: Signals) -> bool:
    """Whether a run is all of another one, saved again.

    Args:
        run: it may lack what is not measured.
        told: run that is recorded.
        signals: of the system.
    """
    return run.steps == told.steps and copied(run, told, signals)


def copy_of(name: str) -> str:
    """What was found, for an error.

    Args:
        name: what the flight is called that is recorded already.
    """
    return (
        f"a copy of one that is recorded already, {name}: their readings differ by far less than their noise, which"
        " no two flights share"
    )


def _size(differences: Floats) -> Floats:
    """Root mean square of each column of (n, m): (m,)."""
    size: Floats = np.sqrt(np.square(differences).mean(axis=0))
    return size


def _step(readings: Floats) -> float:
    """The least by which two readings (n,) differ; 0 where all are equal."""
    gaps = np.diff(np.unique(readings))
    return float(gaps.min()) if gaps.size else 0.0


def _noise(readings: Floats) -> float:
    """Standard deviation of the noise in readings (n,) that scatter."""
    squares = np.square(np.diff(readings, n=ORDER))
    # The median of the square of a normal variable is 0.455 of its mean.
    return math.sqrt(float(np.median(squares)) / 0.455 / math.comb(2 * ORDER, ORDER))
