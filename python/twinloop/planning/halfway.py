"""Halfway: how far gains may lead from the best ones flown once flights have shown where the twin is wrong.

A flight that came out clearly worse than the best one, and that the twin of now still takes for as good, was a step too
far for this twin: it has learnt the flight and does not see why. So was one that left its envelope and was to keep it.
What the twin promises there is worth nothing, and to fly beside it once more would tell what is known. As in methods
with a trust region (Conn, Gould and Toint 2000) the next steps from the best gains are at most half as long.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.controllers import Family

HALF = 0.5
"""Share of the way to gains that have disappointed that others may be away from the best ones."""


def beyond_halfway(family: Family, genes: Floats, best: Floats, disproved: Sequence[Floats]) -> Floats:
    """By how much gains lead too far from the best ones flown, as shares of the way that they may go; 0: they do not.

    Args:
        family: of the controllers.
        genes: of candidates (K, size).
        best: the best ones flown (size,).
        disproved: gains (size,) of flights that the twin is wrong about; may be none.

    Returns:
        A share each (K,).
    """
    place = family.to_unit(best)
    ways = [float(np.sqrt(np.square(family.to_unit(other) - place).sum())) for other in disproved]
    # Of the same gains once more no way leads anywhere.
    most = HALF * min((way for way in ways if way > 0.0), default=np.inf)
    away = np.sqrt(np.square(family.to_unit(genes) - place).sum(axis=1))
    beyond: Floats = np.maximum(0.0, away / most - 1.0)
    return beyond
