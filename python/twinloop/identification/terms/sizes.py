"""Sizes of expressions: what they are measured in, so that what is made of them does not depend on units."""

from __future__ import annotations

from twinloop._ground.elementary import power
from twinloop.identification.terms.libraries import angles
from twinloop.identification.terms.pool import Pool
from twinloop.law.expressions import CONSTANT, INPUT, SHARE
from twinloop.signals import Signals


def in_shares(pool: Pool, node: int, signals: Signals) -> int:
    """The node of an expression in units of its size; itself where it has no unit."""
    found = size(pool, node, signals)
    return node if found is None else pool.share(node, found)


def size(pool: Pool, node: int, signals: Signals) -> float | None:
    """How large an expression is where its inputs are as large as their scales; None for one without a unit.

    Angles and commands, which a model sees in units of their scales, have none. A factor in front of an expression may
    be a weight, which has one.
    """
    operation, operands, value = pool[node]
    if operation == INPUT:
        return _of_input(int(value), pool, signals)
    if operation in (CONSTANT, SHARE, "sin", "cos", "tanh", "exp"):
        return None
    a, *rest = (size(pool, operand, signals) for operand in operands)
    if operation == "*":
        factors = [abs(pool[operand].value) for operand in operands if pool[operand].operation == CONSTANT]
        return _product(a, rest[0], *factors)
    if operation == "/":
        return a if rest[0] is None else (1.0 if a is None else a) / rest[0]
    if operation == "sqrt":
        return None if a is None else float(power(a, 0.5))
    return next((each for each in (a, *rest) if each is not None), None)


def _of_input(place: int, pool: Pool, signals: Signals) -> float | None:
    if place < signals.n_x:
        return None if place in angles(signals) else signals.states[place].scale
    # A hidden state is what commands have done over some time.
    return None if place < pool.inputs else signals.dt


def _product(*sizes: float | None) -> float | None:
    known = [each for each in sizes if each]
    product = 1.0
    for each in known:
        product *= each
    return product if known else None
