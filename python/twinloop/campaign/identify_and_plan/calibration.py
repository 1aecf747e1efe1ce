"""Calibration: by how much a committee was too sure of the flights that it predicted, and what exact readings leave."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from math import isfinite, sqrt

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.law.flight import fly
from twinloop.law.twin import Twin
from twinloop.law.uncertainty import NINE_OF_TEN
from twinloop.test import Test
from twinloop.trajectory import Trajectory

FIRST = 2.0
"""Factor on a committee's spread before any of its predictions was flown."""
OF_PARTS = 1.5
"""The same where parts of the only flight sit in it: they know more of what that leaves open than later ones know."""
SMALLEST, LARGEST = 1.0, 30.0
LAST = 3
"""Flights that the factor is the median of."""
FIRST_MISS = 0.02
"""Share of a quality by which its prediction is taken to miss before any was flown."""
FIRST_SPREAD = 0.15
"""Smallest spread of a quality, as a share of it, before any prediction was flown. First flights show little of a law:
on the zoo's half that is tuned on, 11 of 12 second flights were within twice that of their predictions, 10 within a
fifth, and beside spreads of the committee alone, 4 % in the median, one was off by 147 of them."""
SPREAD_OF_MISSING = 0.35
"""The same where the twin misses the flight that it was learnt from: of 25 second flights of gains that had not flown,
on the zoo and on machines outside it, 17 were within that and 22 within twice that; with 0.15 it were 13 and 17."""
OF_A_MISS = 2.0
"""Spread of a prediction over the usual miss of earlier ones: of normal misses 87 % are then within two spreads."""
PROMISE = 0.02
"""Share of itself by which a predicted quality is below the best one flown if something is promised by it."""
NOTHING_KEPT = 0.5
"""Spread of a promise at most, as a share of it: within two of these nothing of it has come."""


def needed_factor(twin: Twin, test: Test | Replay, flown: Trajectory) -> float | None:
    """Factor on the members' spread with which nine of ten readings would have been inside the band.

    Args:
        twin: before it learnt the flight.
        test: that was flown.
        flown: the flight.

    Returns:
        The factor; None where the twin has no committee.
    """
    spread = twin.spread(twin.as_flown(test, flown))
    if spread is None or twin.noise is None:
        return None
    mean, variance = spread
    rows = min(len(mean), len(flown.states))
    if rows < 2:
        return LARGEST
    errors = twin.signals.difference(flown.states[1:rows], mean[1:rows])
    squares = np.square(errors / NINE_OF_TEN) - np.square(twin.noise.sensors)
    smallest = 1e-12 * np.square([state.scale for state in twin.signals.states])
    factors = np.sqrt(np.maximum(squares, 0.0) / np.maximum(variance[1:rows], smallest))
    return float(np.clip(np.quantile(factors, 0.9), SMALLEST, LARGEST))


def factor(needed: Sequence[float]) -> float:
    """Factor to be used for the next flight.

    Args:
        needed: factors that the flights so far would have needed, in their order.

    Returns:
        The median of the last ones, with the first guess among them while there are few.
    """
    return float(np.median([FIRST, *needed][-LAST:]))


def calibrated(
    spread: float, predicted: float, flights: Iterable[Experiment], misses_own: bool = False
) -> float:
    """Spread of a predicted quality, no smaller than what earlier predictions missed by, their bias included.

    Where a better flight is promised than any before, those tell most of which that was promised, too: what has flown
    once is easily foretold. Of a promise as large a share may be missing as of the earlier ones.

    Args:
        spread: standard deviation over members and noise.
        predicted: the quality.
        flights: recorded so far, with the predictions that they were flown on.
        misses_own: whether the twin misses flights that it was learnt from.

    Returns:
        The standard deviation of the prediction; `spread` where the prediction is infinite.
    """
    every = list(flights)
    found = beside_misses(spread, predicted, every, misses_own)
    best = min((quality for _, quality in _flown(every)), default=predicted)
    promise = _promised(predicted, best) if isfinite(predicted) else 0.0
    if not promise:
        return found
    unkept = _unkept(every)[-2:]
    if not unkept:
        return beside_misses(found, predicted, [], misses_own)
    return max(found, promise * min(NOTHING_KEPT, OF_A_MISS * sqrt(unkept[0] * unkept[-1])))


