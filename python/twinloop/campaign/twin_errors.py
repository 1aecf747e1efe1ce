"""Errors of a model on all runs, one row per run."""

from __future__ import annotations

from twinloop import _core
from twinloop.campaign.logbook import Logbook
from twinloop.law.accuracy import TestErrors
from twinloop.objectives import closed_loop, normalised_error, open_loop


def errors_of(model: _core.Model, book: Logbook, workers: _core.Workers) -> list[TestErrors]:
    """How well a model follows each run.

    Args:
        model: to be judged.
        book: with the runs.
        workers: how the work is carried out.

    Returns:
        A row for each experiment, in the order of `tell`.
    """
    steps, runs = (objective([model], book.selected, workers)[0] for objective in (open_loop, closed_loop))
    return [
        TestErrors(run.number, step, free, normalised_error(free, run.frozen), run.before, free)
        for run, step, free in zip(book.experiments, steps.tolist(), runs.tolist(), strict=True)
    ]
