"""Calibration: by how much a committee was too sure of the flights that it predicted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop.models import NINE_OF_TEN, Twin
from twinloop.test import Test
from twinloop.trajectory import Trajectory

FIRST = 2.0
"""Factor on a committee's spread before any of its predictions was flown."""
OF_PARTS = 1.5
"""The same where parts of the only flight sit in it: they know more of what that leaves open than later ones know."""
SMALLEST, LARGEST = 1.0, 30.0
LAST = 3
"""Flights that the factor is the median of."""


def needed_factor(twin: Twin, test: Test, flown: Trajectory) -> float | None:
    """Factor on the members' spread with which nine of ten readings would have been inside the band.

    Args:
        twin: before it learnt the flight.
        test: that was flown.
        flown: the flight.

    Returns:
        The factor; None where the twin has no committee.
    """
    spread = twin.spread(test)
    if spread is None or twin.noise is None:
        return None
    mean, variance = spread
    rows = min(len(mean), len(flown.states))
    if rows < 2:
        return LARGEST
    squares = ((flown.states[1:rows] - mean[1:rows]) / NINE_OF_TEN) ** 2 - twin.noise.sensors**2
    smallest = 1e-12 * np.square([state.scale for state in twin.signals.states])
    factors = np.sqrt(np.maximum(squares, 0.0) / np.maximum(variance[1:rows], smallest))
    return float(np.clip(np.quantile(factors, 0.9), SMALLEST, LARGEST))


def factor(needed: Sequence[float]) -> float:
    """Factor to be used for the next flight.

    Args:
        needed: factors that the flights so far would have needed, in their order.

    Returns:
        The median of the last ones, with the first guess among them while there are few.
    """
    return float(np.median([FIRST, *needed][-LAST:]))
