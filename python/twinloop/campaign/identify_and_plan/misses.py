"""Misses: what a twin, flown by itself, is off from the flights that it was learnt from, beyond what disturbed them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats, Integers
from twinloop._ground.streams import Unit
from twinloop.campaign.data.sent import in_pulses
from twinloop.campaign.history import Cause, Experiment
from twinloop.campaign.identify_and_plan.following import Following
from twinloop.campaign.replaying import as_flown, frozen_of, lengths_of, missed_of
from twinloop.law.accuracy import squares
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise
from twinloop.law.reports import reports_of
from twinloop.test import Test

DRAWS = 8
"""Of noise and disturbances, by which it is said how far these take a flight."""
TIMES = 3.0
"""Times further from a flight than these that a free run is no more explained by them."""
FREE_RUN = "free-run"
"""Code of the remark that says that a twin misses its own flights."""
RELEVANT = 0.03
"""Misses below this share of how far a flight went do not matter."""

SUSPECT = 0.1
"""The same of misses that only a white disturbance explains which may be a model error: most laws lack a trace."""


@dataclass(frozen=True)
class Miss:
    """A state that the twin, flown by itself, misses by more than is explained; root mean squares.

    Args:
        state: its number.
        flights: places of those on which it is missed so, the one on which it is missed most first.
        share: of how far the state went, on the flight where this is most; infinite where the twin diverges.
        times: what noise and disturbances explain, on the flight where this is most; infinite where the twin diverges.
        undecided: whether it would be explained if all were disturbances that are not told from a model error.
    """

    state: int
    flights: tuple[int, ...]
    share: float
    times: float
    undecided: bool

    @property
    def diverges(self) -> bool:
        """Whether the twin does not last as long as one of the flights."""
        return math.isinf(self.share) and math.isinf(self.times)


def misses_of(
    model: _core.Model,
    flights: Sequence[Experiment],
    noise: Noise,
    causes: Mapping[int, Cause],
    unit: Unit,
    limits: Limits,
    workers: _core.Workers,
    suspects: Sequence[int] = (),
) -> list[Miss]:
    """States that a model misses, in order; none on a flight whose commands were sent in pulses.

    Only what is known to come from outside explains anything: a disturbance that may as well be a model error
    would explain whatever the law is wrong about.

    Args:
        model: that is flown.
        flights: N of them, at least one.
        noise: of the sensors, and disturbances.
        causes: of its correlated disturbances, by the state that each drives.
        unit: of which the draws are a part.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
        suspects: states that are stirred by a white disturbance which may be a model error.
    """
    lengths = lengths_of(model, flights, limits, workers, noise)
    off, frozen = of_each_state(model, lengths, flights, limits, workers)
    steered = np.array([[run.test is not None] for run in flights])

    def beyond(part: int, estimated: Noise, *causes_out: Cause) -> Floats:
        known = estimated.without(_caused(causes, *causes_out))
        expected = expected_misses(model, lengths, flights, known, unit.part(part), limits, workers)
        return unexplained(off, frozen, expected, steered)

    missed = beyond(0, noise, "law", "undecided")
    at_least = beyond(1, noise, "law") if "undecided" in causes.values() and missed.any() else missed
    large = (missed == 0.0) & (off > SUSPECT * SUSPECT * frozen)
    if suspects and large.any():
        missed = np.where(large, beyond(2, noise.calmer(suspects), "law", "undecided"), missed)
    pulsed = in_pulses([run for run, row in zip(flights, missed, strict=True) if row.any()])
    judged = [j for j, run in enumerate(flights) if run.number not in pulsed]
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(missed > 0.0, np.sqrt(off / frozen), 0.0)[judged]
    missed, at_least = missed[judged], at_least[judged]
    return [
        Miss(
            int(state),
            _most_first(missed[:, state], judged),
            float(shares[:, state].max()),
            float(missed[:, state].max()),
            not at_least[:, state].any(),
        )
        for state in np.flatnonzero((missed > 0.0).any(axis=0))
    ]


def _most_first(missed: Floats, places: Sequence[int]) -> tuple[int, ...]:
    """Places of the flights on which something is missed, by how much."""
    order = np.argsort(-missed, kind="stable").tolist()
    return tuple(places[i] for i in order if missed[i] > 0.0)


def misses_any(
    model: _core.Model,
    followed: Following,
    flights: Sequence[Experiment],
    noise: Noise,
    causes: Mapping[int, Cause],
    unit: Unit,
    limits: Limits,
    workers: _core.Workers,
) -> bool:
    """Whether a model misses a flight, over all states, by more than noise and whatever may disturb explains.

    Args:
        model: that is flown, the first of those that were followed.
        followed: free runs.
        flights: N of them, at least one.
        noise: of the sensors, and disturbances.
        causes: of its correlated disturbances; a model error for certain explains nothing.
        unit: of which the draws are a part.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    known = noise.without(_caused(causes, "law"))
    expected = expected_misses(model, followed.lengths, flights, known, unit, limits, workers)
    steered = np.array([run.test is not None for run in flights])
    missed = unexplained(followed.free[0], followed.frozen, expected.mean(axis=1), steered)
    off = [run for run, times in zip(flights, missed, strict=True) if times]
    return len(in_pulses(off)) < len(off)


