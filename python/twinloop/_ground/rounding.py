"""Rounding: what a sensor that counts changes by at least."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats

SAME = 1e-9
"""Share of the largest reading by which readings of one count may differ, as where turns were added or taken off."""
ON_GRID = 0.02
"""Share of a count by which readings of a sensor that rounds may be off, as where they were saved in another unit."""
CHANCE = 1e-6
"""Probability above which a grid on which all readings lie says nothing of them."""
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
    """The distance of which all differences of readings (n,) are multiples, one of them itself; 0: there is none.

    Two of many readings happen to be very close, and beside such a pitch any other reading is a multiple: so the pitch
    is measured over longer and longer distances, and each reading must be near a multiple by the same share of it.
    """
    values = np.unique(readings)
    if not len(values) or not np.isfinite(values).all():
        return 0.0
    apart = np.diff(values, prepend=-np.inf) > SAME * np.abs(values).max()
    distinct = values[apart]
    if len(distinct) < 2:
        return 0.0
    # Of readings that are uniform on a cell, each of those that did not make the pitch is on the grid by chance.
    chance = (2.0 * ON_GRID) ** (len(distinct) - 2)
    if chance > CHANCE and not len(distinct) < REPEATED * len(readings):
        return 0.0
    offsets = distinct - distinct[0]
    pitch = _measured(np.sort(np.concatenate([np.diff(distinct), offsets[1:]])))
    steps = offsets / pitch
    return pitch if bool((np.abs(steps - np.round(steps)) < ON_GRID).all()) else 0.0


def _measured(distances: Floats) -> float:
    """The shortest of sorted distances, as the longer ones tell its length if they are multiples of it."""
    pitch = float(distances[0])
    ends = np.searchsorted(distances, pitch * 2.0 ** np.arange(1, 64), side="right")
    for end in np.unique(ends).tolist():
        known = distances[:end]
        pitch = float(known.sum() / np.round(known / pitch).sum())
    return pitch
