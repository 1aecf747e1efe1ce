"""Values of expressions with their derivatives, forwards from the inputs; no differences."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.expressions import (
    CONSTANT,
    GIMBAL,
    INPUT,
    POWER,
    SMALLEST_DIVISOR,
    UPRIGHT,
    Expressions,
)

_UNARY: dict[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "abs": (abs, lambda a: float(np.sign(a))),
    "sqrt": (lambda a: math.sqrt(abs(a)), lambda a: np.sign(a) * 0.5 / math.sqrt(abs(a)) if a else math.inf),
    "sin": (math.sin, math.cos),
    "cos": (math.cos, lambda a: -math.sin(a)),
    "tanh": (math.tanh, lambda a: 1.0 - math.tanh(a) ** 2),
    "exp": (lambda a: float(np.exp(a)), lambda a: float(np.exp(a))),
    UPRIGHT: (
        lambda a: a if abs(a) >= GIMBAL else math.copysign(GIMBAL, a),
        lambda a: float(abs(a) >= GIMBAL),
    ),
}
"""Value and derivative of each function of one operand."""


def jacobian(expressions: Expressions, roots: Sequence[int], inputs: Floats) -> tuple[Floats, Floats]:
    """Some expressions and their derivatives by all inputs, at a point.

    Args:
        expressions: where they are.
        roots: r nodes.
        inputs: (m,), where they are evaluated.

    Returns:
        Values (r,) and derivatives (r, m); not finite where an expression or its slope is not.
    """
    known: dict[int, tuple[float, Floats]] = {}
    identity, nothing = np.eye(len(inputs)), np.zeros(len(inputs))
    with np.errstate(all="ignore"):
        for number in expressions.needed(roots):
            operation, operands, value = expressions[number]
            if operation == INPUT:
                known[number] = float(inputs[int(value)]), identity[int(value)]
            elif operation == CONSTANT:
                known[number] = value, nothing
            else:
                known[number] = _computed(operation, [known[operand] for operand in operands], value)
    if not roots:
        return np.zeros(0), np.zeros((0, len(inputs)))
    values, slopes = zip(*(known[root] for root in roots), strict=True)
    return np.array(values), np.stack(slopes)


def _computed(operation: str, parts: Sequence[tuple[float, Floats]], value: float) -> tuple[float, Floats]:
    """An operation on values with their derivatives."""
    (a, da), (b, db) = parts[0], parts[-1]
    if operation in _UNARY:
        function, slope = _UNARY[operation]
        # Where a function has no slope it may still be of what does not move.
        return function(a), np.where(da == 0.0, 0.0, slope(a) * da)
    if operation == POWER:
        return a**value, value * a ** (value - 1.0) * da
    if operation in ("+", "-"):
        sign = 1.0 if operation == "+" else -1.0
        return a + sign * b, da + sign * db
    if operation == "*":
        return a * b, b * da + a * db
    if operation == "/":
        return (a / b, (b * da - a * db) / (b * b)) if abs(b) > SMALLEST_DIVISOR else (a, da)
    first = a < b if operation == "min" else a > b
    return (a, da) if first else (b, db)
