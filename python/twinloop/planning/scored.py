"""Scores that were judged before: a search that was cut goes on from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from twinloop.arrays import Floats

Score = Callable[[Floats], Floats]
"""Of genes (K, size) the share of their flights that diverges and a score (K, 2), to be minimised in this order."""


@dataclass
class Scored:
    """Scores in the order in which they are asked for: first those that were kept, then those that are judged.

    Searches are a function of their scores, and these are what takes time: searches that were cut go on from them.

    Args:
        kept: scores that were judged before, one array for each set of genes that was asked for.
        keep: called with all of them whenever there is one more.
    """

    kept: tuple[Floats, ...] = ()
    keep: Callable[[tuple[Floats, ...]], None] = lambda kept: None
    _given: int = field(default=0, init=False)

    def __call__(self, score: Score) -> Score:
        """The same score, remembered."""

        def remembered(genes: Floats) -> Floats:
            at, self._given = self._given, self._given + 1
            # What is no score of these genes was kept of another search, and all behind it.
            if at >= len(self.kept) or self.kept[at].shape != (len(genes), 2):
                self.kept = (*self.kept[:at], score(genes))
                self.keep(self.kept)
            return self.kept[at]

        return remembered
