"""Outliers that stand out before anything is learnt: single readings that no motion has made.

In few readings one outlier is most of what is left to explain: it raises the noise that is estimated until it is none
any more, or it is taken for structure. So single readings that stand away from their neighbours are left out on trial,
and the description of the readings decides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.identification.context import Context
from twinloop.identification.description import shorter
from twinloop.identification.forms import briefly_described
from twinloop.identification.records import Run, guessed_noise
from twinloop.signals import Signals

STANDS_OUT = 5.0
"""Standard deviations of the sensor's noise from which a reading is suspected."""
TRIED = 3
"""Suspects that are tried, those that stand out most first."""
IGNORING = 12.0
"""What ignoring a reading must gain, in units of χ², beside what it costs to state that reading by itself."""
FEWEST = 9
"""Readings of a run below which none is suspected."""
AT_AN_END = 10.0
"""Times larger than any other in the run that a fourth difference at an end of it is where a reading is suspected."""
CLEANING = 200
"""Number of the first trial, by which what it draws is told from what starts draw."""

# A reading that is wrong by 1, a slope that changes by 1 there, and a state that jumps by 1 between that reading and
# the one before or after it, as fourth differences around the reading show them.
WRONG = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
MOTIONS = np.array(
    [[1.0, -2.0, 1.0, 0.0, 0.0], [0.0, 1.0, -2.0, 1.0, 0.0], [0.0, 0.0, 1.0, -2.0, 1.0],
     [1.0, -3.0, 3.0, -1.0, 0.0], [0.0, 1.0, -3.0, 3.0, -1.0]]
)  # fmt: skip


@dataclass(frozen=True)
class Suspect:
    """A reading that stands away from its neighbours.

    Args:
        run: its number.
        row: of the reading.
        state: whose reading it is.
        size: how far it stands away, in standard deviations of the noise.
    """

    run: int
    row: int
    state: int
    size: float


def suspects(runs: Sequence[Run], scales: Floats) -> list[Suspect]:
    """Readings that look more like an error of their own than like a corner or a jump of the motion.

    One at a corner is none, either: what the motion does there is not known yet. The first two and the last two of a
    run have too few neighbours to tell: they are suspected where nothing else in the run is nearly as rough.

    Args:
        runs: recorded.
        scales: of the states (n_x,).

    Returns:
        Those that stand out most first.
    """
    deviations = np.sqrt(guessed_noise(runs, scales))
    found = []
    for number, run in enumerate(runs):
        if len(run.states) < FEWEST:
            continue
        fourth = np.diff(run.states, n=4, axis=0) / deviations
        around, seen = _windows(fourth), _windows(np.ones_like(fourth))
        sizes, left = _explained(around, seen * WRONG)
        others = np.min([_explained(around, seen * motion)[1] for motion in MOTIONS], axis=0)
        rows, states = np.nonzero((np.abs(sizes) > STANDS_OUT) & (left < others))
        found += [
            Suspect(number, row + 2, state, float(abs(sizes[row, state])))
            for row, state in zip(rows.tolist(), states.tolist(), strict=True)
        ]
        last = len(run.states) - 1
        found += [Suspect(number, row, state, size) for row, state, size in _at_the_start(fourth)]
        found += [
            Suspect(number, last - row, state, size) for row, state, size in _at_the_start(fourth[::-1])
        ]
    return sorted(found, key=lambda suspect: (-suspect.size, suspect.run, suspect.row, suspect.state))


def _windows(fourth: Floats) -> Floats:
    """The five fourth differences that a reading is in (n - 3, n_x, 5); 0 for those that the ends cut off."""
    padded = np.pad(fourth, ((2, 2), (0, 0)))
    return np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0)


def _at_the_start(fourth: Floats) -> Iterator[tuple[int, int, float]]:
    """Row, state and size of what is wrong with the first or the second reading, by the fourth differences of a run."""
    sizes = np.abs(fourth)
    rest = np.maximum(STANDS_OUT, AT_AN_END * sizes[2:].max(axis=0))
    for state in np.flatnonzero(sizes[0] > rest).tolist():
        # Of the second reading there is a part in the second difference, too, of the other sign and a fourth as large.
        second = 8.0 * sizes[1, state] > sizes[0, state]
        yield int(second), state, float(sizes[0, state]) / (4.0 if second else 1.0)


def _explained(around: Floats, pattern: Floats) -> tuple[Floats, Floats]:
    """How large a pattern is in some differences, and what it leaves of their squares."""
    sizes = (around * pattern).sum(axis=-1) / (pattern * pattern).sum(axis=-1)
    rest = around - sizes[..., np.newaxis] * pattern
    return sizes, (rest * rest).sum(axis=-1)


def cleaned(context: Context) -> Context:
    """The context with runs in which single readings are ignored, where that describes the readings more briefly.

    An ignored reading stands where its neighbours foretell it, and weighs nothing.
    """
    scales = np.array([state.scale for state in context.signals.states])
    trials = suspects(context.runs, scales)[:TRIED]
    if not trials:
        return context
    runs, length = list(context.runs), briefly_described(context, context.runs, CLEANING)
    for number, suspect in enumerate(trials, 1):
        tried = [*runs]
        tried[suspect.run] = ignoring(tried[suspect.run], suspect, context.signals)
        alone = briefly_described(context, tried, CLEANING + number) + IGNORING + _stated(runs, suspect)
        if shorter(alone, length):
            runs, length = tried, alone
    return replace(context, runs=runs)


def ignoring(run: Run, suspect: Suspect, signals: Signals) -> Run:
    """The run without a reading: it stands where its neighbours foretell it, and weighs nothing.

    Args:
        run: that it is a reading of.
        suspect: the reading.
        signals: of the system.
    """
    row, state = suspect.row, suspect.state
    states, weights = run.states.copy(), run.weights.copy()
    rates = [i for i, other in enumerate(signals.states) if other.derivative_of == signals.states[state].name]
    slopes = signals.dt * states[:, rates[0]] if rates else None
    states[row, state] = _foretold(states[:, state], slopes, row)
    weights[row, state] = 0.0
    return replace(run, states=states, weights=weights, smooth=states)


def _foretold(readings: Floats, slopes: Floats | None, row: int) -> float:
    """A reading by those beside it; at the end of a run by those on one side of it, and by slopes where they are read.

    Args:
        readings: of one state (n,).
        slopes: of it, a period (n,); None: nothing reads them.
        row: of the reading.
    """
    if row >= len(readings) - 2:
        turned = None if slopes is None else -slopes[::-1]
        return _foretold(readings[::-1], turned, len(readings) - 1 - row)
    if row == 0 and slopes is not None:
        return float(readings[1] - 0.5 * (slopes[0] + slopes[1]))
    if row == 0:
        return float(3.0 * (readings[1] - readings[2]) + readings[3])
    if row == 1:
        return float((readings[0] + 3.0 * readings[2] - readings[3]) / 3.0)
    before, after = readings[row - 2 : row], readings[row + 1 : row + 3]
    return float((4.0 * (before[1] + after[0]) - before[0] - after[1]) / 6.0)


def _stated(runs: Sequence[Run], suspect: Suspect) -> float:
    """−2 log of how likely a reading is that may be anywhere where this state's readings are."""
    readings = np.concatenate([run.states[:, suspect.state] for run in runs])
    variance = float(readings.var())
    away = float(runs[suspect.run].states[suspect.row, suspect.state] - readings.mean())
    return float(log(variance)) + away * away / variance
