"""Errors of a model on all runs, one row per run."""

from __future__ import annotations

from twinloop import _core
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.replaying import free_errors
from twinloop.law.accuracy import TestErrors
from twinloop.law.noise import Noise
from twinloop.objectives import open_loop


def errors_of(
    model: _core.Model, book: Logbook, workers: _core.Workers, noise: Noise | None = None
) -> list[TestErrors]:
    """How well a model follows each run.

    Args:
        model: to be judged.
        book: with the runs.
        workers: how the work is carried out.
        noise: of the sensors, and disturbances, as identified; None: of sensors alone, guessed from each flight.

    Returns:
        A row for each experiment, in the order of `tell`.
    """
    steps, runs = (
        open_loop([model], book.selected, workers)[0].tolist(),
        free_errors(model, book, workers, noise),
    )
    return [
        TestErrors(run.number, step, free.error, free.normalised, run.before, free.error)
        for run, step, free in zip(book.experiments, steps, runs, strict=True)
    ]
