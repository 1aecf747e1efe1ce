"""Terms that a user suspects, written as formulas of states and commands: parsed, never evaluated as code."""

from __future__ import annotations

import ast

from twinloop.errors import InvalidInput
from twinloop.identification.pool import UNARY, Pool
from twinloop.signals import Signals

BINARY: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
LONGEST = 500
"""Characters of a formula at most."""
HIGHEST = 6
"""Power of an expression at most."""


def parsed_term(text: str, pool: Pool, signals: Signals) -> int:
    """A formula as a node of the pool.

    A command stands for itself in units of its scale, as a model sees it; states are in their units.

    Args:
        text: such as "rate * abs(rate)" or "sin(angle)": numbers, + − * / **, abs, sqrt, sin, cos, tanh, exp, min, max.
        pool: where it is entered.
        signals: whose names it may use.

    Returns:
        The node.

    Raises:
        InvalidInput: text that is no such formula, or names what is not there.
    """
    if len(text) > LONGEST:
        raise InvalidInput(f"Seed term: expected at most {LONGEST} characters, found {len(text)}; split it.")
    try:
        tree = ast.parse(text, mode="eval").body
    except SyntaxError as reason:
        raise InvalidInput(f"Seed term {text!r}: expected a formula such as 'rate * abs(rate)'.") from reason
    names = {name: i for i, name in enumerate((*signals.state_names, *signals.command_names))}
    return _node(tree, text, pool, names)


def _node(tree: ast.expr, text: str, pool: Pool, names: dict[str, int]) -> int:
    def inner(part: ast.expr) -> int:
        return _node(part, text, pool, names)

    match tree:
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.Constant(value=value) if isinstance(value, (int, float)) and not isinstance(value, bool):
            return pool.add(("*", pool.one, float(value)))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return pool.add(("*", inner(operand), -1.0))
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int(power))) if (
            1 <= power <= HIGHEST
        ):
            return pool.product(*[inner(left)] * power)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in BINARY:
            return pool.add((BINARY[type(operator)], inner(left), inner(right)))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in UNARY:
            return pool.add((name, inner(argument), None))
        case ast.Call(func=ast.Name(id=name), args=[first, second], keywords=[]) if name in ("min", "max"):
            return pool.add((name, inner(first), inner(second)))
        case _:
            known = ", ".join(names)
            raise InvalidInput(
                f"Seed term {text!r}: expected numbers, + - * / **, abs, sqrt, sin, cos, tanh, exp, min, max and the"
                f" names {known}, found {ast.unparse(tree)!r}; write it with those."
            )
