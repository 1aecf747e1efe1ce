"""Errors of a model on flights, each state in units of its scale: so the units of states decide nothing.

The paper takes states as they are; with its preset errors are sums of rad² and (rad/s)², to the letter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop.campaign.entering import with_run
from twinloop.campaign.history import Experiment
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.replaying import frozen_of, length_of, missed_of
from twinloop.campaign.setup import Setup
from twinloop.law.accuracy import TestErrors, squares
from twinloop.law.beginning import states_read
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise
from twinloop.law.pieces import in_pieces
from twinloop.objectives import closed_loop, normalised_error, open_loop


@dataclass(frozen=True)
class FreeError:
    """What a free run of a model is off from a flight.

    Args:
        error: mean square over steps and states; infinite where it diverges.
        frozen: of the model that never moves, from where each piece begins.
        length: steps of a piece; all steps of the flight where it is followed in whole.
    """

    error: float
    frozen: float
    length: int

    @property
    def normalised(self) -> float:
        """Error over that of the model that never moves."""
        return normalised_error(self.error, self.frozen)


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
    steps, runs = _one_step_errors(model, book, workers), free_errors(model, book, workers, noise)
    attached = count(1)
    return [
        TestErrors(
            run.number,
            step,
            free.error,
            free.normalised,
            run.before,
            free.error,
            next(attached) if run.attached else None,
        )
        for run, step, free in zip(book.experiments, steps, runs, strict=True)
    ]


def free_errors(
    model: _core.Model, book: Logbook, workers: _core.Workers, noise: Noise | None = None
) -> list[FreeError]:
    """What the free runs of a model are off from each flight.

    Args:
        model: to be judged.
        book: with the flights.
        workers: how the work is carried out.
        noise: of the sensors, and disturbances, as identified; None: of sensors alone, guessed from each flight.
    """
    runs, limits = book.experiments, book.setup.limits
    if not book.setup.in_scales:
        whole = closed_loop([model], book.selected, workers)[0].tolist()
        return [
            FreeError(error, run.frozen, run.trajectory.steps) for run, error in zip(runs, whole, strict=True)
        ]
    lengths = [length_of(model, run, limits, workers, noise) for run in runs]
    return [
        _free_error(model, run, length, limits, workers) for run, length in zip(runs, lengths, strict=True)
    ]


def whole_error(model: _core.Model, run: Experiment, setup: Setup, workers: _core.Workers) -> float:
    """Error of a model's free run of a whole flight; infinite where it diverges.

    Args:
        model: to be judged.
        run: the flight.
        setup: of the campaign.
        workers: how the work is carried out.
    """
    if setup.in_scales:
        return _free_error(model, run, run.trajectory.steps, setup.limits, workers).error
    alone = with_run(setup.none_selected(), run.replayed, run.trajectory)
    return float(closed_loop([model], alone, workers)[0, 0])


def _free_error(
    model: _core.Model, run: Experiment, length: int, limits: Limits, workers: _core.Workers
) -> FreeError:
    """Of a free run in pieces of a length, in units of the states' scales."""
    missed, lasted = missed_of(model, run, length, limits, workers)
    still = frozen_of(run, length, limits.signals)
    return FreeError(float(missed.mean()) if lasted else np.inf, float(still.mean()), length)


def _one_step_errors(model: _core.Model, book: Logbook, workers: _core.Workers) -> Sequence[float]:
    """Mean squares of what predictions one step ahead are off, of each run; infinite where one diverges."""
    if not book.setup.in_scales:
        errors: list[float] = open_loop([model], book.selected, workers)[0].tolist()
        return errors
    return [_one_step_error(model, run, book.setup.limits, workers) for run in book.experiments]


def _one_step_error(model: _core.Model, run: Experiment, limits: Limits, workers: _core.Workers) -> float:
    states = states_read(model, run.trajectory.states, limits.signals)
    sent = Replay(limits.signals, states[0], run.trajectory.commands)
    stepwise = in_pieces(sent, model, run.trajectory.states, 1)
    found = drawn_runs(model, stepwise, limits, workers=workers)
    missed = squares(np.asarray(found.states[0])[1:], states[1:], limits.signals)
    return float(missed.mean()) if int(found.lasted[0]) == run.trajectory.steps else np.inf
