"""Dry friction: steep about rest and level beyond, which no polynomial is.

A jump at rest cannot be integrated, so tanh(v / w) stands for it: the width w says how slowly what sticks still creeps.
Two of them with widths of their own fall once the motion has set in, as Stribeck (1902) saw (Makkar et al. 2005).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.identification.terms.libraries import speeds
from twinloop.identification.terms.pool import Pool
from twinloop.signals import Signals

NARROWER = 5.0
"""How many times narrower each width is than the last one; where in between it lies is tuned."""
WIDTHS = 4
"""Widths of a speed that are tried, below the largest that was seen."""


@dataclass(frozen=True)
class Friction:
    """Dry friction of a speed v.

    Args:
        inputs: the input that v is, or two of which v is the difference.
        scale: that v is in units of.
        width: w, in units of the scale.
    """

    inputs: tuple[int, ...]
    scale: float
    width: float


def frictions(signals: Signals, inputs: Floats) -> Iterator[Friction]:
    """Dry friction of each speed that was seen, and of differences of two of one unit.

    Args:
        signals: of the system.
        inputs: of the model (rows, inputs), states first.

    Returns:
        Of each speed with widths from a third of the largest down; none of what never changed its sign.
    """
    for group in speeds(signals):
        for speed in (*((i,) for i in group), *combinations(group, 2)):
            first, *second = (inputs[:, i] for i in speed)
            scale = signals.states[speed[0]].scale
            values = (first - second[0] if second else first) / scale
            low, high = float(values.min()), float(values.max())
            if low < 0.0 < high:
                largest = max(-low, high)
                yield from (Friction(speed, scale, largest / NARROWER**k) for k in range(1, WIDTHS + 1))


def entered(pool: Pool, friction: Friction, tried: int, readings: int) -> int:
    """The node of dry friction, with its price.

    Args:
        pool: that it is entered in.
        friction: of the same inputs.
        tried: terms that it is chosen from.
        readings: whose number gives the precision of its width.
    """
    first, *second = friction.inputs
    speed = pool.share(pool.add("-", first, second[0]) if second else first, friction.scale)
    force = pool.add("tanh", pool.add("*", speed, 1.0 / friction.width))
    pool.found.setdefault(force, pool.length(first) + float(log(tried) + 0.5 * log(max(readings, 2))))
    return force


def is_friction(pool: Pool, number: int) -> bool:
    """Whether an expression is dry friction of something."""
    return pool[number].operation == "tanh"


def frictions_in(pool: Pool, terms: Iterable[int]) -> list[int]:
    """The nodes of dry friction that terms are, or are made of."""
    return [number for number in pool.needed(list(terms)) if is_friction(pool, number)]


def upright(pool: Pool, number: int) -> tuple[int, int]:
    """The node of friction whose slope at rest is above 0, and the sign of the other; of all else itself and 1."""
    if is_friction(pool, number):
        inner = pool[pool[number].operands[0]]
        slopes = [pool.constant_value(operand) for operand in inner.operands]
        if inner.operation == "*" and (slope := slopes[0] if slopes[1] is None else slopes[1]) is not None:
            (speed,) = (part for part, value in zip(inner.operands, slopes, strict=True) if value is None)
            if slope < 0.0:
                return pool.add("tanh", pool.add("*", speed, -slope)), -1
    return number, 1
