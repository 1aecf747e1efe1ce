"""Between readings: states in the middle of a period, and what integrating through them leaves.

A state has a corner where what drives it jumps, and none elsewhere. Between corners it is a polynomial of as many
neighbours as make it smoother; across one it is none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
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
"""Of a rule over a period h with its middle the error is h⁵ f⁗ / 2880 (Abramowitz and Stegun 1964, 25.4.5)."""
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


def differences(parts: Sequence[Floats], order: int) -> Floats:
    """Differences of an order within parts, one part after another.

    Args:
        parts: readings between corners (rows, n_x).
        order: of the differences.

    Returns:
        Those of all parts (rows, n_x); none of parts that are too short.
    """
    # Of all rows at once: there may be as many parts as periods.
    number = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    found: Floats = np.diff(np.concatenate(parts), n=order, axis=0)[number[order:] == number[:-order]]
    return found


def roughness(parts: Sequence[Floats], order: int) -> Floats | None:
    """Variance of noise that would make the differences of an order as large as they are.

    Args:
        parts: readings between corners (rows, n_x).
        order: of the differences.

    Returns:
        Of each state (n_x,); None where there are too few.
    """
    squares = np.square(differences(parts, order))
    if len(squares) < FEWEST:
        return None
    found: Floats = squares.mean(axis=0) / math.comb(2 * order, order)
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
    """The middle of each period, through so many neighbours around it, or the first or last of them near the ends."""
    number = min(number, len(part))
    weights, around = _weights(number), len(part) - number + 1
    # Periods before those that have as many neighbours on both sides, these, and those after them.
    before = number // 2 - 1
    after = len(part) - 1 - before - around
    found = np.zeros((len(part) - 1, part.shape[1]))
    for neighbour in range(number):
        of_each = weights[:, neighbour, np.newaxis]
        found[:before] += of_each[:before] * part[neighbour]
        found[before : before + around] += of_each[before] * part[neighbour : neighbour + around]
        found[before + around :] += of_each[number - 1 - after :] * part[around - 1 + neighbour]
    return found


@cache
def _weights(number: int) -> Floats:
    """Lagrange's weights of neighbours at 0, 1, 2 …, in the middle of each period between them (number − 1, number)."""
    return np.array([
        [
            math.prod((place + 0.5 - other) / (own - other) for other in range(number) if other != own)
            for own in range(number)
        ]
        for place in range(number - 1)
    ])  # fmt: skip


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
    most = np.abs(differences(parts, SIMPSON)).max(axis=0)
    variances: Floats = np.where(seen, np.square(most / LEFT), 0.0)
    return variances
