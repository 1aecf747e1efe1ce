"""Outliers that stand out before anything is learnt: single readings that no motion has made.

In few readings one outlier is most of what is left to explain: it raises the noise that is estimated until it is none
any more, or it is taken for structure. So single readings that stand away from their neighbours are left out on trial,
and the description of the readings decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.identification.context import Context
from twinloop.identification.forms import first_form
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.search.description import shorter
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import begun

STANDS_OUT = 5.0
"""Standard deviations of the sensor's noise from which a reading is suspected."""
TRIED = 3
"""Suspects that are tried, those that stand out most first."""
IGNORING = 12.0
"""What ignoring a reading must gain, in units of χ², beside what it costs to state that reading by itself."""
FEWEST = 9
"""Readings of a run below which none is suspected."""
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
    run are none, and those beside them seldom: they have too few neighbours.

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
    return sorted(found, key=lambda suspect: (-suspect.size, suspect.run, suspect.row, suspect.state))


def _windows(fourth: Floats) -> Floats:
    """The five fourth differences that a reading is in (n - 3, n_x, 5); 0 for those that the ends cut off."""
    padded = np.pad(fourth, ((2, 2), (0, 0)))
    return np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0)


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
    runs, length = list(context.runs), _length(context, context.runs, CLEANING)
    for number, suspect in enumerate(trials, 1):
        tried = [*runs]
        tried[suspect.run] = _ignoring(tried[suspect.run], suspect)
        alone = _length(context, tried, CLEANING + number) + IGNORING + _stated(runs, suspect)
        if shorter(alone, length):
            runs, length = tried, alone
    return replace(context, runs=runs)


def _length(context: Context, runs: Sequence[Run], start: int) -> float:
    """Description length of what a short search finds."""
    brief, form = context.brief(runs), first_form(context.options, context.signals)
    return from_both_sides(brief, begun(brief, form, brief.first_pool(), start)).length


def _ignoring(run: Run, suspect: Suspect) -> Run:
    row, state = suspect.row, suspect.state
    states, weights = run.states.copy(), run.weights.copy()
    before, after = states[row - 2 : row, state], states[row + 1 : row + 3, state]
    states[row, state] = (4.0 * (before[1] + after[0]) - before[0] - after[1]) / 6.0
    weights[row, state] = 0.0
    return replace(run, states=states, weights=weights, smooth=states)


def _stated(runs: Sequence[Run], suspect: Suspect) -> float:
    """−2 log of how likely a reading is that may be anywhere where this state's readings are."""
    readings = np.concatenate([run.states[:, suspect.state] for run in runs])
    variance = float(readings.var())
    away = float(runs[suspect.run].states[suspect.row, suspect.state] - readings.mean())
    return float(log(variance)) + away * away / variance
