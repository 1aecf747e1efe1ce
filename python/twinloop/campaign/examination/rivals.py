"""Equations that the experiments cannot tell well from those of the twin."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rival:
    """One sum of terms that was considered for a state.

    Args:
        state: that it drives.
        terms: as texts.
        above: description length above that of the chosen one, in units of χ²; 0 for that itself. From about 10 on the
            experiments speak against it.
    """

    state: str
    terms: tuple[str, ...]
    above: float

    @property
    def chosen(self) -> bool:
        """Whether it is the twin's own."""
        return self.above == 0.0
