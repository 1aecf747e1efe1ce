"""Implicit regression: what may be above and below the line of a law y = N / D, D = 1 + Σ d φ.

Multiplied out the law is linear in its constants: y = N − Σ d (y φ). On the right stands for y what the readings show
of it (`slopes.py`), with the sum of terms that is believed so far where that helps, as it does where commands jump. So
one search over subsets chooses what is above the line and what below. What is left of it is D times what is left of y:
so D is taken to be 1 where the runs were on average, y = N − Σ d y (φ − φ̄), or the shortest answer of all would be a D
that vanishes there, whatever y is.

Mangan, Brunton, Proctor and Kutz 2016 for laws that are implicit; here the left side stays an integral of readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.slopes import slopes
from twinloop.identification.search.noise import calm
from twinloop.identification.search.poles import vanishes_nowhere
from twinloop.identification.search.problem import Columns, Problem
from twinloop.identification.search.structure import Sum, prices
from twinloop.identification.search.walks import Walks
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import floor_of
from twinloop.identification.terms.denominators import Denominator, above, below, power_of, quotient
from twinloop.identification.terms.pool import Pool
from twinloop.signals import Signals

TRIED = 3
"""Denominators of each chain that are refined, of all those that searches have come across."""
NOISE_ROUNDS = 2
"""Times that the noise is estimated behind what a search has found."""
POWERS = ((1, 2), (2,), (4,))
"""Powers of states to which denominators are also restricted: all together they stand in for each other."""
NEAREST = 1e-3
"""Share of its largest value that a denominator has at least wherever the runs were."""
SINGULAR = 0.05
"""What a denominator's least value is above: nearer to a pole it stands in for what no quotient is, such as a stop."""
VARIES = 1.5
"""Times that a denominator's largest value is its least at least: by less it is a series, and a plain term as good."""
LARGE = 100.0
"""What a denominator's least value is below: beside more its 1 is nothing, and a state alone is below the line."""
FEW_TERMS = 2
"""Terms up to which a sum that leaves nothing but noise is believed: a quotient and its denominator are no fewer."""
NOISE = 100.0
"""Times that the least disturbance which is believed may be there where nothing is left but noise."""


@dataclass(frozen=True)
class Quotient:
    """Plain terms, terms over a denominator, and that."""

    plain: tuple[int, ...]
    above: tuple[int, ...]
    denominator: Denominator


