"""What readings alone give away: sensors that froze, commands that never changed, nothing but noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

FROZEN = 0.1
"""Share of a run over which a sensor that moved before must give one number to be taken for frozen."""
FEWEST = 10
"""Readings of such a stretch at least."""
AT_ONCE = 0.1
"""Times its usual step that a sensor moved last before it froze: what comes to rest by itself moves less and less."""
COUNTS = 1.5
"""Counts of a rounded sensor that it moved last before it froze: by one of them it also comes to rest by itself."""
LIKE = 0.8
"""Share of the stretches in which a sensor repeats itself that are as long as most of them, where it is slow."""
DERIVED = 1e-3
"""Share of a rate's noise by which it may be off what another state's readings say, where it is computed of them."""
FORGETS = 0.999
"""Share of its last value that such a filter keeps at most."""
MOST_ROWS = 0.95
"""Share of the rows in which it has to be so."""
NOISY = 1e-6
"""Share of a state's size that its noise is at least, where readings are not exact."""
FEWEST_DERIVED = 12
"""Rows at least from which that is read."""
WHITE = 1.5
"""Von Neumann's ratio, 2 for white noise and near 0 for what moves smoothly, above which nothing else is seen."""


def suspicious(runs: Sequence[Trajectory], signals: Signals) -> Iterator[Remark]:
    """Remarks on readings that no machine gives.

    Args:
        runs: that were recorded.
        signals: of the system.
    """
    for i, state in enumerate(signals.states):
        frozen = sum(froze(run.states[:, i]) for run in runs)
        if frozen:
            yield serious(
                "frozen",
                f"{state.name} is constant over a tenth or more of {frozen} of {len(runs)} runs, although it"
                " was moving before: its sensor froze, the log repeats its last value, or it hit a"
                " stop; remove these rows.",
            )
    records = [run.states for run in runs]
    for i, state in enumerate(signals.states):
        periods = repeats([states[:, i] for states in records])
        if periods > 1:
            yield note(
                "repeated-readings",
                f"{state.name} repeats every reading: it gives a new one each {periods} periods"
                f" ({periods * signals.dt:.3g} s). To the twin it is a late sensor and a noisy one; log what an"
                " estimator makes of it, or choose the sensor's own period for dt.",
            )
    for i, j in derived(records):
        names = signals.state_names
        yield note(
            "derived-rate",
            f"{names[i]} is computed from the readings of {names[j]}, as a filtered difference of them: both have the"
            " same noise, which a law can take for motion. Log what a sensor of its own reads, if there is one.",
        )
    for j, command in enumerate(signals.commands):
        sent = [run.commands[:, j] for run in runs]
        if min(map(np.min, sent)) == max(map(np.max, sent)):
            yield note(
                "constant-command",
                f"{command.name} is {sent[0][0]:g} {command.unit} in every row: its effect cannot be learnt;"
                " check that the command that was sent was logged.",
            )
    moved = [i for i in range(signals.n_x) if any(np.ptp(run.states[:, i]) > 0.0 for run in runs)]
    if moved and all(ratio([run.states[:, i] for run in runs]) > WHITE for i in moved):
        yield serious(
            "only-noise",
            "Readings change from row to row as much as over whole runs: they contain only noise; check"
            " the sensors, their units, and that the period is not far too long.",
        )


def froze(readings: Floats) -> bool:
    """Whether a sensor that moved gives one number over a stretch of a run, at once.

    Args:
        readings: of one state (n + 1,).
    """
    steps = np.abs(np.diff(readings))
    ends = np.flatnonzero(np.concatenate([[True], steps != 0.0, [True]]))
    lengths = np.diff(ends)
    longest = int(np.argmax(lengths))
    first, last = int(ends[longest]), int(ends[longest + 1])
    others = np.concatenate([steps[:first], steps[last - 1 :]])
    if lengths[longest] < max(FEWEST, FROZEN * len(readings)) or not len(others):
        return False
    usual = float(np.median(others))
    # A reading that is rounded stands still now and then; one of a system at rest moves less and less before.
    beside = [steps[k] for k in (first - 1, last - 1) if 0 <= k < len(steps)]
    at_once = max(AT_ONCE * usual, COUNTS * float(np.diff(np.unique(readings)).min()))
    return bool(usual > 0.0 and beside and min(beside) > at_once)


def repeats(records: Sequence[Floats]) -> int:
    """The number of periods in which a slow sensor gives a new reading; 1 where it gives one in each.

    Args:
        records: of one state, a run each (n + 1,).
    """
    fresh = [np.flatnonzero(np.diff(readings) != 0.0) for readings in records]
    lengths = np.concatenate([np.diff(rows) for rows in fresh])
    if len(lengths) < FEWEST:
        return 1
    usual = int(np.bincount(lengths).argmax())
    return usual if np.mean(lengths == usual) >= LIKE else 1


def derived(records: Sequence[Floats]) -> Iterator[tuple[int, int]]:
    """States that are computed from the noisy readings of another one as a filtered difference, each with that one.

    Args:
        records: of all states, a run each (n + 1, n_x).
    """
    runs = [Run.of(states, np.zeros((len(states) - 1, 1))) for states in records]
    sizes = np.max([np.abs(states).max(axis=0) for states in records], axis=0)
    noise = np.sqrt(guessed_noise(runs, np.where(sizes > 0.0, sizes, 1.0)))
    # What is exact, or never moves, says nothing of how it was made.
    read = [i for i in range(records[0].shape[1]) if 0.0 < NOISY * sizes[i] < noise[i]]
    for i in read:
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
            # A filter may begin anywhere.
            if left[int(MOST_ROWS * len(left))] < DERIVED * noise[i] and kept < FORGETS * sizes[i]:
                yield i, j


def ratio(records: Sequence[Floats]) -> float:
    """Von Neumann's ratio: mean square of successive differences over the variance; 2 for white noise.

    Args:
        records: of one state, a run each (n + 1,).
    """
    differences = sum(float(np.square(np.diff(values)).mean()) for values in records)
    variance = sum(float(values.var()) for values in records)
    return differences / variance if variance > 0.0 else 0.0