def beside_misses(
    spread: float, predicted: float, flights: Iterable[Experiment], misses_own: bool = False
) -> float:
    """The same, whatever is promised.

    Args:
        spread: standard deviation over members and noise.
        predicted: the quality.
        flights: recorded so far, with the predictions that they were flown on.
        misses_own: whether the twin misses flights that it was learnt from.
    """
    if not isfinite(predicted):
        return spread
    known = misses(flights)
    first = SPREAD_OF_MISSING if misses_own else FIRST_SPREAD
    share = OF_A_MISS * of_late(known) if known else first
    return max(spread, share * abs(predicted))


def held_to(predicted: float, spread: float) -> float:
    """The spread within which a flight shows that a twin foretells: what first flights leave open is no merit of it.

    Args:
        predicted: the quality.
        spread: that was said of it.
    """
    assumed = spread in (FIRST_SPREAD * abs(predicted), SPREAD_OF_MISSING * abs(predicted))
    return OF_A_MISS * FIRST_MISS * abs(predicted) if assumed else spread


def misses(flights: Iterable[Experiment]) -> list[float]:
    """Share of its quality by which each prediction that was flown has missed.

    Args:
        flights: recorded so far, with the predictions that they were flown on.
    """
    return [
        abs(predicted - quality) / abs(quality)
        for predicted, quality in _flown(flights)
        if quality and predicted is not None
    ]


def _flown(flights: Iterable[Experiment]) -> list[tuple[float | None, float]]:
    """What was predicted of each test that was flown, None where nothing was, and its quality."""
    return [
        (predicted if predicted is not None and isfinite(predicted) else None, run.quality)
        for run in flights
        if run.test is not None and not run.off_start and run.quality is not None
        for predicted in (run.test.predicted,)
    ]


def _promised(predicted: float, best: float) -> float:
    """By how much a flight is predicted to be better than the best one so far; 0 where that is hardly anything."""
    better = best - predicted
    return better if better > PROMISE * abs(predicted) else 0.0


def _unkept(flights: Sequence[Experiment]) -> list[float]:
    """Share of each promise so far by which its flight has missed, 1 at most."""
    best, found = float("inf"), []
    for predicted, quality in _flown(flights):
        if isfinite(best) and predicted is not None and (promise := _promised(predicted, best)):
            found.append(min(1.0, abs(predicted - quality) / promise))
        best = min(best, quality)
    return found


def missed(flights: Iterable[Experiment]) -> float:
    """Share of a quality by which predictions have missed it of late.

    Args:
        flights: recorded so far, with the predictions that they were flown on.
    """
    return of_late(misses(flights))


def of_late(shares: Sequence[float]) -> float:
    """Of misses in their order the usual one by now.

    Args:
        shares: of the quality of each flight.
    """
    # Predictions get better from flight to flight: the last two tell, and the geometric mean follows them down.
    before, last = [FIRST_MISS, FIRST_MISS, *shares][-2:]
    return sqrt(before * last)


def residuals_of_flights(model: _core.Model, flights: Iterable[Experiment], limits: Limits) -> Floats:
    """What free runs of a model leave of flights that it was learnt from.

    From one reading to the next, exact readings leave their own rounding; over a flight, that of the twin adds up, and
    the more the wilder the flight is. What counts is what is left of the one in the middle.

    Args:
        model: that follows the flights to the end.
        flights: at least one.
        limits: where a simulated run counts as diverged.

    Returns:
        Standard deviations (n_x,) of normal numbers, nine of ten of which would be as small as nine of ten errors of a
        flight, median over flights.
    """
    quantiles = []
    for flight in flights:
        states = flight.trajectory.states
        test = dataclasses.replace(flight.replayed, initial_state=model.states_of(states[:1])[0])
        free = fly(model, test, limits=limits).states
        rows = min(len(states), len(free))
        errors = test.signals.difference(states[:rows], free[:rows])
        quantiles.append(np.quantile(np.abs(errors), 0.9, axis=0))
    return np.asarray(np.median(quantiles, axis=0) / NINE_OF_TEN, dtype=np.float64)
