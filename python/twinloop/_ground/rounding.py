"""Rounding: what a sensor that counts changes by at least."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats

ON_GRID = 1e-6
"""Share of a count, or of what it is counted from, by which readings of a sensor that rounds may be off."""
REPEATED = 0.5
"""Share of its readings that differ at most, of a sensor that rounds."""


def count(records: Sequence[Floats]) -> float:
    """What a rounded sensor's reading changes by at least, 0 for one that is not: hardly any of its readings repeats.

    Args:
        records: of one state, a run each (n + 1,).
    """
    readings = np.concatenate(records)
    return on_grid(readings) if len(np.unique(readings)) < REPEATED * len(readings) else 0.0


def on_grid(readings: Floats) -> float:
    """The distance of which all differences of readings (n,) are multiples, one of them itself; 0: there is none."""
    values = np.unique(readings)
    if len(values) < 2:
        return 0.0
    least = float(np.diff(values).min())
    steps = (values - values[0]) / least
    return least if bool((np.abs(steps - np.round(steps)) < ON_GRID * np.maximum(steps, 1.0)).all()) else 0.0
