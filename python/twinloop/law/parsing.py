"""From formulas as text to expressions: parsed, never run as code."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Mapping, Sequence

from twinloop import _core
from twinloop.errors import InvalidInput
from twinloop.law.expressions import UNARY, Expressions

OPERATORS: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
DEEPEST = 100
"""Levels of brackets, signs and functions inside each other at most."""
HIGHEST = 6
"""Power of an expression at most."""


def parsed(
    text: str,
    expressions: Expressions,
    names: Mapping[str, int],
    number: Callable[[float], int] | None = None,
) -> int:
    """A formula as an expression.

    Args:
        text: such as "rate * abs(rate)": numbers, + − * / **, abs, sqrt, sin, cos, tanh, exp, min, max.
        expressions: where it is entered.
        names: node of each name that it may use.
        number: enters a number that stands for itself; by default as a constant.

    Returns:
        The node.

    Raises:
        InvalidInput: text that is no such formula, or names what is not there.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        if _depth(tree) > DEEPEST:
            raise InvalidInput(
                f"Term {text[:60]!r}: expected a formula that is less deeply nested; write it flatter."
            )
        if not all(abs(value) <= sys.float_info.max for value in _numbers(tree)):
            raise InvalidInput(
                f"Term {text!r}: expected finite numbers, found a larger one; write it smaller."
            )
        return _Reader(text, expressions, names, number or expressions.constant).node(tree)
    except (SyntaxError, RecursionError, MemoryError) as reason:  # the last two where it is nested too deeply
        raise InvalidInput(f"Term {text[:60]!r}: expected a formula such as 'rate * abs(rate)'.") from reason


def program_of(formulas: Sequence[str], registers: Mapping[str, int], inputs: int) -> _core.Program:
    """A program that computes formulas, such as another package prints them.

    Args:
        formulas: one for each output; `^` is a power, too.
        registers: place among the inputs of each name.
        inputs: that the program has.

    Returns:
        The program; equal parts are computed once.

    Raises:
        InvalidInput: a formula that cannot be read, or that uses what a program cannot compute.
    """
    expressions = Expressions()
    names = {name: expressions.input(place) for name, place in registers.items()}
    roots = [parsed(formula.replace("^", "**"), expressions, names) for formula in formulas]
    return expressions.program(roots, inputs)


class _Reader:
    """One formula on its way to a node."""

    def __init__(
        self, text: str, expressions: Expressions, names: Mapping[str, int], number: Callable[[float], int]
    ) -> None:
        self._text, self._expressions, self._names, self._number = text, expressions, names, number

    def node(self, tree: ast.expr) -> int:
        add, constant = self._expressions.add, self._expressions.constant
        value = constant_of(tree)
        if value is not None:
            return self._number(value)
        match tree:
            case ast.Name(id=name) if name in self._names:
                return self._names[name]
            case ast.BinOp(left=left, op=ast.Mult(), right=right) if (
                factor := constant_of(left)
            ) is not None:
                return add("*", self.node(right), constant(factor))
            case ast.BinOp(left=left, op=ast.Mult(), right=right) if (
                factor := constant_of(right)
            ) is not None:
                return add("*", self.node(left), constant(factor))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return add("*", self.node(operand), constant(-1.0))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.node(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int(power))) if (
                1 <= power <= HIGHEST
            ):
                base = found = self.node(left)
                for _ in range(power - 1):
                    found = add("*", found, base)
                return found
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in OPERATORS:
                return add(OPERATORS[type(operator)], self.node(left), self.node(right))
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in UNARY:
                return add(name, self.node(argument))
            case ast.Call(func=ast.Name(id=name), args=[first, second], keywords=[]) if name in (
                "min",
                "max",
            ):
                return add(name, self.node(first), self.node(second))
        raise InvalidInput(
            f"Term {self._text[:60]!r}: expected numbers, + - * / **, {', '.join(UNARY)}, min, max and the names"
            f" {', '.join(self._names)}, found {ast.unparse(tree)[:60]!r}; write it with those."
        )


def constant_of(tree: ast.expr) -> float | None:
    """The value of a number as it is written, with a sign or without; None for anything else.

    Args:
        tree: of Python's parser.
    """
    match tree:
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            value = constant_of(operand)
            return None if value is None else -value
        case ast.Constant(value=value) if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
        case _:
            return None


def _depth(tree: ast.expr) -> int:
    """Levels of a formula, counted without recursion."""
    depth, level = 0, [tree]
    while level:
        depth += 1
        level = [part for node in level for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr)]
    return depth


def _numbers(tree: ast.expr) -> list[float]:
    """All numbers of a formula, without their signs."""
    values = [part.value for part in ast.walk(tree) if isinstance(part, ast.Constant)]
    return [value for value in values if isinstance(value, (int, float))]