def implicit(problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks) -> list[list[Quotient]]:
    """Quotients that may drive each chain, the shortest description first; none where none is shorter than without.

    Args:
        problem: of all chains.
        signals: of the system.
        known: the best sum of each chain so far.
        walks: over subsets of terms.
    """
    pool = problem.pool
    lower = problem.usable(below(pool, signals))
    found: list[list[Quotient]] = [[] for _ in known]
    posed = [i for i, sum_ in enumerate(known) if not explained(problem, sum_)]
    if not lower or not posed:
        return found
    own = [term for sum_ in known for term in sum_.weights if quotient(pool, term) is not None]
    upper = problem.usable(list(dict.fromkeys([*above(pool, signals, lower), *own])))
    sums = [known[i] for i in posed]
    costs = [prices(pool, [*upper, *lower], problem.readings(sum_.chain), len(problem.runs)) for sum_ in sums]
    over_line, under = problem.values(upper), problem.values(lower)
    middle: Floats = under.reshape(-1, len(lower)).mean(axis=0)
    columns = [
        np.concatenate([over_line, -driving(problem, sum_)[:, :, np.newaxis] * (under - middle)], axis=2)
        for sum_ in sums
    ]
    grams, _ = whitened(problem, sums, columns, costs, walks)
    short = walks.with_moves(walks.moves // 2)
    every: list[list[tuple[list[int], float]]] = [[] for _ in sums]
    for number, mask in enumerate(_masks(pool, signals, lower), NOISE_ROUNDS):
        masked = [
            np.concatenate([cost[: len(upper)], np.where(mask, cost[len(upper) :], np.inf)]) for cost in costs
        ]
        for walked, more in zip(every, short.part(number).among(grams, masked, problem.workers), strict=True):
            walked += more
    for i, gram, walked in zip(posed, grams, every, strict=True):
        subsets = sorted(walked, key=lambda answer: answer[1])
        found[i] = _quotients(problem, gram, [subset for subset, _ in subsets], upper, lower, middle)
    return found


def bounded(problem: Problem, found: Sum) -> bool:
    """Whether coefficients of a chain's terms have bounds, which a term over a denominator would evade."""
    return found.chain.states[0] in problem.priors.bounds


def explained(problem: Problem, found: Sum) -> bool:
    """Whether few terms leave nothing but the noise of sensors, or a chain is to have no quotients."""
    chain = found.chain
    if len(found.weights) < 2 or bounded(problem, found):
        return True
    _, slow = floor_of(chain, problem.dt, problem.integration(chain))
    still = chain.motion.white <= NOISE * slow[0] and chain.motion.correlated <= NOISE * slow[1]
    return len(found.weights) <= FEW_TERMS and (still or calm(problem, chain) is chain)


def driving(problem: Problem, found: Sum) -> Floats:
    """What drives a chain within each period (3, rows): a sum with the slope of what that leaves, or the slope alone.

    Of the two that one is believed of which the readings miss each other less.
    """
    chain = found.chain
    period = problem.dt if chain.integrated else 1.0
    ways = []
    for terms in (problem.usable(list(found.weights)), []):
        weights = np.array([found.weights[term] for term in terms])
        value: Floats = (problem.values(terms) * weights).sum(axis=2)
        missed = 0.0
        residuals = problem.regression(chain, problem.values(terms)).residuals(weights)
        for rows, residual in zip(problem.stages.runs, residuals, strict=True):
            shown = slopes(np.ascontiguousarray(residual[:, 0]))
            if shown is None:
                missed += float(np.square(residual[:, 0]).sum())
                continue
            missed += shown.missed * len(residual)
            # What a period adds is one number for it, and what a step of Euler goes on by.
            finely = chain.form == "acceleration"
            edges = (shown.at[:-1], shown.at[1:]) if finely else (shown.between, shown.between)
            for stage, slope in zip(value, (edges[0], shown.between, edges[1]), strict=True):
                stage[rows] += slope / period
        ways.append((missed, value))
    return ways[0][1] if ways[0][0] <= ways[1][0] else ways[1][1]


def matters(problem: Problem, denominator: Denominator) -> bool:
    """Whether a denominator stays away from 0 wherever the runs were, and makes a difference there.

    Elsewhere in the envelope it must not vanish.
    """
    values = problem.values(problem.usable(denominator.nodes))
    total = denominator.one + (values * np.array([weight for _, weight in denominator.parts])).sum(axis=2)
    least, most = float(total.min()), float(total.max())
    if denominator.one:
        away = least > max(NEAREST * most, SINGULAR) and least < LARGE
    else:
        away = least > SINGULAR * most
    return away and most > VARIES * least and vanishes_nowhere(problem.pool, denominator, problem.room)


def price_below(pool: Pool, denominator: Denominator, readings: int, runs: int) -> float:
    """What a denominator costs, in units of χ²: its terms with their constants; a state alone has none."""
    return float(prices(pool, denominator.nodes, readings if denominator.one else 1, runs).sum())


def _masks(pool: Pool, signals: Signals, lower: Sequence[int]) -> list[Floats]:
    """Which terms a denominator may have: all of them, or those of one power."""
    masks: list[Floats] = [np.ones(len(lower), dtype=bool)]
    for allowed in POWERS:
        powers = {power_of(pool, i, power) for i in range(signals.n_x) for power in allowed}
        mask = np.array([term in powers for term in lower])
        if mask.any():
            masks.append(mask)
    return masks


def whitened(
    problem: Problem,
    sums: Sequence[Sum],
    columns: Sequence[Columns],
    costs: Sequence[Floats],
    walks: Walks,
) -> tuple[list[_core.Gram], list[Chain]]:
    """Inner products of each chain's columns, and the chains with the noise that a search among them has left.

    Args:
        problem: of the chains.
        sums: the best so far, with their chains.
        columns: features of each chain (3, rows, p).
        costs: of each chain's features (p,).
        walks: over subsets of features.
    """
    short = walks.with_moves(walks.moves // 2)
    regressions = [problem.regression(sum_.chain, own) for sum_, own in zip(sums, columns, strict=True)]
    chains: list[Chain] = [sum_.chain for sum_ in sums]
    for round_ in range(NOISE_ROUNDS + 1):
        grams = [
            regression.gram(chain.sensors, chain.motion, problem.workers)
            for regression, chain in zip(regressions, chains, strict=True)
        ]
        if round_ == NOISE_ROUNDS:
            break
        found = short.part(round_).among(grams, costs, problem.workers)
        posed = []
        for regression, gram, walked, chain in zip(regressions, grams, found, chains, strict=True):
            coefficients = np.zeros(gram.features)
            solved = gram.least_squares(walked[0][0]) if walked and walked[0][0] else None
            if solved is not None:
                coefficients[walked[0][0]] = solved[0]
            floor = floor_of(chain, problem.dt, problem.integration(chain))
            posed.append((regression, coefficients, chain.sensors, chain.motion, *floor))
        noises = _core.most_likely_noises(posed, problem.workers)
        chains = [
            chain.with_noise(sensors, motion)
            for chain, (sensors, motion, _) in zip(chains, noises, strict=True)
        ]
    return grams, chains


def _quotients(
    problem: Problem,
    gram: _core.Gram,
    subsets: Sequence[Sequence[int]],
    upper: Sequence[int],
    lower: Sequence[int],
    middle: Floats,
) -> list[Quotient]:
    """Quotients of subsets, the best first, a denominator of some terms once; none that is longer than without.

    Args:
        problem: of all chains.
        gram: of one, of the terms above the line and those below it less their means.
        subsets: the best first.
        upper: terms above the line.
        lower: terms below it.
        middle: means of those (lower,).
    """
    found: dict[tuple[int, ...], Quotient] = {}
    for subset in subsets:
        support = tuple(j for j in subset if j >= len(upper))
        if not support or len(found) == TRIED:
            break
        solved = gram.least_squares(list(subset)) if support not in found else None
        if solved is None:
            continue
        weights = dict(zip(subset, solved[0].tolist(), strict=True))
        # It is 1 in the middle, and is written as what is 1 where its terms vanish.
        at_zero = 1.0 - sum(weights[j] * float(middle[j - len(upper)]) for j in support)
        if at_zero == 0.0:
            continue
        denominator = Denominator(tuple((lower[j - len(upper)], weights[j] / at_zero) for j in support))
        if matters(problem, denominator):
            found[support] = Quotient((), tuple(upper[j] for j in subset if j < len(upper)), denominator)
    return list(found.values())
