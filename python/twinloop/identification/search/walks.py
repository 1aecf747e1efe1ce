"""Walks: how long subsets are searched by annealing, how large they may be, and from which random numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Purpose, Unit

Subsets = Sequence[tuple[list[int], float]]
"""Subsets of features with their description lengths, the best first."""


@dataclass(frozen=True)
class Walks:
    """Annealed walks over subsets.

    Args:
        moves: of each walk.
        largest: number of features of a subset at most.
        unit: of work; each search is a part of it.
        starts: walks for each chain.
        purpose: of the random numbers.
    """

    moves: int
    largest: int
    unit: Unit
    starts: int = 1
    purpose: Purpose = "subsets"

    def part(self, *numbers: int) -> Walks:
        """The same, drawn from a part of the unit."""
        return replace(self, unit=self.unit.part(*numbers))

    def with_moves(self, moves: int) -> Walks:
        """The same with so many moves, one at least."""
        return replace(self, moves=max(1, moves))

    def among(
        self, grams: Sequence[_core.Gram], costs: Sequence[Floats], workers: _core.Workers
    ) -> Sequence[Subsets]:
        """What walks find among the features of each chain.

        Args:
            grams: inner products, one for each chain.
            costs: of each chain's features, in units of χ².
            workers: how the work is carried out.
        """
        return _core.search_subsets(
            grams, costs, moves=self.moves, largest=self.largest, starts=self.starts,
            unit=self.unit.named(self.purpose), workers=workers,
        )  # fmt: skip
