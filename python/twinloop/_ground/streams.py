"""Units of work, by whose names the engine draws random numbers: no two of them share a stream, none is global."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from twinloop import _core

Purpose = Literal[
    "subsets",
    "members",
    "hidden_subsets",
    "terms",
    "structures",
    "gains",
    "fine_gains",
    "starts",
    "sensors",
    "off_start",
    "candidates",
    "ends",
    "excitation",
    "baseline",
    "band",
    "repeats",
    "exam",
]
"""What random numbers of a campaign are for, in the engine's words (`rng.rs`)."""
Name = tuple[int, Purpose, tuple[int, ...]]
"""A stream's name, as the engine takes it."""


@dataclass(frozen=True)
class Unit:
    """A unit of work, and the numbers that lead to it from a campaign's seed.

    Args:
        seed: of the campaign.
        path: which iteration, which search of it, and so on; the engine takes five numbers at most.
    """

    seed: int
    path: tuple[int, ...] = ()

    def part(self, *numbers: int) -> Unit:
        """A unit within this one."""
        return Unit(self.seed, (*self.path, *numbers))

    def named(self, purpose: Purpose) -> Name:
        """The name of its stream for a purpose; that of no other unit, and of no other purpose."""
        return self.seed, purpose, self.path

    def stream(self, purpose: Purpose) -> _core.Stream:
        """Its random numbers for a purpose, from the first one on."""
        return _core.Stream(self.named(purpose))
