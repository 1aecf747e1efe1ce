"""Expressions multiplied out: sums of monomials, like terms collected, what cancels gone."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from twinloop._ground.elementary import cos, sin, tanh
from twinloop.law.expressions import (
    CONSTANT,
    INPUT,
    POWER,
    SHARE,
    SMALLEST_DIVISOR,
    Expressions,
    Node,
)

Monomial = tuple[tuple[int, int], ...]
"""(node of a factor, exponent) by the numbers of the nodes; a factor is an input, a function, a quotient 1 / b, or a
sum that was not multiplied out."""
Polynomial = Mapping[Monomial, float]
"""Coefficient of each monomial; none is 0."""

ROUNDING = 1e-14
"""Share of two coefficients of which their sum is taken for rounding: 0."""
MOST_TERMS = 40
"""Terms above which a product stays a product: nobody reads more."""
MOST_OVER = 3
"""Terms above which a sum is divided as a whole: written term by term, each of them would repeat the divisor."""
HIGHEST = 24
"""Degree above which a product stays a product."""

_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "sqrt": lambda value: math.sqrt(abs(value)),
    "sin": lambda value: float(sin(value)),
    "cos": lambda value: float(cos(value)),
    "tanh": lambda value: float(tanh(value)),
}


class Expansion:
    """Expressions of one store, multiplied out into another one, where equal terms of all of them meet.

    Args:
        source: what is multiplied out.
        target: where the factors live; several expansions may share it.
    """

    def __init__(self, source: Expressions, target: Expressions) -> None:
        self.source, self.target = source, target
        self._known: dict[int, Polynomial] = {}

    def __getitem__(self, root: int) -> Polynomial:
        """An expression as a sum of monomials.

        Args:
            root: a node of the source.

        Returns:
            Coefficients by monomial, in the order in which they are written; the same value wherever it is finite, but
            for rounding.
        """
        for number in self.source.needed([root]):
            if number not in self._known:
                self._known[number] = self._of(number)
        return dict(sorted(self._known[root].items(), key=_place))

    def _of(self, number: int) -> Polynomial:
        operation, operands, value = self.source[number]
        if operation == INPUT:
            return {((self.target.input(int(value)), 1),): 1.0}
        if operation == CONSTANT:
            return {(): value} if value else {}
        parts = [self._known[operand] for operand in operands]
        if operation == SHARE:
            operation, parts = "*", [*parts, {(): value}]
        if operation in ("+", "-"):
            sum_, sign = dict(parts[0]), 1.0 if operation == "+" else -1.0
            for monomial, weight in parts[1].items():
                _enter(sum_, monomial, sign * weight)
            found: Polynomial = sum_
        elif operation == "*":
            found = self._product(parts[0], parts[1])
        elif operation == POWER:
            found = {(): 1.0}
            for _ in range(int(value)):
                found = self._product(found, parts[0])
        elif operation == "/":
            found = self._quotient(parts[0], parts[1])
        else:
            found = self._function(operation, parts)
        if all(math.isfinite(coefficient) for coefficient in found.values()):
            return found
        nodes = tuple(written(self.target, part) for part in parts)
        return _alone(self.target.enter(Node(operation, nodes, value)))

    def _product(self, a: Polynomial, b: Polynomial) -> Polynomial:
        long = len(a) * len(b) > MOST_TERMS and min(len(a), len(b)) > 1
        divided = (len(a) > MOST_OVER and self._divides(b)) or (len(b) > MOST_OVER and self._divides(a))
        if long or divided or _degree(a) + _degree(b) > HIGHEST:
            a, b = self._factor(a), self._factor(b)
        found: dict[Monomial, float] = {}
        for first, weight in a.items():
            for second, other in b.items():
                _enter(found, _times(first, second), weight * other)
        return found

    def _divides(self, polynomial: Polynomial) -> bool:
        """Whether there is a quotient among its factors."""
        return any(_is_quotient(self.target, factor) for monomial in polynomial for factor, _ in monomial)

    def _factor(self, polynomial: Polynomial) -> Polynomial:
        """The same as one monomial."""
        # What is squared again and again would have as many factors as its power has.
        if len(polynomial) < 2 and _degree(polynomial) <= HIGHEST:
            return polynomial
        return _alone(written(self.target, polynomial))

    def _quotient(self, dividend: Polynomial, divisor: Polynomial) -> Polynomial:
        if not divisor or list(divisor) == [()]:
            by = divisor.get((), 0.0)
            return {m: w / by for m, w in dividend.items()} if abs(by) > SMALLEST_DIVISOR else dividend
        # Protected, a / b is a times 1 / b: both leave a where b is small.
        nodes = (self.target.constant(1.0), written(self.target, divisor))
        return self._product(dividend, _alone(self.target.enter(Node("/", nodes))))

    def _function(self, operation: str, parts: list[Polynomial]) -> Polynomial:
        if operation in _FUNCTIONS and (not parts[0] or list(parts[0]) == [()]):
            value = _FUNCTIONS[operation](parts[0].get((), 0.0))
            return {(): value} if value else {}
        nodes = tuple(written(self.target, part) for part in parts)
        return _alone(self.target.enter(Node(operation, nodes)))


def written(target: Expressions, polynomial: Polynomial) -> int:
    """The node of a polynomial as it is written, term after term from left to right."""
    terms = sorted(polynomial.items(), key=_place)
    if not terms:
        return target.constant(0.0)
    total: int | None = None
    for monomial, coefficient in terms:
        if total is None:
            total = term_node(target, monomial, coefficient)
        else:
            sign = "-" if coefficient < 0.0 else "+"
            total = target.enter(Node(sign, (total, term_node(target, monomial, abs(coefficient)))))
    assert total is not None
    return total


def term_node(target: Expressions, monomial: Monomial, coefficient: float) -> int:
    """The node of a coefficient times a monomial: the number first, quotients last."""
    one = target.constant(1.0)
    below = [(factor, exponent) for factor, exponent in monomial if _is_quotient(target, factor)]
    above = [term for term in monomial if term not in below]
    node = None if abs(coefficient) == 1.0 and above else target.constant(coefficient)
    for factor, exponent in above:
        power = target.power(factor, exponent)
        node = power if node is None else target.enter(Node("*", (node, power)))
    for factor, exponent in below:
        # One after another: a division by a square would be protected where another divisor is small.
        for _ in range(exponent):
            node = target.enter(Node("/", (one if node is None else node, target[factor].operands[1])))
    assert node is not None
    if coefficient == -1.0 and above:
        return target.enter(Node("-", (target.constant(0.0), node)))
    return node


def _is_quotient(target: Expressions, number: int) -> bool:
    operation, operands, _ = target[number]
    return operation == "/" and target.constant_value(operands[0]) == 1.0


def _place(term: tuple[Monomial, float]) -> list[tuple[float, float]]:
    """Where a term is written: by its factors, high powers and long products first."""
    return [*((factor, -exponent) for factor, exponent in term[0]), (math.inf, 0.0)]


def _alone(factor: int) -> Polynomial:
    return {((factor, 1),): 1.0}


def _degree(polynomial: Polynomial) -> int:
    return max((sum(exponent for _, exponent in monomial) for monomial in polynomial), default=0)


def _times(first: Monomial, second: Monomial) -> Monomial:
    exponents = dict(first)
    for factor, exponent in second:
        exponents[factor] = exponents.get(factor, 0) + exponent
    return tuple(sorted(exponents.items()))


def _enter(found: dict[Monomial, float], monomial: Monomial, weight: float) -> None:
    """Adds to a coefficient; what is left of two that cancel is rounding."""
    before = found.get(monomial, 0.0)
    after = before + weight
    if math.isfinite(after) and abs(after) <= ROUNDING * (abs(before) + abs(weight)):
        found.pop(monomial, None)
    else:
        found[monomial] = after
