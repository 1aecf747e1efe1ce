"""Tuning of gains by CMA-ES, from several starts: the true cost has several basins."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from threading import Thread

import numpy as np
from numpy.typing import ArrayLike

from twinloop.arrays import Floats
from twinloop.controllers import Family

Score = Callable[[Floats], Floats]
"""Scores (K,), to be minimised, of genes (K, size)."""
OFFSPRING = 32
"""Genes of a generation."""
FLAT = 1e-12
"""What a place outside the box costs where all scores are zero."""


def to_unit(family: Family, genes: ArrayLike) -> Floats:
    """Genes (…, size) as places in the box, 0 to 1, logarithmic where decades matter."""
    genes = np.asarray(genes, dtype=np.float64)
    places = np.empty_like(genes)
    for i, gain in enumerate(family.gains):
        if gain.logarithmic:
            low, high = np.log(gain.low), np.log(gain.high)
            places[..., i] = (np.log(genes[..., i]) - low) / (high - low)
        else:
            places[..., i] = (genes[..., i] - gain.low) / (gain.high - gain.low)
    return places


def from_unit(family: Family, places: ArrayLike) -> Floats:
    """The genes at places in the box; the inverse of `to_unit`, clipped to the bounds."""
    places = np.asarray(places, dtype=np.float64)
    genes = np.empty_like(places)
    for i, gain in enumerate(family.gains):
        place = np.clip(places[..., i], 0.0, 1.0)
        if gain.logarithmic:
            low, high = np.log(gain.low), np.log(gain.high)
            value = np.exp(low + (high - low) * place)
        else:
            value = gain.low + (gain.high - gain.low) * place
        genes[..., i] = np.clip(value, gain.low, gain.high)
    return genes


def load_ahead() -> None:
    """Begins to import CMA-ES beside other work: it takes a second or two, and while the engine learns Python waits."""
    if "cmaes" not in sys.modules:
        Thread(target=import_module, args=("cmaes",), daemon=True).start()


def tune_gains(
    family: Family,
    score: Score,
    starts: Sequence[Floats],
    *,
    evaluations: int,
    spread: float,
    seed: int,
    watch: Callable[[], None] = lambda: None,
) -> Floats:
    """Genes of the lowest score (Hansen 2001).

    Args:
        family: of the controllers.
        score: of genes, a row each.
        starts: genes to start from, one search each.
        evaluations: of all searches together.
        spread: standard deviation of the first steps, in ranges of the gains.
        seed: of the searches.
        watch: called after every generation.
    """
    from cmaes import CMA  # imported here, or waited for: it takes a while

    best_genes, best = np.asarray(starts[0], dtype=np.float64), float(score(np.atleast_2d(starts[0]))[0])
    for number, start in enumerate(starts):
        mean = np.clip(to_unit(family, np.asarray(start, dtype=np.float64)), 0.02, 0.98)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            search = CMA(mean=mean, sigma=spread, seed=(seed + number) % 2**32, population_size=OFFSPRING)
        for _ in range(max(1, evaluations // (len(starts) * OFFSPRING))):
            places = np.stack([search.ask() for _ in range(OFFSPRING)])
            genes = from_unit(family, places)
            scores = score(genes)
            i = int(np.argmin(scores))
            if scores[i] < best:
                best_genes, best = genes[i], float(scores[i])
            # What lies outside is judged at the edge, and dearer the further out: sampling anew until a place is inside
            # takes seconds where the best one is a corner.
            outside = np.square(places - np.clip(places, 0.0, 1.0)).sum(axis=1)
            judged = scores + (np.abs(scores) + FLAT) * outside
            search.tell(list(zip(places, judged.tolist(), strict=True)))
            watch()
            if search.should_stop():
                break
    return best_genes
