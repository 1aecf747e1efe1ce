"""Comparing description lengths: those that differ by rounding alone are equal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

Described = TypeVar("Described")
TIE = 1e-6
"""In units of χ². A likelihood has a term for the units of the readings; with that, what rounding takes changes."""


def shorter(length: float, other: float) -> bool:
    """Whether a description is shorter than another by more than rounding."""
    return length < other - TIE


def shortest(candidates: Sequence[Described], length: Callable[[Described], float]) -> Described:
    """The first of the candidates that no other is shorter than.

    Args:
        candidates: at least one.
        length: of each; infinite for one that describes nothing.
    """
    best = candidates[0]
    for candidate in candidates[1:]:
        if shorter(length(candidate), length(best)):
            best = candidate
    return best
