"""What motion has filled: a hidden state by the readings of the states that fill it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate

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
    turning = hidden.turns > 0.0 and not hidden.gap

    def filling(inputs: Floats) -> Floats:
        given = inputs[:, list(drivers)] / scales
        over: Floats = (given * given if hidden.squared else given).mean(axis=1) - rest
        return over

    first, half, last = (filling(inputs) for inputs in stages)
    if hidden.gap:
        one = Masses(*(np.array([x]) for x in (hidden.turns, hidden.gap, hidden.damping, hidden.time)))
        start, middle, end = behind_gaps(one, (first, half, last), runs, dt)
        return start[:, :, 0], middle[:, :, 0], end[:, :, 0]
    # Two that turn into each other are one complex number z: z' = (1 + i) filling - (1 / time - i / turns) z. One alone
    # is such a number without an imaginary part, which never turns.
    turns = hidden.turns if turning else math.inf
    fades, unit = np.array([dt / hidden.time, -dt / turns]), np.array([1.0, 0.0])
    square = _product(fades, fades)
    cube, fourth = _product(square, fades), _product(square, square)
    kept = unit - fades + square / 2.0 - cube / 6.0 + fourth / 24.0
    shares = unit - fades + square / 2.0 - cube / 4.0, 4.0 * unit - 2.0 * fades + square / 2.0, unit
    filled = [np.array([each, each if turning else 0.0 * each]) for each in (first, half, last)]
    parts = [_product(each, share) for each, share in zip(filled, shares, strict=True)]
    added = dt / 6.0 * (parts[0] + parts[1] + parts[2])
    start, end = np.empty_like(filled[0]), np.empty_like(filled[0])
    for rows in runs:
        if rows.start == rows.stop:
            continue
        begun = _still(filled[0][:, rows.start], hidden.time, turns) if hidden.settled else np.zeros(2)
        values = _carried(kept, added[:, rows], begun)
        start[:, rows], end[:, rows] = values[:, :-1], values[:, 1:]
    # A time far below a period lasts no run in such steps: what is not finite explains nothing.
    with np.errstate(over="ignore", invalid="ignore"):
        slopes = [
            given - np.array([z[0] / hidden.time + z[1] / turns, z[1] / hidden.time - z[0] / turns])
            for given, z in ((filled[0], start), (filled[2], end))
        ]
        middle = 0.5 * (start + end) + dt / 8.0 * (slopes[0] - slopes[1])
    numbers = slice(2 if turning else 1)
    return start[numbers].T, middle[numbers].T, end[numbers].T


def _product(a: Floats, b: Floats) -> Floats:
    """Of complex numbers, real and imaginary part (2, ...): NumPy's own has other bits on other processors."""
    return np.array([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])


def _still(filling: Floats, time: float, turns: float) -> Floats:
    """Where a complex number stands still: filling / (1 / time - i / turns) (2,)."""
    ratio = time / turns
    return _product(filling, time / (1.0 + ratio * ratio) * np.array([1.0, ratio]))


def _carried(kept: Floats, added: Floats, begun: Floats) -> Floats:
    """Complex numbers of which each period keeps a part and adds to it (2, periods + 1)."""
    (real, imaginary), (first, second) = kept.tolist(), begun.tolist()
    values = np.zeros((2, added.shape[1] + 1))
    if not imaginary:
        values[0] = list(accumulate(added[0].tolist(), lambda now, more: real * now + more, initial=first))
        return values

    def goes(now: tuple[float, float], more: tuple[float, float]) -> tuple[float, float]:
        x, y = now
        return real * x - imaginary * y + more[0], real * y + imaginary * x + more[1]

    every = zip(*added.tolist(), strict=True)
    values[:] = np.array(list(accumulate(every, goes, initial=(first, second)))).T
    return values