def expected_misses(
    model: _core.Model,
    lengths: Integers,
    flights: Sequence[Experiment],
    noise: Noise,
    unit: Unit,
    limits: Limits,
    workers: _core.Workers,
) -> Floats:
    """How far noise and disturbances alone take flights from a model's free run.

    Args:
        model: that is flown.
        lengths: steps of the pieces in which each flight is followed (N,).
        flights: N of them, at least one.
        noise: of the sensors, and disturbances.
        unit: of which the draws are a part.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        Mean squares over draws and steps, in units of the states' scales (N, n_x); infinite where a run diverges, in
        which the free run may be anywhere.
    """
    found = np.empty((len(flights), limits.signals.n_x))
    reports = reports_of(model, limits.signals.n_x)
    for j, flight in enumerate(flights):
        steps = flight.trajectory.steps
        seen, moved = noise.drawn(DRAWS, steps, unit.part(j).stream("repeats"), reports)
        runs = drawn_runs(
            model,
            _begun_as_read(as_flown(model, flight, lengths[j], limits, workers)),
            limits,
            noise=np.concatenate([np.zeros((1, *seen.shape[1:])), seen]),
            disturbance=np.concatenate([np.zeros((1, *moved.shape[1:])), moved]),
            workers=workers,
        )
        lasted = bool((runs.lasted == steps).all())
        # What is measured where a piece begins is its anchor; what a free run misses there is what it came to before.
        read = np.asarray(runs.read)
        with np.errstate(invalid="ignore"):
            off = squares(read[1:] + seen, read[0], limits.signals).mean(axis=(0, 1))
        found[j] = off if lasted else np.inf
    return found


def _begun_as_read(flown: Test | Replay) -> Test | Replay:
    """The same, where a replay begins at a reading, with the noise of that: no controller corrects it later on."""
    if not isinstance(flown, Replay) or flown.anchors is not None:
        return flown
    anchors = np.full((flown.steps + 1, len(flown.initial_state)), np.nan)
    anchors[0] = flown.initial_state
    return replace(flown, anchors=anchors)


def unexplained(free: Floats, frozen: Floats, expected: Floats, steered: NDArray[np.bool_]) -> Floats:
    """Times further from its flights than noise and disturbances explain that a free run is, where that matters.

    Args:
        free: mean squares of the free run, of flights or of each state on them, infinite where it diverges.
        frozen: of the model that never moves, alike.
        expected: of noise and disturbances, alike, infinite where these make it diverge.
        steered: whether a flight had its controller, who kept it from diverging. Under recorded commands alone any
            free run of an unstable system may.

    Returns:
        Ratios of roots, alike; 0 where the free run does as can be expected, or is within 3 % of how far the flight
        went.
    """
    lost = steered & np.isinf(free)
    matters = (free > RELEVANT * RELEVANT * frozen) & (free > TIMES * TIMES * expected)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(lost, np.inf, np.where(matters, np.sqrt(free / expected), 0.0))


def _caused(causes: Mapping[int, Cause], *by: Cause) -> list[int]:
    """States whose correlated disturbance has one of some causes."""
    return [state for state, found in causes.items() if found in by]


def of_each_state(
    model: _core.Model,
    lengths: Integers,
    flights: Sequence[Experiment],
    limits: Limits,
    workers: _core.Workers,
) -> tuple[Floats, Floats]:
    """What a model's free runs miss of each state, and what the model that never moves misses.

    Args:
        model: that is flown.
        lengths: steps of the pieces in which each flight is followed (N,).
        flights: N of them, at least one.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        Mean squares in units of the states' scales (N, n_x), twice; the first infinite where a free run diverges.
    """
    off, frozen = np.empty((2, len(flights), limits.signals.n_x))
    for j, flight in enumerate(flights):
        missed, lasted = missed_of(model, flight, lengths[j], limits, workers)
        off[j] = missed.mean(axis=0) if lasted else np.inf
        frozen[j] = frozen_of(flight, lengths[j], limits.signals).mean(axis=0)
    return off, frozen
