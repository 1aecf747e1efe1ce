"""Ranking and archive: they see rows of numbers, minimised, and nothing else (Deb et al., NSGA-II, 2002)."""

from __future__ import annotations

from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._ground.arrays import Floats, Integers, floats, whole

__all__ = ["Archive", "best_tradeoff", "crowding_distances", "ideal_point", "ranks", "select"]

Archive = _core.Archive


def ranks(objectives: ArrayLike) -> Integers:
    """Front of each row: 0 for rows that no row dominates, 1 for rows that only front 0 dominates, and so on.

    Args:
        objectives: (rows, columns), minimised.

    Returns:
        Ranks (rows,).

    Raises:
        InvalidInput: not a matrix, or numbers that are not finite.
    """
    return _core.ranks(_matrix(objectives))


def crowding_distances(objectives: ArrayLike, ranks: ArrayLike) -> Floats:
    """Distance of each row to its neighbours in its front; infinite at the edges of the front.

    Args:
        objectives: (rows, columns), minimised.
        ranks: front of each row (rows,).

    Returns:
        Distances (rows,), in shares of the front's extent.

    Raises:
        InvalidInput: shapes that do not fit, or a number that is not finite.
    """
    return _core.crowding_distances(_matrix(objectives), ranks)


def select(objectives: ArrayLike, count: int) -> Integers:
    """The best rows by rank, then by crowding distance.

    Args:
        objectives: (rows, columns), minimised.
        count: how many; all of them if there are fewer.

    Returns:
        Their numbers (count,), best first.

    Raises:
        InvalidInput: not a matrix, a number in it that is not finite, or a count below 1.
    """
    return _core.select(_matrix(objectives), whole("Select, count", count))


def ideal_point(objectives: ArrayLike) -> Floats:
    """Smallest value of each objective (paper, section IV.A).

    Args:
        objectives: (rows, columns), minimised.

    Returns:
        The point (columns,).

    Raises:
        InvalidInput: not a matrix, or no row.
    """
    return _core.ideal_point(_matrix(objectives))


def best_tradeoff(objectives: ArrayLike, normalised: bool = False) -> int:
    """The row nearest to the ideal point (paper, section IV.A).

    Args:
        objectives: (rows, columns), minimised.
        normalised: measure in extents of the objectives; the paper does not.

    Returns:
        Its number.

    Raises:
        InvalidInput: not a matrix, or no row.
    """
    return _core.best_tradeoff(_matrix(objectives), normalised)


def _matrix(objectives: ArrayLike) -> Floats:
    return floats("Objectives (rows, columns)", objectives, (None, None))
