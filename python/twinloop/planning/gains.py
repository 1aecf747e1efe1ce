"""Tuning of gains by CMA-ES, from several starts: the true cost has several basins."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Purpose, Unit
from twinloop.controllers import Family
from twinloop.planning.scored import Score

OFFSPRING = 32
"""Genes of a generation."""
NEAR = 0.02
"""Shares of the box by which each gain may differ before a controller is taken for another one."""
INSIDE = 0.02
"""Share of the box by which a search begins inside it: from an edge, half of its first places would be outside."""
LEVEL, LATEST = 1e-3, 12
"""Share by which the best scores of so many generations, and the latest median, differ at most where a search ends."""
LEAST = 1e-300
"""What a place outside the box costs where its score is zero: less than any score."""


def nearby(family: Family, genes: Floats, others: Sequence[Floats]) -> NDArray[np.bool_]:
    """Which genes are so close to some others that they stand for the same controller.

    Args:
        family: of the controllers.
        genes: (K, size), in the units of the gains.
        others: each (size,), likewise; may be none.

    Returns:
        A flag each (K,).
    """
    if not len(others):
        return np.zeros(len(genes), dtype=np.bool_)
    gaps = np.abs(family.to_unit(genes)[:, np.newaxis] - family.to_unit(np.stack(others)))
    return np.asarray(gaps.max(axis=2, initial=0.0).min(axis=1) <= NEAR)


def scores_of(lost: Floats, quality: Floats, excess: Floats, unit: float) -> Floats:
    """Scores (K, 2) of genes: the share of their flights that diverges, then their quality with what an excess costs.

    Args:
        lost: that share (K,).
        quality: mean over the flights that last (K,).
        excess: by how much the worst of them uses more of the envelope than it may (K,).
        unit: a quality, so that an excess costs something where the quality is 0.
    """
    return np.stack([lost, quality + excess * (10.0 * quality + unit)], axis=1)


def tune_gains(
    family: Family,
    score: Score,
    starts: Sequence[Floats],
    *,
    evaluations: int,
    spread: float,
    unit: Unit,
    purpose: Purpose,
    watch: Callable[[], None] = lambda: None,
    patience: int | None = None,
) -> Floats:
    """Genes of the lowest score (Hansen 2016, see `cmaes.rs`).

    Args:
        family: of the controllers.
        score: of genes, a row each.
        starts: genes to start from, one search each.
        evaluations: of all searches together.
        spread: standard deviation of the first steps, in ranges of the gains.
        unit: of which each search is a part.
        purpose: of their random numbers.
        watch: called after every generation.
        patience: generations after which a search from a further start ends that has found nothing better than those
            before: most that would go on end where these did. None: it goes on.
    """
    best_genes, best = np.asarray(starts[0], dtype=np.float64), tuple(score(np.atleast_2d(starts[0]))[0])
    for number, start in enumerate(starts):
        mean = np.clip(family.to_unit(start), INSIDE, 1.0 - INSIDE)
        search = _core.CmaEs(mean, spread, OFFSPRING, unit.part(number).named(purpose))
        latest: deque[float] = deque(maxlen=LATEST)
        before = best
        for generation in range(max(1, evaluations // (len(starts) * OFFSPRING))):
            places = search.ask()
            genes = family.from_unit(places)
            lost, scores = score(genes).T
            i = int(np.lexsort((scores, lost))[0])
            if (lost[i], scores[i]) < best:
                best_genes, best = genes[i], (lost[i], scores[i])
            search = search.tell(places, _ordered(lost, _dearer_outside(scores, places)))
            watch()
            latest.append(float(scores[i]))
            if number and generation + 1 == patience and best == before:
                break
            if search.stopped or (not lost.any() and _level([*latest, float(np.median(scores))])):
                break
    return best_genes


def _level(scores: Sequence[float]) -> bool:
    """Whether enough generations' scores hardly differ: going on would change no more than what no flight can tell."""
    return len(scores) > LATEST and max(scores) - min(scores) <= LEVEL * abs(min(scores))


def _dearer_outside(scores: Floats, places: Floats) -> Floats:
    """Scores (K,) of places (K, size) that were judged at the edge of the box, and are dearer the further out.

    Sampling anew until a place is inside takes seconds where the best one is a corner.
    """
    outside = np.square(places - np.clip(places, 0.0, 1.0)).sum(axis=1)
    price = np.where(scores == 0.0, LEAST, np.abs(scores))
    return np.where(np.isfinite(scores), scores + np.where(np.isfinite(scores), price, 0.0) * outside, np.inf)


def _ordered(lost: Floats, scores: Floats) -> Floats:
    """Scores (K,) as they are; where any flights are lost, the places of all in the order of both.

    A search looks at the order alone, and a share and a score have no common unit.
    """
    return np.argsort(np.lexsort((scores, lost))).astype(np.float64) if lost.any() else scores
