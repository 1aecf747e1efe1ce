"""Hinges: terms that are 0 on one side of a place and grow from there on the other.

A stop pushes once it is touched, a gear turns its load once the play is used up, a valve lets nothing through before it
is a little open. No polynomial says so. A hinge max(0, z - c) does (Friedman 1991), and times the rate of z it is what
a contact loses (Hunt and Crossley 1975).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from twinloop.arrays import Floats
from twinloop.elementary import log
from twinloop.identification.terms.libraries import periodic, rates
from twinloop.identification.terms.pool import Pool
from twinloop.signals import Signals

PLACES = 16
"""Places that are tried between the least and the largest value of a coordinate, and as many among its readings."""
MOST = 400
"""Hinges that are tried; where there would be more, fewer places are."""
WORTH = 10.0
"""Nats that a hinge must gain beside its description: with a few of them anything can be drawn."""


def hinges(pool: Pool, signals: Signals, inputs: Floats) -> list[int]:
    """Enters hinges where the runs have been, with their prices.

    Args:
        pool: that they are entered in; nobody else's.
        signals: of the system.
        inputs: of the model (rows, inputs).

    Returns:
        Their nodes: of states that are no rates and do not wrap, and of commands of one sign, to either side; of
        differences of two states of one unit, and of commands of two signs, to both sides alike. Those of states and of
        differences also times their rate.
    """
    found = list(_coordinates(pool, signals))
    kinds = sum((1 if each.alike else 2) * (1 if each.rate is None else 2) for each in found)
    places = min(PLACES, MOST // (2 * kinds)) if kinds else 0
    terms: list[int] = []
    for each in found:
        share = pool.share(each.node, each.scale)
        values = pool.values([each.node], inputs)[:, 0] / each.scale
        for place in _places(np.abs(values) if each.alike else values, places):
            above, below = (
                _beyond(pool, share, place),
                _beyond(pool, share, -place if each.alike else place, -1),
            )
            if each.alike:
                forces = [(pool.add("-", above, below), pool.add("+", above, below))]
            else:
                forces = [(above, above), (below, below)]
            for force, depth in forces:
                terms += [force] if each.rate is None else [force, pool.product(depth, each.rate)]
    terms = list(dict.fromkeys(terms))
    price = WORTH + float(log(max(1, len(terms))))
    for term in terms:
        pool.found.setdefault(term, price)
    return terms


class _Coordinate(NamedTuple):
    """What may have a place at which something begins.

    Args:
        node: of it.
        scale: of its unit.
        rate: node of its derivative; None: it has none.
        alike: whether the same begins on both sides of 0, as in a gear with play.
    """

    node: int
    scale: float
    rate: int | None
    alike: bool


def _coordinates(pool: Pool, signals: Signals) -> Iterator[_Coordinate]:
    states, moving = signals.states, rates(signals)
    of = {state.derivative_of: i for i, state in enumerate(states) if state.derivative_of is not None}
    resting = [i for i in range(signals.n_x) if i not in moving and i not in periodic(signals)]
    for i in resting:
        yield _Coordinate(i, states[i].scale, of.get(states[i].name), alike=False)
    for i, j in combinations(resting, 2):
        if states[i].unit == states[j].unit:
            both = of.get(states[i].name), of.get(states[j].name)
            rate = None if both[0] is None or both[1] is None else pool.add("-", both[0], both[1])
            yield _Coordinate(pool.add("-", i, j), states[i].scale, rate, alike=True)
    for command, place in zip(signals.commands, range(signals.n_x, pool.inputs), strict=True):
        yield _Coordinate(place, 1.0, None, alike=command.bounds[0] < 0.0 < command.bounds[1])


def _beyond(pool: Pool, share: int, place: float, side: int = 1) -> int:
    """By how much a coordinate is above a place, or below it (side -1); 0 on the other side."""
    away = pool.add("-", share, place) if side > 0 else pool.add("-", pool.constant(place), share)
    return pool.add("max", away, 0.0)


def _places(values: Floats, count: int) -> list[float]:
    """Places within some values: evenly between their ends, and so that as many readings lie between any two."""
    low, high = float(values.min()), float(values.max())
    if count < 1 or not high > low:
        return []
    ordered = np.sort(values)
    evenly = [low + (high - low) * (k + 1) / (count + 1) for k in range(count)]
    among = [float(ordered[(k + 1) * len(ordered) // (count + 1)]) for k in range(count)]
    return sorted({place for place in (*evenly, *among) if low < place < high})
