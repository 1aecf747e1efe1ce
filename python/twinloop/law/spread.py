"""How far the members of a committee differ in the constants of a law, term by term."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.expansion import Monomial, Polynomial
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
    own, *others = (
        [_Term(expressions, monomial, coefficient) for monomial, coefficient in one.items()]
        for one in (law, *members)
    )
    result = {}
    for shape in dict.fromkeys(term.shape for term in own):
        terms, *found = ([term for term in one if term.shape == shape] for one in (own, *others))
        # Terms that differ by constants alone are told apart by their order, where there are as many.
        alike = [member for member in found if len(member) == len(terms)]
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


class _Term:
    """A term with its coefficient and the constants inside its factors, how to get to these, and what else it is."""

    def __init__(self, expressions: Expressions, monomial: Monomial, coefficient: float) -> None:
        self.monomial = monomial
        self.values = [coefficient]
        self.paths: list[tuple[Visit, ...]] = []
        self._expressions, self._visits = expressions, 0
        self.shape: Shape = tuple((self._shaped(factor, ()), power) for factor, power in monomial)

    def _shaped(self, number: int, path: tuple[Visit, ...]) -> object:
        """A node without its constants, which are entered in their order."""
        operation, operands, value = self._expressions[number]
        if operation == CONSTANT:
            self.values.append(value)
            self.paths.append(path)
            return CONSTANT
        self._visits += 1
        here = (*path, Visit(number, self._visits))
        return operation, value, tuple(self._shaped(operand, here) for operand in operands)
