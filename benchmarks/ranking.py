"""Ranking: sort, crowding and selection of half a population, beside pymoo and moocore."""

import moocore
import numpy as np

from measure import Disagreement, Line, Section, check_agreement, interleaved, optional, ratio
from twinloop import _core

POPULATION, SELECTED = 500, 250
BAR, BAR_OBJECTIVES = 5.0, 8
SELECT, RANKS = "twinloop, select", "twinloop, ranks only"
PARTS, SURVIVAL, MOOCORE = "pymoo, its parts", "pymoo, RankAndCrowding", "moocore, ranks only"


def mostly_nondominated(rng: np.random.Generator, rows: int, columns: int) -> np.ndarray:
    """Nine of ten points on the simplex, where none dominates another; the rest behind it."""
    behind = np.where(rng.random(rows) < 0.1, rng.uniform(1.1, 1.5, size=rows), 1.0)
    return rng.dirichlet(np.ones(columns), size=rows) * behind[:, None]


def report(smoke: bool) -> Section:
    section = Section(f"Ranking: sort + crowding + selection of {SELECTED} out of {POPULATION}")
    rng = np.random.default_rng(2)
    pymoo = optional("pymoo_survival", section)
    for columns in (2, 8) if smoke else (2, 4, 8, 16):
        objectives = mostly_nondominated(rng, POPULATION, columns)
        check_agreement(f"ranks of {columns}", _core.ranks(objectives), moocore.pareto_rank(objectives))
        contestants = {
            SELECT: lambda objectives=objectives: _core.select(objectives, SELECTED),
            RANKS: lambda objectives=objectives: _core.ranks(objectives),
            MOOCORE: lambda objectives=objectives: moocore.pareto_rank(objectives),
        }
        pairs = {MOOCORE: RANKS}
        if pymoo:
            _check_selection(objectives, pymoo.select_with_parts(objectives, SELECTED))
            contestants[PARTS] = lambda objectives=objectives: pymoo.select_with_parts(objectives, SELECTED)
            contestants[SURVIVAL] = lambda objectives=objectives: pymoo.select_as_pymoo(objectives, SELECTED)
            pairs |= {PARTS: SELECT, SURVIVAL: SELECT}
        times = interleaved(contestants, 3 if smoke else 41, at_least=0.0 if smoke else 0.005)
        for name in contestants:
            against = ratio(times, name, pairs[name]) if name in pairs else None
            bar = BAR if name == PARTS and columns == BAR_OBJECTIVES else None
            figure = float(np.median(times[name])) * 1e6
            section.lines.append(Line(f"{POPULATION} × {columns}", name, figure, "µs", against, bar))
    section.notes.append("moocore is measured against our ranks alone, pymoo against the whole selection.")
    return section


def _check_selection(objectives: np.ndarray, theirs: np.ndarray) -> None:
    """Both took the best by rank and crowding: their sorted keys are the same; rows that tie may differ."""
    ranks = _core.ranks(objectives)
    crowding = _core.crowding_distances(objectives, ranks)
    ours = _core.select(objectives, SELECTED)
    if len(set(theirs)) != SELECTED:
        raise Disagreement(f"ranking: expected {SELECTED} rows of pymoo, found {len(set(theirs))}.")
    # Behind the splitting front nothing is cut, so only the crowding within that front decides.
    last = ranks[ours].max()
    for rows in (ours, theirs):
        if ranks[rows].max() != last:
            raise Disagreement("ranking: the last fronts differ.")
    cut, their_cut = (np.sort(crowding[rows[ranks[rows] == last]]) for rows in (ours, theirs))
    check_agreement("crowding of the last front", cut, their_cut)
    whole, their_whole = (np.sort(rows[ranks[rows] < last]) for rows in (ours, theirs))
    check_agreement("rows of the fronts before", whole, their_whole)
