"""Saturations: quotients over 1 + (x / K)^n, for a few K that the runs have been at, and over x or x² alone.

Where readings are noisy an implicit regression loses its way, for what stands on its right is noisy, too. Denominators
of one state and one constant are few enough to be tried as terms like others: whichever is nearest shows which state
and which power saturates, and its constant is refined from there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.elementary import power
from twinloop.identification.search.implicit import (
    NOISE_ROUNDS,
    Quotient,
    explained,
    matters,
    price_below,
    whitened,
)
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum, prices
from twinloop.identification.search.walks import Walks
from twinloop.identification.terms.denominators import Denominator, alone, plain, power_of
from twinloop.identification.terms.libraries import coordinates, distances
from twinloop.signals import Signals

EXPONENTS = (1, 2, 4)
PLACES = (0.25, 0.5, 0.75)
"""Where K lies among the magnitudes that a state had, as shares of the readings that are below."""
MOST = 240
"""Terms that are tried; where there would be more, K lies in the middle only, or nothing is tried."""
TRIED = 2
"""Denominators of each chain that are refined."""


def saturations(
    problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks
) -> list[list[Quotient]]:
    """Quotients over 1 and one power of one state that may drive each chain, the shortest description first.

    Args as those of `implicit`.
    """
    most = MOST // (1 + len(coordinates(problem.pool, signals)))
    return _over_one_of(_saturating(problem, signals, most), problem, signals, known, walks)


def inverses(problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks) -> list[list[Quotient]]:
    """The same over one state alone, or its square: the length of a pendulum, the mass of a rocket, a speed.

    Args as those of `implicit`.
    """
    return _over_one_of(_alone(problem, signals), problem, signals, known, walks)


def _over_one_of(
    divisors: Sequence[Denominator], problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks
) -> list[list[Quotient]]:
    """Quotients over one of a few denominators of one term each."""
    found: list[list[Quotient]] = [[] for _ in known]
    posed = [i for i, sum_ in enumerate(known) if not explained(problem, sum_)]
    inputs = [problem.pool.one, *coordinates(problem.pool, signals)]
    if not posed or not divisors:
        return found
    upper = problem.usable(plain(problem.pool, signals))
    above = problem.values(problem.usable(inputs))
    columns = [problem.values(upper)]
    for each in divisors:
        ((node, weight),) = each.parts
        columns.append(above / (each.one + weight * problem.values([node])))
    features = np.concatenate(columns, axis=2)
    sums, costs = [known[i] for i in posed], []
    for sum_ in sums:
        terms = [*upper, *(term for _ in divisors for term in inputs)]
        cost = prices(problem.pool, terms, problem.readings(sum_.chain), len(problem.runs))
        readings, runs = problem.readings(sum_.chain), len(problem.runs)
        below = [price_below(problem.pool, each, readings, runs) for each in divisors]
        cost[len(upper) :] += 0.5 * np.repeat(below, len(inputs))
        costs.append(cost)
    grams, _ = whitened(problem, sums, [features] * len(sums), costs, walks)
    short = walks.with_moves(walks.moves // 2).part(NOISE_ROUNDS)
    for i, walked in zip(posed, short.among(grams, costs, problem.workers), strict=True):
        seen: dict[int, Quotient] = {}
        for subset, _ in walked:
            places = [j - len(upper) for j in subset if j >= len(upper)]
            if not places or len(seen) >= TRIED:
                break
            for divisor in dict.fromkeys(place // len(inputs) for place in places):
                own = tuple(
                    inputs[place % len(inputs)] for place in places if place // len(inputs) == divisor
                )
                beside = tuple(upper[j] for j in subset if j < len(upper))
                (node,) = divisors[divisor].nodes
                seen.setdefault(node, Quotient(beside, own, divisors[divisor]))
        found[i] = list(seen.values())[:TRIED]
    return found


def _alone(problem: Problem, signals: Signals) -> list[Denominator]:
    """States alone, and their squares, that are neither angles nor rates and stay away from 0; where they are few."""
    every = [
        each
        for i in distances(signals)
        for each in alone(problem.pool, i, signals.states[i].scale)
        if matters(problem, each)
    ]
    return every if len(every) * (1 + len(coordinates(problem.pool, signals))) <= MOST else []


def _saturating(problem: Problem, signals: Signals, most: int) -> list[Denominator]:
    """1 + (x / K)^n of states that are neither angles nor rates and do not change their sign."""
    places: tuple[float, ...] = PLACES
    states = distances(signals)
    if len(states) * len(EXPONENTS) * len(places) > most:
        places = (0.5,)
    if len(states) * len(EXPONENTS) * len(places) > most:
        return []
    found: list[Denominator] = []
    for i in states:
        magnitudes = np.sort(np.abs(problem.stages.start[:, i]))
        for share in places:
            size = float(magnitudes[int(share * (len(magnitudes) - 1))])
            for exponent in EXPONENTS:
                node = power_of(problem.pool, i, exponent)
                # Of an odd power of what changes its sign the denominator would have a zero.
                signed = exponent % 2 == 1 and problem.stages.start[:, i].min() < 0.0
                if size > 0.0 and not signed and problem.usable([node]):
                    found.append(Denominator(((node, float(power(1.0 / size, exponent))),)))
    return found
