"""Missing: single readings that a log does not have, put half-way between those before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import enumerated
from twinloop.remarks import Remark, note
from twinloop.signals import TURNS, State

SHARE = 0.05
"""Share of a column's readings up to which single ones are filled in: what lies between two tells nothing new."""


def filled(readings: Floats, states: Sequence[State]) -> tuple[Floats, tuple[Remark, ...]]:
    """Readings with single missing ones filled in, and a remark that says how many.

    As between two samples of a `.ulg`, a reading may be missing between two others, not two in a row. An angle that
    wraps takes the short way; one of which that is not declared is left as it is where it may have wrapped.

    Args:
        readings: a column for each state (n + 1, columns), NaN where there is none.
        states: of the columns.

    Returns:
        Both: the readings themselves and no remark where none is filled in.
    """
    found, counts = readings.copy(), {}
    for column, state in zip(found.T, states, strict=True):
        missing = np.isnan(column)
        there = np.isfinite(column)
        single = 1 + np.flatnonzero(missing[1:-1] & there[:-2] & there[2:])
        if not 0 < len(single) == missing.sum() <= SHARE * len(column):
            continue
        change = column[single + 1] - column[single - 1]
        if state.period is not None:
            change -= np.rint(change / state.period) * state.period
        elif (np.abs(change) > 0.5 * TURNS.get(state.unit, np.inf)).any():
            continue
        column[single] = column[single - 1] + 0.5 * change
        counts[state.name] = len(single)
    return (found, (_said(counts),)) if counts else (readings, ())


def _said(counts: dict[str, int]) -> Remark:
    """That readings were filled in."""
    named = enumerated([f"{count} of {name}" for name, count in counts.items()])
    several = sum(counts.values()) > 1
    return note(
        "filled-in",
        f"The log lacks single readings, {named}: {'each is' if several else 'it is'} taken half-way between those"
        " before and after.",
    )
