"""Beyond: whether flights keep the envelope as well if what states do ends where flights have been."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats
from twinloop.planning.judging import Committee, Ends, Judge


def bears_ending(
    judge: Judge,
    committee: Committee,
    margin: float,
    genes: Floats,
    excitation: Floats | None = None,
    ends: Ends | None = None,
) -> NDArray[np.bool_]:
    """Which candidates keep the envelope, and its margin, on the law that ends where flights have been (K,).

    What holds a machine back where it was flown may hold it back no more a little further on. A flight that goes
    further is worth its risk where the envelope is kept even then.

    Args:
        judge: of the campaign.
        committee: with such a law; where there is none all candidates do.
        margin: share of the envelope that is kept free.
        genes: of the candidates (K, size).
        excitation: of each (K, n, n_u); None: there is none.
        ends: where each begins and leads; None: as the task does.
    """
    if committee.ending is None:
        return np.ones(len(genes), dtype=np.bool_)
    flights = judge.quiet([committee.ending], genes, excitation, ends)
    kept: NDArray[np.bool_] = flights.worst_usage <= 1.0 - margin
    return kept
