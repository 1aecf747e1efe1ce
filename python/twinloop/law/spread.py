"""How far the members of a committee differ in the constants of a law, term by term."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.expansion import Monomial, Polynomial, ordered
from twinloop.law.expressions import CONSTANT, Expressions

Shape = tuple[object, ...]
"""A term without its constants."""


class Visit(NamedTuple):
    """A node on the way to a constant; one that is used several times is visited as often."""

    node: int
    number: int


class Inside(NamedTuple):
    """A constant inside the factors of a term.

    Args:
        sd: its standard deviation over the members; None where only one has the term.
        path: the nodes that it stands in, the outermost first.
    """

    sd: float | None
    path: tuple[Visit, ...]


@dataclass(frozen=True)
class Spread:
    """Of one term.

    Args:
        sd: standard deviation of its coefficient over the members that have the term; None where only one has it.
        inside: the constants inside its factors.
        having: how many members have the term.
        members: how many there are.
    """

    sd: float | None
    inside: tuple[Inside, ...]
    having: int
    members: int

    def varying(self, named: Collection[int]) -> list[float]:
        """Standard deviations of the constants inside that differ, but for those of parts with a name."""
        return _varying(one for one in self.inside if not any(visit.node in named for visit in one.path))


def varying_in(spreads: Iterable[Spread], node: int, named: Collection[int]) -> list[float]:
    """Standard deviations of the constants of a part that differ, but for those of parts with a name inside it.

    Args:
        spreads: of the terms that the part may stand in.
        node: the part.
        named: parts that have a name.
    """
    for spread in spreads:
        placed = [
            (one, [visit.node for visit in one.path].index(node)) for one in spread.inside if _has(one, node)
        ]
        if placed:
            first, place = placed[0]
            of_visit = [one for one, at in placed if one.path[at] == first.path[place]]
            below = place + 1
            return _varying(
                one for one in of_visit if not any(visit.node in named for visit in one.path[below:])
            )
    return []


def _has(one: Inside, node: int) -> bool:
    return any(visit.node == node for visit in one.path)


def _varying(constants: Iterable[Inside]) -> list[float]:
    return [one.sd for one in constants if one.sd]


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
        for place, term in enumerate(terms):
            values = np.array([member[place].values for member in alike])
            sds = _deviations(values) if len(alike) > 1 else [None] * (1 + len(term.paths))
            inside = tuple(Inside(sd, path) for sd, path in zip(sds[1:], term.paths, strict=True))
            result[term.monomial] = Spread(sds[0], inside, len(alike), len(members))
    return result


def _deviations(values: Floats) -> list[float]:
    """Standard deviations of constants over members (members, constants); 0 of those that are equal, not rounding."""
    found: list[float] = np.where(np.ptp(values, axis=0) > 0.0, values.std(axis=0, ddof=1), 0.0).tolist()
    return found


@dataclass(frozen=True)
class _Term:
    """A term with its coefficient and the constants inside its factors, and how to get to these."""

    monomial: Monomial
    values: list[float]
    paths: list[tuple[Visit, ...]]


def _by_shape(expressions: Expressions, polynomial: Polynomial) -> dict[Shape, list[_Term]]:
    """Terms with their constants, by what is left without these."""
    found: dict[Shape, list[_Term]] = {}
    for monomial, coefficient in ordered(polynomial):
        walk = _Walk(expressions, coefficient)
        shape = tuple((walk.shape(factor, ()), power) for factor, power in monomial)
        found.setdefault(shape, []).append(_Term(monomial, walk.values, walk.paths))
    return found


class _Walk:
    """From node to node, entering constants in their order."""

    def __init__(self, expressions: Expressions, coefficient: float) -> None:
        self.expressions = expressions
        self.values = [coefficient]
        self.paths: list[tuple[Visit, ...]] = []
        self.visits = 0

    def shape(self, number: int, path: tuple[Visit, ...]) -> object:
        """A node without its constants."""
        operation, operands, value = self.expressions[number]
        if operation == CONSTANT:
            self.values.append(value)
            self.paths.append(path)
            return CONSTANT
        self.visits += 1
        here = (*path, Visit(number, self.visits))
        return operation, value, tuple(self.shape(operand, here) for operand in operands)
