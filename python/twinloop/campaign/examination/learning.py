"""How the error of the twin fell on each flight from one identification to the next (the paper's Figure 6)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment, Iteration, Lesson
from twinloop.objectives import normalised_error

MOST = 24
"""Identifications that are shown at most: the last ones."""


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """Error of each twin on each flight, over that of a model that never moves.

    Args:
        iterations: number of each identification, the columns.
        tests: number of each flight, the rows; None for an attached run.
        values: (tests, iterations); NaN if unknown, infinite if the twin diverged.
        learnt: whether the twin had learnt the flight (tests, iterations).
    """

    iterations: tuple[int, ...]
    tests: tuple[int | None, ...]
    values: Floats
    learnt: np.ndarray


def error_map(
    history: Sequence[Iteration | Lesson],
    experiments: Sequence[Experiment],
    earlier: Mapping[int, _core.Model],
    error: Callable[[_core.Model, Experiment], float],
) -> ErrorMap:
    """The map of a campaign.

    Args:
        history: of it.
        experiments: in the order of `tell`.
        earlier: models of earlier twins, by how many experiments they had learnt.
        error: of a model on an experiment, over the whole of it.
    """
    shown: Sequence[Iteration | Lesson] = history[-MOST:]
    values = np.full((len(experiments), len(shown)), np.nan)
    learnt = np.zeros(values.shape, dtype=bool)
    for column, record in enumerate(shown):
        told = len(record.tests)
        values[:told, column] = record.normalised[: len(experiments)]
        learnt[:told, column] = True
        if told in earlier:
            for row in range(told, len(experiments)):
                run = experiments[row]
                values[row, column] = normalised_error(error(earlier[told], run), run.frozen)
    return ErrorMap(
        tuple(record.iteration for record in shown), tuple(run.number for run in experiments), values, learnt
    )
