"""Between readings: states in the middle of a period, and what integrating through them leaves.

A state has a corner where what drives it jumps, and none elsewhere. Between corners it is a polynomial of as many
neighbours as make it smoother; across one it is none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from twinloop._ground.arrays import Floats

POINTS = (4, 6, 8)
"""Neighbours that a polynomial may go through."""
FALLS = 0.5
"""Share to which noise, as differences of the next order show it, must fall for more neighbours to be used."""
SIMPSON = 5
"""Order of the differences in which the error of Simpson's rule shows, divided by `LEFT`."""
LEFT = 2880.0
FEWEST = 20
"""Differences of an order from which noise is read."""


def segments(begun: Floats, ended: Floats) -> list[slice]:
    """Rows of the readings between corners, those at both ends included.

    Args:
        begun: effects of commands at the start of each period (n, effects).
        ended: the same at its end.
    """
    corners = 1 + np.flatnonzero((begun[1:] != ended[:-1]).any(axis=1))
    places = [0, *corners.tolist(), len(begun)]
    return [slice(first, last + 1) for first, last in pairwise(places)]


def roughness(parts: Sequence[Floats], order: int) -> Floats | None:
    """Variance of noise that would make the differences of an order as large as they are.

    Args:
        parts: readings between corners (rows, n_x).
        order: of the differences.

    Returns:
        Of each state (n_x,); None where there are too few.
    """
    squares = [np.square(np.diff(part, n=order, axis=0)) for part in parts if len(part) > order]
    if sum(len(found) for found in squares) < FEWEST:
        return None
    found: Floats = np.concatenate(squares).mean(axis=0) / math.comb(2 * order, order)
    return found


def points(parts: Sequence[Floats]) -> list[int]:
    """Through how many neighbours each state is interpolated: more as long as it is the smoother for them."""
    chosen = [POINTS[0]] * parts[0].shape[1]
    before = roughness(parts, POINTS[0])
    for more in POINTS[1:]:
        after = roughness(parts, more)
        if before is None or after is None:
            break
        smoother = after < FALLS * before
        chosen = [more if falls else number for falls, number in zip(smoother.tolist(), chosen, strict=True)]
        before = np.where(smoother, after, 0.0)
    return chosen


def middles(states: Floats, rows: Sequence[slice], numbers: Sequence[int]) -> Floats:
    """States in the middle of each period.

    Args:
        states: (n + 1, n_x).
        rows: of the segments between corners.
        numbers: of neighbours, by state.

    Returns:
        States (n, n_x): the mean of both ends where corners leave no other neighbour.
    """
    found: Floats = 0.5 * (states[:-1] + states[1:])
    for segment in rows:
        part = states[segment]
        for number in set(numbers) if len(part) > 2 else ():
            columns = [i for i, own in enumerate(numbers) if own == number]
            found[segment.start : segment.stop - 1, columns] = _interpolated(part[:, columns], number)
    return found


def _interpolated(part: Floats, number: int) -> Floats:
    number = min(number, len(part))
    periods = np.arange(len(part) - 1)
    first = np.clip(periods + 1 - number // 2, 0, len(part) - number)
    found = np.zeros((len(periods), part.shape[1]))
    for place in dict.fromkeys((periods - first).tolist()):
        at = np.flatnonzero(periods - first == place)
        for neighbour, weight in enumerate(_weights(number, place + 0.5)):
            found[at] += weight * part[first[at] + neighbour]
    return found


def _weights(number: int, place: float) -> list[float]:
    """Lagrange's weights of neighbours at 0, 1, 2 …, for a place between them."""
    return [
        math.prod((place - other) / (own - other) for other in range(number) if other != own)
        for own in range(number)
    ]


def integration_error(parts: Sequence[Floats], noise: Floats) -> Floats:
    """What Simpson's rule leaves of what moves each state in a period: at most dt⁵/2880 times its fifth derivative.

    It is largest where the motion is fastest, and what is left there is as large, however still the rest is.

    Args:
        parts: readings between corners (rows, n_x).
        noise: variance of the sensors (n_x,), of which differences show more than of the motion.

    Returns:
        Variances (n_x,); 0 where noise hides it.
    """
    squares = roughness(parts, SIMPSON)
    if squares is None:
        return np.zeros(parts[0].shape[1])
    seen = squares > 4.0 * noise
    most = np.max(
        [np.abs(np.diff(part, n=SIMPSON, axis=0)).max(axis=0) for part in parts if len(part) > SIMPSON],
        axis=0,
    )
    variances: Floats = np.where(seen, np.square(most / LEFT), 0.0)
    return variances
