"""Constants below the line, refined by steps of Gauss and Newton: each step is a regression on readings.

With r = N / D the law is r's slope by d linear: what a small change δ of D's constants makes of it is −Σ δ (r φ / D).
Constants above the line and those of plain terms are solved for anew at each D (variable projection, Golub and Pereyra
1973).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.search.implicit import NEAREST, Quotient, matters
from twinloop.identification.search.problem import Columns, Problem
from twinloop.identification.search.structure import prices
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.denominators import Denominator

STEPS = 12
"""At most."""
HALVINGS = 5
"""Of a step at most, until less is residual than before."""
STILL = 1e-6
"""Share of χ² that a step must gain for there to be another."""
RIDGE = 1e-12
"""Added to the columns' unit lengths."""


class _Point(NamedTuple):
    """What is residual at some constants, the columns that are linear there, and the slopes by each constant below."""

    residual: float
    columns: Columns
    slopes: Columns


def refined(problem: Problem, chain: Chain, quotient: Quotient) -> Denominator:
    """The denominator of a law of given terms, without those of its own that do not pay.

    Args:
        problem: of the chain.
        chain: with its noise.
        quotient: with constants to begin with.
    """
    if not quotient.denominator.one:
        return quotient.denominator  # it has no constants
    nodes = quotient.denominator.nodes
    costs = prices(problem.pool, nodes, problem.readings(chain), len(problem.runs)).tolist()
    price = dict(zip(nodes, costs, strict=True))
    denominator, residual = _descended(problem, chain, quotient)
    while len(denominator.parts) > 1:
        fewer = [
            Denominator(tuple(part for part in denominator.parts if part is not out))
            for out in denominator.parts
        ]
        tried = [
            (more - price[out[0]], number, (other, more))
            for number, (out, parts) in enumerate(zip(denominator.parts, fewer, strict=True))
            if matters(problem, parts)
            for other, more in [_descended(problem, chain, replace(quotient, denominator=parts))]
        ]
        if not tried or not min(tried)[0] < residual:
            break
        denominator, residual = min(tried)[2]
    return denominator


def _descended(problem: Problem, chain: Chain, quotient: Quotient) -> tuple[Denominator, float]:
    """The denominator's constants where the least is residual, and that, in units of χ²."""
    nodes = quotient.denominator.nodes
    problem.usable([*quotient.plain, *quotient.above, *nodes])
    under, above = problem.values(nodes), problem.values(quotient.above)
    plain = problem.values(quotient.plain)
    here = np.array([weight for _, weight in quotient.denominator.parts])
    now = _at(problem, chain, plain, above, under, here)
    for _ in range(STEPS):
        step = None if now is None else _step(problem, chain, now)
        if now is None or step is None:
            break
        for halving in range(HALVINGS):
            there = here + step / float(1 << halving)
            then = _at(problem, chain, plain, above, under, there)
            if then is not None and then.residual < now.residual:
                break
        else:
            break
        gained = now.residual - then.residual
        here, now = there, then
        if gained < STILL * now.residual:
            break
    residual = np.inf if now is None else now.residual
    return Denominator(tuple(zip(nodes, here.tolist(), strict=True))), residual


def _at(
    problem: Problem, chain: Chain, plain: Columns, above: Columns, under: Columns, here: Floats
) -> _Point | None:
    """The law at some constants below the line; None where that comes near 0."""
    values = 1.0 + (under * here).sum(axis=2)
    if not values.min() > NEAREST * np.abs(values).max():
        return None
    columns = np.concatenate([plain, above / values[:, :, np.newaxis]], axis=2)
    gram = problem.gram(chain, columns)
    solved = gram.least_squares(list(range(gram.features)), RIDGE)
    if solved is None:
        return None
    ratio = (columns[:, :, plain.shape[2] :] * solved[0][plain.shape[2] :]).sum(axis=2)
    slopes = -(ratio / values)[:, :, np.newaxis] * under
    return _Point(solved[1], columns, slopes)


def _step(problem: Problem, chain: Chain, point: _Point) -> Floats | None:
    """By how much the constants below the line are to change."""
    columns = np.concatenate([point.columns, point.slopes], axis=2)
    gram = problem.gram(chain, columns)
    solved = gram.least_squares(list(range(gram.features)), RIDGE)
    if solved is None:
        return None
    step: Floats = solved[0][point.columns.shape[2] :]
    return step
