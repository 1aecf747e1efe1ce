"""Which flights a twin is learnt from, where there are more than it pays to learn from: a long campaign stays quick."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, zip_longest

from twinloop.campaign.history import Experiment


def distinct(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Experiments without those whose record is an earlier one's to the last bit: they tell nothing new.

    Args:
        experiments: in the order of `tell`.
    """
    first: dict[tuple[bytes, bytes], Experiment] = {}
    for run in experiments:
        first.setdefault((run.trajectory.states.tobytes(), run.trajectory.commands.tobytes()), run)
    return list(first.values())


def learnt_from(experiments: Sequence[Experiment], most: int) -> list[Experiment]:
    """The flights to learn from, within a number of readings: the newest, then in turn a surprising and a recent one.

    A twin has to learn what it did not predict; a recent flight shows how the machine is now.

    Args:
        experiments: in the order told, at least one.
        most: readings in all, each of all states; a newest flight that is longer stands alone.

    Returns:
        All that are distinct where they are few enough; in the order told.
    """
    runs = distinct(experiments)
    if sum(_readings(run) for run in runs) <= most:
        return runs
    numbers = range(len(runs))
    surprising = sorted(numbers, key=lambda i: _surprise(runs[i]), reverse=True)
    pairs = zip_longest(reversed(numbers), surprising)
    chosen, room = {numbers[-1]}, most - _readings(runs[-1])
    for i in chain.from_iterable(pairs):
        if i not in chosen and _readings(runs[i]) <= room:
            chosen.add(i)
            room -= _readings(runs[i])
    return [runs[i] for i in sorted(chosen)]


def _readings(run: Experiment) -> int:
    return len(run.trajectory.states)


def _surprise(run: Experiment) -> tuple[float, float]:
    """Error of the twin that had not learnt it, over that of a model that never moves; then how much it moved.

    A flight that no twin had predicted counts as the greatest surprise.
    """
    if run.before is None:
        return float("inf"), run.frozen
    return run.before / run.frozen if run.frozen > 0.0 else run.before, run.frozen
