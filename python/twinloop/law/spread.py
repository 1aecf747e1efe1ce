"""How far the members of a committee differ in the constants of a law, term by term."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop.law.expansion import Monomial, Polynomial, ordered
from twinloop.law.expressions import CONSTANT, Expressions

Shape = tuple[object, ...]
"""A term without its constants."""


@dataclass(frozen=True)
class Spread:
    """Of one term.

    Args:
        sds: standard deviation of its coefficient, then of the constants inside its factors, over the members that have
            the term; None where only one has it.
        having: how many members have the term.
        members: how many there are.
    """

    sds: tuple[float, ...] | None
    having: int
    members: int


def spreads(
    expressions: Expressions, law: Polynomial, members: Sequence[Polynomial]
) -> dict[Monomial, Spread]:
    """Spread of each term of a law over the members of a committee.

    Args:
        expressions: where the factors of all of them live.
        law: a sum of terms.
        members: the same equation in each member.

    Returns:
        A spread for each monomial.
    """
    found = [_by_shape(expressions, member) for member in members]
    result = {}
    for shape, terms in _by_shape(expressions, law).items():
        # Terms that differ by constants alone are told apart by their order, where there are as many.
        alike = [member[shape] for member in found if len(member.get(shape, ())) == len(terms)]
        for place, (monomial, _) in enumerate(terms):
            values = np.array([member[place][1] for member in alike])
            sds = tuple(values.std(axis=0, ddof=1).tolist()) if len(alike) > 1 else None
            result[monomial] = Spread(sds, len(alike), len(members))
    return result


def _by_shape(
    expressions: Expressions, polynomial: Polynomial
) -> dict[Shape, list[tuple[Monomial, list[float]]]]:
    """Terms with their constants, by what is left without these."""
    found: dict[Shape, list[tuple[Monomial, list[float]]]] = {}
    for monomial, coefficient in ordered(polynomial):
        constants = [coefficient]
        shape = tuple((_shape(expressions, factor, constants), power) for factor, power in monomial)
        found.setdefault(shape, []).append((monomial, constants))
    return found


def _shape(expressions: Expressions, number: int, constants: list[float]) -> object:
    """A node without its constants, which are entered in their order."""
    operation, operands, value = expressions[number]
    if operation == CONSTANT:
        constants.append(value)
        return CONSTANT
    return operation, value, tuple(_shape(expressions, operand, constants) for operand in operands)
