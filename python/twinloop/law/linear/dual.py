"""Numbers with their derivatives by everything that a period begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats


@dataclass(frozen=True, eq=False)
class Dual:
    """Numbers with their derivatives.

    Args:
        values: (rows,).
        slopes: by each of what they depend on (rows, inputs).
    """

    values: Floats
    slopes: Floats

    def __add__(self, other: Dual) -> Dual:
        """A sum, number by number."""
        return Dual(self.values + other.values, self.slopes + other.slopes)

    def __sub__(self, other: Dual) -> Dual:
        """A difference, number by number."""
        return Dual(self.values - other.values, self.slopes - other.slopes)

    def __mul__(self, factor: float | Floats | Dual) -> Dual:
        """A product, number by number."""
        if isinstance(factor, Dual):
            values = self.values * factor.values
            return Dual(values, (self * factor.values).slopes + (factor * self.values).slopes)
        of_rows = factor[:, np.newaxis] if isinstance(factor, np.ndarray) else factor
        return Dual(self.values * factor, self.slopes * of_rows)

    def mapped(self, matrix: Floats) -> Dual:
        """What a matrix (others, rows) makes of the numbers."""
        return Dual(matrix @ self.values, matrix @ self.slopes)

    def rows(self, places: Sequence[int]) -> Dual:
        """Some of the numbers."""
        return Dual(self.values[list(places)], self.slopes[list(places)])

    def put(self, places: Sequence[int], others: Dual) -> Dual:
        """The same with others in some places."""
        values, slopes = self.values.copy(), self.slopes.copy()
        values[list(places)], slopes[list(places)] = others.values, others.slopes
        return Dual(values, slopes)

    @staticmethod
    def stacked(parts: Sequence[Dual]) -> Dual:
        """One after another."""
        return Dual(
            np.concatenate([part.values for part in parts]), np.concatenate([part.slopes for part in parts])
        )
