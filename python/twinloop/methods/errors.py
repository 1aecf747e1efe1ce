"""Errors of a model on all that was told, a row a test."""

from __future__ import annotations

from twinloop import _core
from twinloop.logbook import Logbook
from twinloop.models import TestErrors
from twinloop.objectives import closed_loop, normalised_error, open_loop


def errors(model: _core.Model, book: Logbook, workers: _core.Workers) -> list[TestErrors]:
    """How well a model follows each selected test.

    Args:
        model: to be judged.
        book: with the selected tests.
        workers: how the work is carried out.

    Returns:
        A row for each experiment, in the order they were told.
    """
    steps = open_loop([model], book.selected, workers)[0].tolist()
    runs = closed_loop([model], book.selected, workers)[0].tolist()
    return [
        TestErrors(run.test.number, step, free, normalised_error(free, run.frozen), run.before, free)
        for run, step, free in zip(book.experiments, steps, runs, strict=True)
    ]
