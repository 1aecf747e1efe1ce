"""pymoo's selection by rank and crowding, lean and as its users run it."""

import numpy as np
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding
from pymoo.operators.survival.rank_and_crowding.metrics import get_crowding_function
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

SORTING, CROWDING, SURVIVAL = NonDominatedSorting(), get_crowding_function("cd"), RankAndCrowding()


def select_with_parts(objectives: np.ndarray, count: int) -> np.ndarray:
    """What `RankAndCrowding` does with the numbers.

    Without the attributes that it sets on every individual, and without its random order of ties.
    """
    selected: list[int] = []
    for front in SORTING.do(objectives, n_stop_if_ranked=count):
        remove = len(selected) + len(front) - count
        crowding = CROWDING.do(objectives[front], n_remove=max(remove, 0))
        if remove > 0:
            front = front[np.argsort(-crowding)[:-remove]]
        selected.extend(front)
    return np.array(selected)


def select_as_pymoo(objectives: np.ndarray, count: int) -> Population:
    """The operator itself, population made anew as its objectives are."""
    problem = Problem(n_var=1, n_obj=objectives.shape[1])
    return SURVIVAL.do(problem, Population.new("F", objectives), n_survive=count)
