"""Following: how well free runs of models follow the flights that were made, each state in units of its scale."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
        numbers: list[int] = np.lexsort((-self.lasted.min(axis=1), self._ratios().max(axis=1))).tolist()
        return numbers

    def worst(self, model: int) -> float:
        """Of a model, on the flight that it misses most: its mean square over that of the model that never moves."""
        return float(self._ratios()[model].max())

    def _ratios(self) -> Floats:
        still = self.frozen == 0.0
        return np.where(
            still, np.where(self.free == 0.0, 1.0, np.inf), self.free / np.where(still, 1.0, self.frozen)
        )


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
        states, steps = flight.trajectory.states, flight.trajectory.steps
        frozen[j] = _squares(states[1:], states[0], limits).mean()
        for i, model in enumerate(models):
            flown = _cut(flight.replayed, _start(model, states[0]), steps)
            missed, length = _missed(model, flown, states[1:], limits, workers)
            lasted[i, j] = length / steps
            free[i, j] = missed.mean() if length == steps else np.inf
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
    found = np.empty(len(flights))
    for j, flight in enumerate(flights):
        states, commands = flight.trajectory.states, flight.trajectory.commands
        most, off, moved = -(-len(commands) // PIECES), 0.0, 0.0
        for first in range(0, len(commands), most):
            piece = commands[first : first + most]
            read = states[first + 1 : first + 1 + len(piece)]
            flown = Replay(limits.signals, _start(model, states[first]), piece)
            missed, length = _missed(model, flown, read, limits, workers)
            off += float(missed.sum()) if length == len(piece) else np.inf
            moved += float(_squares(read, states[first], limits).sum())
        found[j] = off / moved if moved > 0.0 else np.inf
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
    found = np.empty(len(flights))
    for j, flight in enumerate(flights):
        steps = flight.trajectory.steps
        seen, moved = noise.drawn(DRAWS, steps, unit.part(j).stream("repeats"))
        runs = drawn_runs(
            model,
            _cut(flight.replayed, _start(model, flight.trajectory.states[0]), steps),
            limits,
            noise=np.concatenate([np.zeros((1, *seen.shape[1:])), seen]),
            disturbance=np.concatenate([np.zeros((1, *moved.shape[1:])), moved]),
            workers=workers,
        )
        lasted = bool((runs.lasted == steps).all())
        with np.errstate(invalid="ignore"):
            off = _squares(runs.measured[1:], runs.read[0], limits).mean()
        found[j] = off if lasted else np.inf
    return found


def unexplained(free: Floats, frozen: Floats, expected: Floats, steered: NDArray[np.bool_]) -> Floats:
    """Times further from its flights than noise and disturbances explain that a free run is, where that matters.

    Args:
        free: mean squares of the free run (N,), infinite where it diverges.
        frozen: of the model that never moves (N,).
        expected: of noise and disturbances (N,), infinite where these make it diverge.
        steered: whether a flight had its controller, who kept it from diverging (N,). Under recorded commands alone
            any free run of an unstable system may.

    Returns:
        Ratios of roots (N,); 0 where the free run does as can be expected, or is within 3 % of how far the flight went.
    """
    lost = steered & np.isinf(free)
    matters = (free > RELEVANT * RELEVANT * frozen) & (free > TIMES * TIMES * expected)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(lost, np.inf, np.where(matters, np.sqrt(free / expected), 0.0))


def _missed(
    model: _core.Model, flown: Test | Replay, read: Floats, limits: Limits, workers: _core.Workers
) -> tuple[Floats, int]:
    """Squares of what a free run misses of the n readings after its start (n, n_x), and how many steps it lasts."""
    runs = drawn_runs(model, flown, limits, workers=workers)
    return _squares(runs.read[0, 1:], read, limits), int(runs.lasted[0])


def _squares(states: Floats, others: Floats, limits: Limits) -> Floats:
    """Squares of differences between states, in units of their scales (…, n_x)."""
    scales = np.array([state.scale for state in limits.signals.states])
    squares: Floats = np.square(limits.signals.difference(states, others) / scales)
    return squares


def _start(model: _core.Model, reading: Floats) -> Floats:
    """The state of a model that is read so (n_x,)."""
    with engine_input():
        start: Floats = model.states_of(reading[np.newaxis])[0]
    return start


def _cut(test: Test | Replay, start: Floats, steps: int) -> Test | Replay:
    """The first steps of what was flown, from a state."""
    if isinstance(test, Replay):
        return dataclasses.replace(test, initial_state=start, commands=test.commands[:steps])
    target = test.target_state if test.target_state.ndim == 1 else test.target_state[: steps + 1]
    excitation = None if test.excitation is None else test.excitation[:steps]
    return dataclasses.replace(
        test, initial_state=start, target_state=target, steps=steps, excitation=excitation
    )
