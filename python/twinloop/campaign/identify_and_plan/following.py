"""Following: how well free runs of models follow the flights that were made, each state in units of its scale."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.errors import engine_input
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise
from twinloop.limits import Limits
from twinloop.replay import Replay
from twinloop.streams import Unit
from twinloop.test import Test

DRAWS = 8
"""Of noise and disturbances, by which it is said how far these take a flight."""
TIMES = 3.0
"""Times further from a flight than these that a free run is no more explained by them."""
PIECES = 5
"""Of a flight, each of which is followed from its own first reading where commands were sent in pulses."""
RELEVANT = 0.03
"""Misses below this share of how far a flight went do not matter."""


@dataclass(frozen=True, eq=False)
class Following:
    """Free runs of m models beside N flights.

    Args:
        free: mean squares over steps and states, in units of the states' scales (m, N); infinite where a run diverges.
        lasted: share of each flight that a run lasts (m, N).
        frozen: mean squares of the model that never moves (N,).
    """

    free: Floats
    lasted: Floats
    frozen: Floats

    def order(self) -> list[int]:
        """Models, the one that goes wrong least on its worst flight first; of the diverging, what lasts longest."""
        still = self.frozen == 0.0
        ratios = np.where(
            still, np.where(self.free == 0.0, 1.0, np.inf), self.free / np.where(still, 1.0, self.frozen)
        )
        numbers: list[int] = np.lexsort((-self.lasted.min(axis=1), ratios.max(axis=1))).tolist()
        return numbers


def following(
    models: Sequence[_core.Model],
    flights: Sequence[Experiment],
    limits: Limits,
    workers: _core.Workers,
) -> Following:
    """Flies each model as the system was flown, from where each flight began to where its record ends.

    Args:
        models: m of them.
        flights: N of them, at least one.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        How well they follow.
    """
    free, lasted = np.empty((2, len(models), len(flights)))
    frozen = np.empty(len(flights))
    for j, flight in enumerate(flights):
        states, steps, signals = flight.trajectory.states, flight.trajectory.steps, limits.signals
        scales = np.array([state.scale for state in signals.states])
        frozen[j] = np.square(signals.difference(states[1:], states[0]) / scales).mean()
        for i, model in enumerate(models):
            with engine_input():
                start = model.states_of(states[:1])[0]
            runs = drawn_runs(model, _cut(flight.replayed, start, steps), limits, workers=workers)
            lasted[i, j] = runs.lasted[0] / steps
            misses = np.square(signals.difference(runs.read[0, 1:], states[1:]) / scales)
            free[i, j] = misses.mean() if lasted[i, j] == 1.0 else np.inf
    return Following(free, lasted, frozen)


def in_pieces(
    model: _core.Model, flights: Sequence[Experiment], limits: Limits, workers: _core.Workers
) -> Floats:
    """How well a model follows flights under the commands that were sent, begun again at the reading of each piece.

    An unstable system leaves any free run under recorded commands after a while, however right its model is.

    Args:
        model: that is flown.
        flights: N of them, at least one.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        Mean squares over those of a model that never moves from where a piece begins (N,), infinite where one diverges.
    """
    signals, found = limits.signals, np.empty(len(flights))
    scales = np.array([state.scale for state in signals.states])
    for j, flight in enumerate(flights):
        states, commands = flight.trajectory.states, flight.trajectory.commands
        length, missed, moved = -(-len(commands) // PIECES), 0.0, 0.0
        for first in range(0, len(commands), length):
            piece = commands[first : first + length]
            read = states[first + 1 : first + 1 + len(piece)]
            with engine_input():
                start = model.states_of(states[first : first + 1])[0]
            runs = drawn_runs(model, Replay(signals, start, piece), limits, workers=workers)
            off = np.square(signals.difference(runs.read[0, 1:], read) / scales).sum()
            missed += float(off) if runs.lasted[0] == len(piece) else np.inf
            moved += float(np.square(signals.difference(read, states[first]) / scales).sum())
        found[j] = missed / moved if moved > 0.0 else np.inf
    return found


def expected_misses(
    model: _core.Model,
    flights: Sequence[Experiment],
    noise: Noise,
    unit: Unit,
    limits: Limits,
    workers: _core.Workers,
) -> Floats:
    """How far noise and disturbances alone take flights from a model's free run.

    Args:
        model: that is flown.
        flights: N of them, at least one.
        noise: of the sensors, and disturbances.
        unit: of which the draws are a part.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        Mean squares over draws, steps and states, in units of the states' scales (N,), as `Following.free`; infinite
        where a run diverges, in which the free run may be anywhere.
    """
    scales = np.array([state.scale for state in limits.signals.states])
    found = np.empty(len(flights))
    for j, flight in enumerate(flights):
        steps = flight.trajectory.steps
        seen, moved = noise.drawn(DRAWS, steps, unit.part(j).stream("repeats"))
        with engine_input():
            start = model.states_of(flight.trajectory.states[:1])[0]
        runs = drawn_runs(
            model,
            _cut(flight.replayed, start, steps),
            limits,
            noise=np.concatenate([np.zeros((1, *seen.shape[1:])), seen]),
            disturbance=np.concatenate([np.zeros((1, *moved.shape[1:])), moved]),
            workers=workers,
        )
        lasted = bool((runs.lasted == steps).all())
        with np.errstate(invalid="ignore"):
            off = np.square(limits.signals.difference(runs.measured[1:], runs.read[0]) / scales).mean()
        found[j] = off if lasted else np.inf
    return found


def unexplained(free: Floats, frozen: Floats, expected: Floats) -> Floats:
    """Times further from its flights than noise and disturbances explain that a free run is, where that matters.

    Args:
        free: mean squares of the free run (N,), infinite where it diverges.
        frozen: of the model that never moves (N,).
        expected: of noise and disturbances (N,), infinite where these make it diverge.

    Returns:
        Ratios of roots (N,); 0 where the free run does as can be expected, or is within 3 % of how far the flight went.
    """
    matters = (free > RELEVANT * RELEVANT * frozen) & (free > TIMES * TIMES * expected)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(matters, np.sqrt(free / expected), 0.0)


def _cut(test: Test | Replay, start: Floats, steps: int) -> Test | Replay:
    """The first steps of what was flown, from a state."""
    if isinstance(test, Replay):
        return dataclasses.replace(test, initial_state=start, commands=test.commands[:steps])
    target = test.target_state if test.target_state.ndim == 1 else test.target_state[: steps + 1]
    excitation = None if test.excitation is None else test.excitation[:steps]
    return dataclasses.replace(
        test, initial_state=start, target_state=target, steps=steps, excitation=excitation
    )
