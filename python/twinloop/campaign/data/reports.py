"""Reports: which sensors of a log are slow, and which rates are computed of other states' readings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.rounding import count
from twinloop.identification.records import Run, guessed_noise
from twinloop.law.reports import Computed, Held, Reports
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory
from twinloop.unmeasured import sources

FEWEST = 10
"""Stretches at least in which a sensor repeats itself."""
COUNTS = 1.5
"""Counts below which a change of a rounded sensor is one of them."""
LIKE = 0.8
"""Share of the stretches in which a sensor repeats itself that are as long as most of them, where it is slow."""
DERIVED = 1e-3
"""Share of what noise adds to a rate by which it may be off what another's readings say, if it is computed of them."""
AS_LARGE = 2.0
"""Ratio of noise in differences of two orders, at most."""
EXACT = 0.02
"""Share by which a slow change may come out of a filter larger or smaller than it is, where it gives a rate."""
FORGETS = 0.999
"""Share of its last value that such a filter keeps at most."""
PLAIN = 1e-6
"""Share of its last value below which such a rate is a plain difference."""
MOST_ROWS = 0.95
"""Share of the rows in which it has to be so."""
NOISY = 1e-6
"""Share of a state's size that its noise is at least, where readings are not exact."""
FEWEST_DERIVED = 12
"""Rows at least from which that is read."""


def reports_in(runs: Sequence[Trajectory], signals: Signals) -> Reports:
    """What is given of readings: repeated ones, and filtered differences of those whose derivatives they should be.

    A state that is not measured is one in any case.

    Args:
        runs: that were recorded.
        signals: of the system.
    """
    records = [run.states for run in runs]
    found: list[Held | Computed | None] = [
        repeats([states[:, i] for states in records]) for i in range(signals.n_x)
    ]
    for one in derived(records):
        if found[one.rate] is None and is_rate(one, signals):
            found[one.rate] = Computed(one.of, one.kept, one.share)
    for i, of in sources(signals):
        # What is declared needs no noise to show; a log may have filtered it.
        filtered = isinstance(known := found[i], Computed) and known.kept > PLAIN
        found[i] = known if filtered else Computed(of, 0.0, 1.0 / signals.dt)
    return tuple(found) if any(found) else ()


def is_rate(one: Derived, signals: Signals) -> bool:
    """Whether what is computed is the declared derivative of what it is computed of.

    Args:
        one: what is computed, and how.
        signals: of the system.
    """
    slow = one.share * signals.dt / (1.0 - one.kept)
    declared = signals.states[one.rate].derivative_of == signals.state_names[one.of]
    return declared and abs(slow - 1.0) <= EXACT


def repeats(records: Sequence[Floats]) -> Held | None:
    """When a slow sensor gives new readings; None where it gives one in each period.

    Args:
        records: of one state, a run each (n + 1,).
    """
    fresh = [np.flatnonzero(np.diff(readings) != 0.0) + 1 for readings in records]
    lengths = np.concatenate([np.diff(rows) for rows in fresh])
    if len(lengths) < FEWEST:
        return None
    usual = int(np.bincount(lengths).argmax())
    if usual < 2 or np.mean(lengths == usual) < LIKE:
        return None
    # A sensor that rounds what moves evenly changes at even times, too, but always by one count.
    changes = np.concatenate([np.abs(np.diff(readings)) for readings in records])
    changes = changes[changes > 0.0]
    if np.mean(changes < COUNTS * changes.min()) > 0.5:
        return None
    # Runs may begin at any time between two readings.
    first = sorted((int(rows[0]) - 1) % usual + 1 for rows in fresh if len(rows))
    return Held(usual, first[len(first) // 2])


class Derived(NamedTuple):
    """A state that is a filtered difference of the readings of another: r[k] = kept r[k-1] + share (x[k] - x[k-1]).

    Args:
        rate: its place.
        of: that of the other.
        kept: below 1.
        share: in its unit over the other's.
    """

    rate: int
    of: int
    kept: float
    share: float


def derived(records: Sequence[Floats]) -> Iterator[Derived]:
    """States that are computed from the noisy or rounded readings of another one as a filtered difference.

    Args:
        records: of all states, a run each (n + 1, n_x).
    """
    runs = [Run.of(states, np.zeros((len(states) - 1, 1))) for states in records]
    sizes = np.max([np.abs(states).max(axis=0) for states in records], axis=0)
    noise = np.sqrt(guessed_noise(runs, np.where(sizes > 0.0, sizes, 1.0)))
    of_states = [[states[:, i] for states in records] for i in range(len(sizes))]
    counts = np.array([count(readings) for readings in of_states])
    moving = [i for i, size in enumerate(sizes) if size > 0.0]
    # What is exact says nothing of what is made of it: a simulator's step gives differences that are rates, too.
    read = [i for i in moving if counts[i] > 0.0 or (NOISY * sizes[i] < noise[i] and scatters(of_states[i]))]
    noise = np.maximum(noise, counts)
    for i in moving:
        for j in (j for j in read if j != i):
            columns = [np.stack([x[:-1, i], x[1:, j], x[:-1, j]], axis=1) for x in records]
            rows, wanted = np.concatenate(columns), np.concatenate([x[1:, i] for x in records])
            if len(rows) < FEWEST_DERIVED:
                continue
            # A filtered difference: r[k] = a r[k-1] + b (x[k] - x[k-1]); with a = 1 it would be the other one's rate.
            last, change = rows[:, 0] / sizes[i], (rows[:, 1] - rows[:, 2]) / sizes[j]
            across = float((last * change).sum())
            squares = float((last * last).sum()), float((change * change).sum())
            right = float((last * wanted).sum()), float((change * wanted).sum())
            determinant = squares[0] * squares[1] - across * across
            if not determinant > 0.0:
                continue
            kept = (right[0] * squares[1] - right[1] * across) / determinant
            share = (right[1] * squares[0] - right[0] * across) / determinant
            left = np.sort(np.abs(wanted - kept * last - share * change))
            found = Derived(i, j, max(0.0, kept / float(sizes[i])), share / float(sizes[j]))
            # A filter may begin anywhere.
            passed = DERIVED * found.share * float(noise[j])
            if left[int(MOST_ROWS * len(left))] < passed and found.kept < FORGETS:
                yield found


def scatters(records: Sequence[Floats], as_large: float = AS_LARGE) -> bool:
    """Whether what no polynomial follows is noise: it is as large in differences of any order, which motion is not.

    Args:
        records: of one state, a run each (n + 1,).
        as_large: how many times larger it may be in one order than in the next, by chance.
    """
    found = []
    for order in (5, 6):
        differences = [np.diff(readings, n=order) for readings in records if len(readings) > order]
        if not differences:
            return False
        squares = np.square(np.concatenate(differences))
        found.append(float(np.median(squares)) / math.comb(2 * order, order))
    return 0.0 < found[0] < as_large * found[1] and found[1] < as_large * found[0]
