"""Directions of the best model so far: how it has alike commands act together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum
from twinloop.identification.terms.directions import Direction, turned
from twinloop.law.actuation import alike_commands
from twinloop.signals import Signals

EQUAL = 0.8
"""Commands that move an output at least this much as strongly as the strongest do it equally."""
LEAST = 0.1
"""Those that move it less than this do not."""
STEP = 0.01
"""Of a command, in units of its scale, by which it is found how strongly it moves an output."""


def directions(problem: Problem, sums: Sequence[Sum], signals: Signals) -> list[Direction]:
    """How alike commands move each output in the middle of the runs, and all of them alike.

    Args:
        problem: of the sums.
        sums: of the best model so far.
        signals: of the system.

    Returns:
        Directions without repetition; none where no commands are alike.
    """
    found = []
    middle = problem.stages.start.mean(axis=0)
    for group in (group for group in alike_commands(signals) if len(group) > 1):
        places = [signals.n_x + i for i in group]
        rows = np.repeat(middle[np.newaxis], 2 * len(group), axis=0)
        for row, place in enumerate(places):
            rows[2 * row, place] += STEP
            rows[2 * row + 1, place] -= STEP
        answers = [*(_answers(problem, sum_, rows) for sum_ in sums), np.ones(len(group))]
        found += [_direction(places, shares) for shares in answers]
    return [direction for direction in dict.fromkeys(found) if len(direction) > 1]


def _answers(problem: Problem, found: Sum, rows: Floats) -> Floats:
    """How strongly an output answers to each command, from rows a step above and a step below its middle in turn."""
    known = dict.fromkeys(problem.priors.fixed.get(found.chain.states[0], ()), 1.0)
    terms = [*found.weights.items(), *known.items()]
    # Summed row by row: a product of matrices rounds differently from processor to processor.
    weighted = problem.pool.values([term for term, _ in terms], rows) * np.array([w for _, w in terms])
    values: Floats = weighted.sum(axis=1)
    with np.errstate(invalid="ignore"):  # what is not finite is no answer
        return values[::2] - values[1::2]


def _direction(places: Sequence[int], shares: Floats) -> Direction:
    """Inputs by their shares, of which nearly equal ones are equal; empty where nothing answers."""
    largest = float(np.abs(shares).max())
    if not (np.isfinite(largest) and largest > 0.0):
        return ()
    parts = [
        (place, float(np.sign(share)) * (1.0 if abs(share) >= EQUAL else round(abs(share), 1)))
        for place, share in zip(places, (shares / largest).tolist(), strict=True)
        if abs(share) >= LEAST
    ]
    return turned(parts)
