"""Scores of an interrupted search: it continues from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from twinloop._ground.arrays import Floats

Score = Callable[[Floats], Floats]
"""Of genes (K, size) the share of their flights that diverges and a score (K, 2), to be minimised in this order."""


@dataclass
class Scored:
    """Scores in the order of the calls: earlier ones are taken from the record, later ones are computed.

    A search depends only on its scores, and the scores take the time. So an interrupted search continues from them.

    Args:
        judged: scores of earlier calls, one array for each set of genes.
        keep: called with all scores after each new one.
    """

    judged: tuple[Floats, ...] = ()
    keep: Callable[[tuple[Floats, ...]], None] = lambda judged: None
    _given: int = field(default=0, init=False)

    def __call__(self, score: Score) -> Score:
        """The same score, remembered."""

        def remembered(genes: Floats) -> Floats:
            at, self._given = self._given, self._given + 1
            # A score of another shape is from another search, and so are all later ones.
            if at >= len(self.judged) or self.judged[at].shape != (len(genes), 2):
                self.judged = (*self.judged[:at], score(genes))
                self.keep(self.judged)
            return self.judged[at]

        return remembered
