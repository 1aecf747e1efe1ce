"""The committee: models that explain the runs about as well, so that their disagreement is what the runs leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop.elementary import exp
from twinloop.identification.fit.fitting import Fitting
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.bounds import bounded_solution

PLAUSIBLE = 1.5
"""Multiple of the best model's χ² up to which another structure is a member."""


def committee(
    problem: Problem,
    fitting: Fitting,
    sums: Sequence[Sum],
    observer: Sequence[Chain],
    best: _core.Model,
    others: Sequence[_core.Model] = (),
) -> list[_core.Model]:
    """The best model, draws from what the runs leave open of it, and other structures that are nearly as good.

    Args:
        problem: that the sums were found on.
        fitting: that tunes members.
        sums: of the best model, with the other subsets of their search.
        observer: all chains, with their noise.
        best: the best model, tuned.
        others: models that were found elsewhere, fewer than there are seats.

    Returns:
        At most as many as the options ask for, the best first.
    """
    size = fitting.options.committee_size - len(others)
    draw = fitting.unit.stream("structures")
    members = [best]
    _, base, readings, _, draws = fitting.tune(best, sums, observer, 0, size)
    plausible = PLAUSIBLE * max(base, readings)
    grams = {}
    for attempt in range(3 * size):
        if len(members) >= size:
            break
        structures = [_other(found, draw) for found in sums]
        if all(s is None for s in structures):
            if draws:
                members.append(draws.pop())
            continue
        varied = []
        for i, (found, subset) in enumerate(zip(sums, structures, strict=True)):
            if subset is None:
                varied.append(found)
                continue
            terms = problem.usable(subset)
            if (i, subset) not in grams:
                regression = problem.regression(found.chain, terms)
                grams[i, subset] = regression.gram(found.chain.sensors, found.chain.motion, fitting.workers)
            limits = problem.limits(found.chain, terms)
            solved = bounded_solution(grams[i, subset], range(len(terms)), limits)
            if solved is None:
                varied.append(found)
            else:
                weights = dict(zip(terms, solved[0].tolist(), strict=True))
                varied.append(replace(found, weights=weights))
        model = fitting.model(varied, fitting.actuation(best))
        _, left, _, _, drawn = fitting.tune(model, varied, observer, 4, 1, number=attempt + 1)
        if np.isfinite(left) and left <= plausible and drawn:
            members.append(drawn[0])
    while len(members) < size and draws:
        members.append(draws.pop())
    # The others first: gains are tuned on the first few members, and should suit laws that differ, not their constants.
    return [best, *others, *members[1:]]


def _other(found: Sum, draw: _core.Stream) -> tuple[int, ...] | None:
    """A subset drawn by how likely it is; None for the best one."""
    chances = exp(-0.5 * np.array([0.0, *(above for _, above in found.others)]))
    pick = int(np.searchsorted(np.cumsum(chances) / chances.sum(), draw.uniform()))
    return None if pick == 0 else found.others[min(pick, len(found.others)) - 1][0]
