"""Support: the readings on which terms are not zero, of which each term needs some of its own.

A stop is touched on a handful of readings. Products of what begins there draw any curve through these, each pays for
itself many times over, and the law diverges at the next touch that is a little deeper. No price of a term prevents it:
what they gain there is what the few readings cannot tell from the truth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats
from twinloop.identification.context import Context
from twinloop.identification.description import shortest
from twinloop.identification.fit.settling import settled
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum
from twinloop.identification.terms.bounds import bounded_solution, excludes_zero

MANY = 30
"""Readings from which a term has enough of them, however many others share these."""
EACH = 5
"""Readings that terms need, each, where they share fewer."""


def supported(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis without terms that share too few readings with others; the very same where all have enough.

    Args:
        context: of the identification.
        hypothesis: with a fit, by whose tuned constants it is judged where its terms begin.
    """
    pool = hypothesis.pool
    used = pool.needed(term for found in hypothesis.sums for term in found.weights)
    if hypothesis.form == "absolute" or not any(pool[node].operation == "max" for node in used):
        return hypothesis
    placed = settled(hypothesis)
    problem = Problem(context, placed)
    sums = tuple(borne(problem, found) for found in placed.sums)
    if all(new is old for new, old in zip(sums, placed.sums, strict=True)):
        return hypothesis
    return replace(placed, sums=sums)


def borne(problem: Problem, found: Sum) -> Sum:
    """The sum without the weakest of those terms that are zero on most readings, where these do not bear them all.

    Args:
        problem: that the sum's terms are of.
        found: the sum; its chain says by which noise terms are weak.
    """
    terms = problem.usable(list(found.weights))
    rows: NDArray[np.bool_] = np.asarray(problem.values(terms).any(axis=0), dtype=np.bool_)
    enough = min(MANY, len(rows) // 2)
    rare = [i for i in range(len(terms)) if rows[:, i].sum() < enough]
    if len(terms) < len(found.weights) or len(rare) <= _bearable(rows, rare):
        return found
    gram = problem.gram(found.chain, problem.values(terms))
    limits = problem.limits(found.chain, terms)
    must = {i for i, bounds in limits.items() if excludes_zero(bounds)}
    kept, weights = list(range(len(terms))), None

    def without(i: int) -> tuple[Floats, float] | None:
        subset = [j for j in kept if j != i]
        solved = gram.solve(subset)
        return None if solved is None else bounded_solution(solved, subset, limits)

    while len(rare) > _bearable(rows, rare) and (droppable := [i for i in rare if i not in must]):
        # Where the readings cannot even tell apart what is left, the last goes.
        fewer = [(i, without(i)) for i in reversed(droppable)]
        dropped, weights = shortest(fewer, lambda one: np.inf if one[1] is None else one[1][1])
        kept, rare = [j for j in kept if j != dropped], [j for j in rare if j != dropped]
    if weights is None:
        return found
    values = weights[0].tolist()
    return replace(found, weights=dict(zip((terms[i] for i in kept), values, strict=True)), others=[])


def _bearable(rows: NDArray[np.bool_], rare: list[int]) -> int:
    """How many terms the readings bear on which any of those that are rare is not zero; one is always borne."""
    return max(1, int(rows[:, rare].any(axis=1).sum()) // EACH)
