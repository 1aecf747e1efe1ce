"""Slopes of what readings show: local polynomials, whose degree and width the readings choose themselves.

Each polynomial is fitted to neighbours by least squares (Savitzky and Golay 1964), as a sum of those orthogonal
on evenly spaced points (Gram). Of all degrees and widths that one is believed which foretells each reading best from
all others.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats

DEGREES = (2, 4, 6)
WIDTHS = (5, 7, 9, 13, 19, 27, 39)
"""Points of a window, where there are as many."""


class Slopes(NamedTuple):
    """Derivatives by the number of the reading.

    Args:
        missed: mean squared error of a reading predicted from its neighbours.
        at: at each reading (n + 1,).
        between: in the middle between each and the next (n,).
    """

    missed: float
    at: Floats
    between: Floats


def slopes(values: Floats) -> Slopes | None:
    """Derivatives of evenly spaced readings.

    Args:
        values: readings (n + 1,).

    Returns:
        The derivatives; None where there are too few readings.
    """
    tried = [
        (_missed(values, degree, width), degree, width)
        for degree in DEGREES
        for width in WIDTHS
        # With as many constants as readings, no reading is predicted from the others.
        if degree + 1 < width <= len(values)
    ]
    if not tried:
        return None
    missed, degree, width = min(tried)
    at, after, before = (_applied(values, degree, width, kind) for kind in ("slope", "after", "before"))
    return Slopes(missed, at, 0.5 * (after[:-1] + before[1:]))


def _missed(values: Floats, degree: int, width: int) -> float:
    """Mean squared error of each reading predicted from its neighbours alone."""
    own = _own(degree, width)
    places = _places(len(values), width)
    errors = (values - _applied(values, degree, width, "value")) / (1.0 - own[places])
    return float(np.square(errors).mean())


def _places(count: int, width: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Where in its window each reading stands."""
    rows = np.arange(count)
    return rows - np.clip(rows - width // 2, 0, count - width)


def _applied(values: Floats, degree: int, width: int, kind: str) -> Floats:
    weights = _weights(degree, width)[kind][_places(len(values), width)]
    rows = np.arange(len(values))
    first = rows - _places(len(values), width)
    found = np.zeros(len(values))
    for neighbour in range(width):
        found += weights[:, neighbour] * values[first + neighbour]
    return found


def _own(degree: int, width: int) -> Floats:
    return np.diag(_weights(degree, width)["value"])


@cache
def _weights(degree: int, width: int) -> dict[str, Floats]:
    """Weights of a window's readings (width, width), by the place that they tell of and what they tell."""
    places: Floats = np.arange(width, dtype=np.float64) - 0.5 * (width - 1)
    on, _ = _polynomials(degree, width, places)
    sizes = np.square(on).sum(axis=1)

    def weighing(rows: Floats) -> Floats:
        total = np.zeros((width, width))
        for row, own, size in zip(rows, on, sizes, strict=True):
            total += np.outer(row, own) / size
        return total

    slopes_at = {
        name: _polynomials(degree, width, places + by)[1]
        for name, by in {"slope": 0.0, "after": 0.5, "before": -0.5}.items()
    }
    return {"value": weighing(on)} | {name: weighing(rows) for name, rows in slopes_at.items()}


def _polynomials(degree: int, width: int, places: Floats) -> tuple[Floats, Floats]:
    """Gram's polynomials on `width` points about 0, by their recurrence, and their slopes (degree + 1, places)."""
    values = [np.ones_like(places), places]
    slopes_ = [np.zeros_like(places), np.ones_like(places)]
    for k in range(1, degree):
        share = k * k * (width * width - k * k) / (4.0 * (4.0 * k * k - 1.0))
        values.append(places * values[-1] - share * values[-2])
        slopes_.append(values[-2] + places * slopes_[-1] - share * slopes_[-2])
    return np.stack(values), np.stack(slopes_)
