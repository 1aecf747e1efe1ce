"""Replaying: models held against flights that were made, those without a controller in pieces where they must be."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats, Integers
from twinloop.campaign.history import Experiment
from twinloop.identification.records import Run, guessed_noise
from twinloop.law.accuracy import squares
from twinloop.law.beginning import start_of
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise
from twinloop.law.pieces import held, in_pieces, judged_length
from twinloop.signals import Signals
from twinloop.test import Test


def lengths_of(
    model: _core.Model,
    flights: Sequence[Experiment],
    limits: Limits,
    workers: _core.Workers,
    noise: Noise | None = None,
) -> Integers:
    """Steps of the pieces in which a model is held against flights (N,).

    Args:
        model: to be judged.
        flights: N of them.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
        noise: of the sensors, and disturbances, as identified; None: of sensors alone, guessed from each flight.
    """
    return np.array([length_of(model, flight, limits, workers, noise) for flight in flights], dtype=np.int64)


def length_of(
    model: _core.Model,
    flight: Experiment,
    limits: Limits,
    workers: _core.Workers,
    noise: Noise | None = None,
) -> int:
    """Steps of the pieces in which a model is held against a flight: all, if its controller flies in the free run too.

    Args:
        model: to be judged.
        flight: that was made.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
        noise: of the sensors, and disturbances, as identified; None: of sensors alone, guessed from each flight.
    """
    flown = flight.trajectory
    if flight.test is not None:
        return flown.steps
    if noise is None:
        scales = np.array([state.scale for state in limits.signals.states])
        run = Run.of(flown.states, flown.commands).continued(limits.signals)
        noise = Noise.of_sensors(np.sqrt(guessed_noise([run], scales)))
    return judged_length(model, flown, noise, limits, workers)


def as_flown(
    model: _core.Model,
    flight: Experiment,
    length: int,
    limits: Limits,
    workers: _core.Workers | None = None,
) -> Test | Replay:
    """What a model flies to be held against a flight.

    Args:
        model: that is flown.
        flight: that was made.
        length: steps of the pieces in which it is followed.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    flown = whole(model, flight, limits, workers)
    return in_pieces(flown, model, flight.trajectory.states, length) if isinstance(flown, Replay) else flown


def whole(
    model: _core.Model, flight: Experiment, limits: Limits, workers: _core.Workers | None = None
) -> Test | Replay:
    """What was flown of a flight, from where it began.

    Args:
        model: that is to fly it.
        flight: that was made.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    run = flight.trajectory
    if isinstance(flight.replayed, Replay):
        start = start_of(model, run.states, run.commands, limits, workers)
    else:
        start = model.states_of(run.states[:1])[0]
    return cut(flight.replayed, start, run.steps)


def missed_by(
    model: _core.Model, flown: Test | Replay, read: Floats, limits: Limits, workers: _core.Workers
) -> tuple[Floats, int]:
    """Squares of what a free run misses of the readings after its start (n, n_x), and how many steps it lasts.

    They are in units of the states' scales.

    Args:
        model: that is flown.
        flown: from where, and under which controller or commands.
        read: of the flight (n, n_x).
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    runs = drawn_runs(model, flown, limits, workers=workers)
    return squares(np.asarray(runs.read[0])[1:], read, limits.signals), int(runs.lasted[0])


def missed_of(
    model: _core.Model, flight: Experiment, length: int, limits: Limits, workers: _core.Workers
) -> tuple[Floats, bool]:
    """Squares of what a free run misses of a flight (n, n_x), as by `missed_by`, and whether it lasts as long.

    Args:
        model: that is flown.
        flight: that was made.
        length: steps of the pieces in which it is followed.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    flown = as_flown(model, flight, length, limits, workers)
    missed, lasted = missed_by(model, flown, flight.trajectory.states[1:], limits, workers)
    return missed, lasted == flight.trajectory.steps


def frozen_of(flight: Experiment, length: int, signals: Signals) -> Floats:
    """The same of a model that never moves from where each piece of a flight begins (n, n_x).

    Args:
        flight: that was made.
        length: steps of the pieces.
        signals: of the system.
    """
    states = flight.trajectory.states
    return squares(states[1:], held(states, length), signals)


def cut(test: Test | Replay, start: Floats, steps: int) -> Test | Replay:
    """The first steps of what was flown, from a state."""
    if isinstance(test, Replay):
        anchors = None if test.anchors is None else test.anchors[: steps + 1]
        return dataclasses.replace(test, initial_state=start, commands=test.commands[:steps], anchors=anchors)
    target = test.target_state if test.target_state.ndim == 1 else test.target_state[: steps + 1]
    excitation = None if test.excitation is None else test.excitation[:steps]
    return dataclasses.replace(
        test, initial_state=start, target_state=target, steps=steps, excitation=excitation
    )
