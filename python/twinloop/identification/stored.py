"""What motion has filled: a hidden state by the readings of the states that fill it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.actuation import HiddenState
from twinloop.signals import Signals


def stored(
    hidden: HiddenState, stages: Sequence[Floats], runs: Sequence[slice], signals: Signals
) -> tuple[Floats, Floats, Floats]:
    """A hidden state that states fill, within each period: one Runge-Kutta step of order four, as the law takes it.

    Args:
        hidden: that states fill.
        stages: inputs of a model at the start, the middle and the end of each period (rows, inputs), all runs in one.
        runs: rows of each run.
        signals: of the system.

    Returns:
        Its values at the start, the middle and the end of each period (rows,).
    """
    scales = np.array([signals.states[place].scale for place in hidden.states])
    dt, time, rest = signals.dt, hidden.time, hidden.rest or 0.0

    def filling(inputs: Floats) -> Floats:
        given = inputs[:, list(hidden.states)] / scales
        over: Floats = (given * given if hidden.squared else given).mean(axis=1) - rest
        return over

    first, half, last = (filling(inputs) for inputs in stages)
    z = dt / time
    kept = 1.0 - z + z**2 / 2.0 - z**3 / 6.0 + z**4 / 24.0
    added = (
        dt / 6.0 * (first * (1.0 - z + z**2 / 2.0 - z**3 / 4.0) + half * (4.0 - 2.0 * z + z**2 / 2.0) + last)
    )
    start, end = np.empty(len(first)), np.empty(len(first))
    for rows in runs:
        if rows.start == rows.stop:
            continue
        begun = time * float(first[rows][0]) if hidden.settled else 0.0
        values = list(accumulate(added[rows].tolist(), lambda now, more: kept * now + more, initial=begun))
        start[rows], end[rows] = values[:-1], values[1:]
    slopes = first - start / time, last - end / time
    return start, 0.5 * (start + end) + dt / 8.0 * (slopes[0] - slopes[1]), end
