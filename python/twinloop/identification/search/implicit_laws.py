"""Implicit laws: accelerations of joints that share masses, then quotients, where these make descriptions shorter."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop.identification.search.joints import with_joints
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.quotients import renewed, with_quotients
from twinloop.identification.search.structure import Sum
from twinloop.signals import Signals
from twinloop.streams import Unit


def implicit_laws(
    problem: Problem,
    signals: Signals,
    known: Sequence[Sum],
    terms: Sequence[int],
    *,
    again: bool,
    moves: int,
    largest: int,
    unit: Unit,
) -> list[Sum] | None:
    """The best sums with terms of implicit laws.

    Args:
        problem: of all chains; new expressions are entered in its pool.
        signals: of the system.
        known: the best sum of each chain so far, with its noise.
        terms: of the ladder.
        again: whether quotients were searched before, on states that were not smoothed: those that there are get new
            constants, and no others are looked for.
        moves: of each search over subsets.
        largest: number of terms of a sum at most.
        unit: of work.

    Returns:
        A sum for each chain; None where none of them is another one.
    """
    coupled = with_joints(problem, signals, known, moves=moves, largest=largest, unit=unit)
    if again:
        found = renewed(problem, signals, coupled, moves=moves, largest=largest, unit=unit)
    else:
        found = with_quotients(problem, signals, coupled, terms, moves=moves, largest=largest, unit=unit)
    return None if all(new is old for new, old in zip(found, known, strict=True)) else found
