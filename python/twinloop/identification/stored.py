"""What motion has filled: a hidden state by the readings of the states that fill it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.gaps import Masses, behind_gaps
from twinloop.law.actuation import HiddenState
from twinloop.signals import Signals


def stored(
    hidden: HiddenState, stages: Sequence[Floats], runs: Sequence[slice], signals: Signals
) -> tuple[Floats, Floats, Floats]:
    """A hidden state that is integrated with the states, in each period by one Runge-Kutta step, as the law takes it.

    Args:
        hidden: such a one; of two that turn into each other, or are beside a gap, the first one.
        stages: inputs of a model at the start, the middle and the end of each period (rows, inputs), all runs in one.
        runs: rows of each run.
        signals: of the system.

    Returns:
        Its values at the start, the middle and the end of each period (rows, 1); with its partner's, if it has one
        (rows, 2).
    """
    drivers = hidden.drivers(signals)
    scales = np.array(list(drivers.values()))
    dt, rest = signals.dt, hidden.rest or 0.0
    # Two that turn into each other are one complex number z: z' = (1 + i) filling - (1 / time - i / turns) z.
    turning = hidden.turns > 0.0 and not hidden.gap
    fades = complex(1.0 / hidden.time, -1.0 / hidden.turns) if turning else 1.0 / hidden.time
    time = 1.0 / fades if turning else hidden.time

    def filling(inputs: Floats) -> Any:
        given = inputs[:, list(drivers)] / scales
        over = (given * given if hidden.squared else given).mean(axis=1) - rest
        return over * (1.0 + 1.0j) if turning else over

    first, half, last = (filling(inputs) for inputs in stages)
    if hidden.gap:
        one = Masses(*(np.array([x]) for x in (hidden.turns, hidden.gap, hidden.damping, hidden.time)))
        start, middle, end = behind_gaps(one, (first, half, last), runs, dt)
        return start[:, :, 0], middle[:, :, 0], end[:, :, 0]
    z = dt * fades if turning else dt / time
    square = z * z
    kept = 1.0 - z + square / 2.0 - square * z / 6.0 + square * square / 24.0
    added = (
        dt
        / 6.0
        * (first * (1.0 - z + square / 2.0 - square * z / 4.0) + half * (4.0 - 2.0 * z + square / 2.0) + last)
    )
    start, end = np.empty_like(first), np.empty_like(first)
    for rows in runs:
        if rows.start == rows.stop:
            continue
        begun = time * first[rows][0].item() if hidden.settled else 0.0
        values = list(accumulate(added[rows].tolist(), lambda now, more: kept * now + more, initial=begun))
        start[rows], end[rows] = values[:-1], values[1:]
    # A time far below a period lasts no run in such steps: what is not finite explains nothing.
    with np.errstate(over="ignore", invalid="ignore"):
        slopes = first - start / time, last - end / time
        middle = 0.5 * (start + end) + dt / 8.0 * (slopes[0] - slopes[1])
    parts = (np.real, np.imag) if turning else (np.real,)
    return tuple(np.stack([part(each) for part in parts], axis=1) for each in (start, middle, end))  # type: ignore[return-value]
