"""What a twin is learnt from, where there is more than it pays to learn from: long campaigns and long logs stay quick.

Flights of tests are learnt whole or not at all. A log may be many times as long as all of them, and little of it tell
anything: of one that leaves no room for others only the liveliest parts are learnt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, zip_longest

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.remarks import Remark, note
from twinloop.signals import Signals

PARTS = 4
"""Of a log that is too long, of one length: it may move at several times."""
SHORTEST = 8
"""Readings of a part at least: of many logs fewer parts are taken."""


@dataclass(frozen=True, eq=False)
class Selected:
    """An experiment that is learnt from.

    Args:
        experiment: it.
        parts: first and last reading of each part of it that is learnt, in order.
    """

    experiment: Experiment
    parts: tuple[tuple[int, int], ...]

    @property
    def readings(self) -> int:
        """Number of readings that are learnt, each of all states."""
        return sum(last - first + 1 for first, last in self.parts)

    def recorded(self) -> list[tuple[Floats, Floats]]:
        """States (n + 1, n_x) and commands (n, n_u) of each part."""
        run = self.experiment.trajectory
        return [(run.states[first : last + 1], run.commands[first:last]) for first, last in self.parts]


def distinct(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Experiments without those whose record is an earlier one's to the last bit: they tell nothing new.

    Args:
        experiments: in the order of `tell`.
    """
    first: dict[tuple[bytes, bytes], Experiment] = {}
    for run in experiments:
        first.setdefault((run.trajectory.states.tobytes(), run.trajectory.commands.tobytes()), run)
    return list(first.values())


def learnt_from(experiments: Sequence[Experiment], most: int, signals: Signals) -> list[Selected]:
    """What to learn from, within a number of readings: the newest, then in turn a surprising and a recent one.

    A twin has to learn what it did not predict; a recent flight shows how the machine is now.

    Args:
        experiments: in the order told, at least one.
        most: readings in all, each of all states; a newest test that is longer stands alone.
        signals: of the system.

    Returns:
        All that are distinct, whole, where they are few enough; in the order told.
    """
    runs = [Selected(run, ((0, run.trajectory.steps),)) for run in distinct(experiments)]
    if sum(run.readings for run in runs) <= most:
        return runs
    of_tests = sum(run.readings for run in runs if run.experiment.test is not None)
    logs = sum(run.experiment.test is None for run in runs)
    # What tests leave, but no less than half: the newest of them have room in any case.
    share = max(most - of_tests, most // 2) // max(1, logs)
    runs = [_liveliest(run, share, signals) if run.experiment.test is None else run for run in runs]
    numbers = range(len(runs))
    surprising = sorted(numbers, key=lambda i: _surprise(runs[i].experiment), reverse=True)
    pairs = zip_longest(reversed(numbers), surprising)
    chosen, room = {numbers[-1]}, most - runs[-1].readings
    for i in chain.from_iterable(pairs):
        if i not in chosen and runs[i].readings <= room:
            chosen.add(i)
            room -= runs[i].readings
    return [runs[i] for i in sorted(chosen)]


def shortened(selected: Sequence[Selected], dt: float) -> list[Remark]:
    """What is said of logs of which parts are learnt: which ones.

    Args:
        selected: what is learnt.
        dt: period, s.
    """
    cut = [one for one in selected if one.readings <= one.experiment.trajectory.steps]
    if not cut:
        return []
    each = [", ".join(f"{first * dt:.4g} to {last * dt:.4g} s" for first, last in one.parts) for one in cut]
    what = "one log" if len(cut) == 1 else f"{len(cut)} logs"
    return [
        note(
            "parts-of-logs",
            f"Of {what} only the parts are learnt in which states and commands move most: {'; '.join(each)}. The twin"
            " is held against all of it. The option most_readings says how many readings are learnt.",
        )
    ]


def _liveliest(run: Selected, most: int, signals: Signals) -> Selected:
    """The parts of a log in which most moves, of at most so many readings together; itself if it has no more.

    What moves is measured in variances, of each column within a part over that within the whole log.
    """
    flown = run.experiment.trajectory
    if run.readings <= most:
        return run
    parts = min(PARTS, max(1, most // SHORTEST))
    length = max(SHORTEST, most // parts)
    columns = np.concatenate([signals.difference(flown.states[1:], flown.states[0]), flown.commands], axis=1)
    count = len(columns) // (length - 1)
    pieces = columns[: count * (length - 1)].reshape(count, length - 1, -1)
    whole = columns.var(axis=0)
    moves = np.divide(pieces.var(axis=1), whole, out=np.zeros((count, len(whole))), where=whole > 0.0)
    chosen = np.sort(np.argsort(-moves.sum(axis=1), kind="stable")[:parts])
    firsts = (chosen * (length - 1)).tolist()
    return Selected(run.experiment, tuple((first, first + length - 1) for first in firsts))


def _surprise(run: Experiment) -> tuple[float, float]:
    """Error of the twin that had not learnt it, over that of a model that never moves; then how much it moved.

    A flight that no twin had predicted counts as the greatest surprise.
    """
    if run.before is None:
        return float("inf"), run.frozen
    return run.before / run.frozen if run.frozen > 0.0 else run.before, run.frozen
