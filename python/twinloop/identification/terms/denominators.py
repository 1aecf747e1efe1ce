"""Denominators: what terms may be divided by, 1 + Σ d φ or a state alone, and the nodes of such quotients."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from typing import NamedTuple

from twinloop.identification.terms.libraries import (
    angles,
    coordinates,
    periodic,
    quadratic,
    trigonometric,
    turn,
)
from twinloop.identification.terms.pool import Pool
from twinloop.law.expressions import CONSTANT, INPUT, SHARE
from twinloop.signals import Signals, rates

HIGHEST = 4
"""Power of a state below the line at most: of Hill's law for four places that bind together."""

FIRST_RUNG = 0
"""On which rung of the ladder quotients stand: their denominator is priced, constant by constant."""


class Denominator(NamedTuple):
    """What terms are divided by.

    Args:
        parts: nodes with their coefficients.
        one: 1, to which they are added; 0 of a state alone, or its square, in units of the scale.
    """

    parts: tuple[tuple[int, float], ...]
    one: float = 1.0

    @property
    def nodes(self) -> list[int]:
        """Its terms."""
        return [node for node, _ in self.parts]


def below(pool: Pool, signals: Signals) -> list[int]:
    """Terms of denominators: powers and products of states that are no rates, cosines of angles and their squares.

    How a rigid body turns does not depend on its attitude: of its angles there are none.
    """
    moving = angles(signals) | rates(signals)
    rest = [i for i in range(signals.n_x) if i not in moving]
    found = [power_of(pool, i, power) for i in rest for power in range(1, HIGHEST + 1)]
    found += [pool.product(i, j) for i, j in combinations(rest, 2)]
    for i in sorted(angles(signals)) if signals.kinematics is None else ():
        wave = pool.wave("cos", i, turn(signals.states[i]))
        found += [wave, pool.product(wave, wave)]
    return list(dict.fromkeys(found))


def alone(pool: Pool, state: int, scale: float) -> list[Denominator]:
    """A state alone, and its square, in units of its scale: what is too small to divide by depends on no unit."""
    share = pool.share(state, scale)
    return [Denominator(((node, 1.0),), 0.0) for node in (share, pool.product(share, share))]


def power_of(pool: Pool, node: int, power: int) -> int:
    """The node of a whole power of a node."""
    return pool.product(*[node] * power)


def power_in(pool: Pool, node: int) -> tuple[int, int] | None:
    """The state and the exponent of a node that is a power of a state; None of all others."""
    leaves = pool.leaves(node)
    state = leaves[0]
    if state is None or node != power_of(pool, state, len(leaves)):
        return None
    return state, len(leaves)


def states_in(pool: Pool, denominator: Denominator) -> set[int | None]:
    """The states that a denominator is made of."""
    return {leaf for node in denominator.nodes for leaf in pool.leaves(node)}


def plain(pool: Pool, signals: Signals) -> list[int]:
    """Terms that stand beside quotients: none of those that resemble one where the runs were, as roots do."""
    terms = [pool.one, *coordinates(pool, signals), *quadratic(pool, signals)]
    if not periodic(signals):
        terms += trigonometric(pool, signals)
    return list(dict.fromkeys(terms))


def above(pool: Pool, signals: Signals, lower: Iterable[int]) -> list[int]:
    """Terms above a line: what is plain, and each term below it alone and times each input."""
    inputs = coordinates(pool, signals)
    products = (pool.product(i, term) for term in lower for i in inputs)
    return list(dict.fromkeys([*plain(pool, signals), *lower, *products]))


def above_it(pool: Pool, signals: Signals, denominator: Denominator) -> list[int]:
    """Terms above the line of a denominator; above a state alone nothing that it would cancel."""
    if denominator.one:
        return above(pool, signals, denominator.nodes)
    below_it = states_in(pool, denominator)
    return [term for term in plain(pool, signals) if below_it.isdisjoint(pool.leaves(term))]


def over(pool: Pool, term: int, denominator: Denominator) -> int:
    """The node of a term over a denominator.

    1 + Σ d φ is written as 1 − Σ (−d) φ: so tuning leaves the 1 as it is, and every other constant has a value of
    its own.
    """
    if not denominator.one:
        return pool.add("/", term, *denominator.nodes)
    total: int | None = None
    for node, weight in denominator.parts:
        part = pool.add("*", node, pool.constant(-weight))
        total = part if total is None else pool.add("+", total, part)
    assert total is not None
    return pool.add("/", term, pool.add("-", pool.one, total))


def quotient(pool: Pool, number: int) -> tuple[int, Denominator] | None:
    """What is above the line and what is below it, of a node that `over` has made; None for all others."""
    operation, operands, _ = pool[number]
    if operation != "/" or _is_weighted(pool, operands[0]):
        # What joints that share masses are solved to has such a form, too, and is priced as a whole.
        return None
    lower = pool[operands[1]]
    if _is_alone(pool, operands[1]):
        # The ladder divides by states as well, and prices what it divides.
        below_it = Denominator(((operands[1], 1.0),), 0.0)
        return (operands[0], below_it) if pool.rungs.get(number) == FIRST_RUNG else None
    if lower.operation != "-" or lower.operands[0] != pool.one:
        return None
    parts, waiting = [], [lower.operands[1]]
    while waiting:
        node = pool[waiting.pop()]
        if node.operation == "+":
            waiting += reversed(node.operands)
            continue
        constants = [i for i in node.operands if pool[i].operation == CONSTANT]
        if node.operation != "*" or len(constants) != 1:
            return None
        (term,) = (i for i in node.operands if i != constants[0])
        parts.append((term, -pool[constants[0]].value))
    return operands[0], Denominator(tuple(sorted(parts)))


def _is_alone(pool: Pool, number: int) -> bool:
    """Whether a node is a state's share of its scale, or the square of that."""
    operation, operands, _ = pool[number]
    if operation == "*" and operands[0] == operands[1]:
        operation, operands, _ = pool[operands[0]]
    return operation == SHARE and pool[operands[0]].operation == INPUT


def _is_weighted(pool: Pool, number: int) -> bool:
    """Whether a node is a sum, or a term with a weight: above the line there are terms alone."""
    operation, operands, _ = pool[number]
    weighted = any(i != pool.one and pool[i].operation == CONSTANT for i in operands)
    return operation in ("+", "-") or (operation == "*" and weighted)


def denominators(pool: Pool, terms: Iterable[int]) -> list[Denominator]:
    """Of quotients among some terms, without repetition, in a fixed order."""
    return sorted({parts[1] for term in terms if (parts := quotient(pool, term)) is not None})
