"""Errors of models on all that was told, a row or a column a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.campaign.logbook import Logbook
from twinloop.law.accuracy import TestErrors
from twinloop.objectives import closed_loop, normalised_error, open_loop

Objective = Callable[[Sequence[_core.Model], _core.SelectedTests, _core.Workers], Floats]


def errors_of(model: _core.Model, book: Logbook, workers: _core.Workers) -> list[TestErrors]:
    """How well a model follows each run.

    Args:
        model: to be judged.
        book: with the runs.
        workers: how the work is carried out.

    Returns:
        A row for each experiment, in the order they were told.
    """
    steps, runs = (_of_all(objective, [model], book, workers)[0] for objective in (open_loop, closed_loop))
    return [
        TestErrors(run.number, step, free, normalised_error(free, run.frozen), run.before, free)
        for run, step, free in zip(book.experiments, steps.tolist(), runs.tolist(), strict=True)
    ]


def free_runs(models: Sequence[_core.Model], book: Logbook, workers: _core.Workers) -> Floats:
    """Errors of free runs: under the controllers of the tests, or, where nobody asked, under the recorded commands.

    Args:
        models: m of them.
        book: with N runs.
        workers: how the work is carried out.

    Returns:
        Mean squared errors (m, N), SI units squared, in the order the runs were told.
    """
    return _of_all(closed_loop, models, book, workers)


def _of_all(
    objective: Objective, models: Sequence[_core.Model], book: Logbook, workers: _core.Workers
) -> Floats:
    return objective(models, book.selected, workers)
