"""Flights that a twin had not learnt, and what it made of them: the test that counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import two_digits
from twinloop.campaign.history import Experiment
from twinloop.campaign.setup import Setup
from twinloop.law.accuracy import squares
from twinloop.law.pieces import held
from twinloop.law.twin import Twin
from twinloop.objectives import normalised_error
from twinloop.trajectory import Trajectory, continued

LEFT = 0.1
"""Error on a flight that was not learnt, over that of a model that never moves, above which a twin is not believed."""


@dataclass(frozen=True, eq=False)
class Unseen:
    """A flight and the free run of the twin before it learnt this flight.

    Args:
        place: of the experiment among all, from 0.
        number: of the test; None for an attached run.
        learnt: number of experiments that the twin had learnt.
        flown: the flight.
        predicted: by the twin, from the start of the flight, under the test's own controller; with a band if the
            committee of that time is known.
        error: mean squared error over that of a model that never moves, in the pieces of `Twin.piece_of` for a run
            without a test; infinite if the free run diverged.
        rmse: of each state (n_x,), in its unit; infinite if the free run diverged.
        fit: FIT % of each state (n_x,); NaN if it never moved.
        inside: share of the readings inside the band; None without one.
        piece: steps after which the free run begins again at a reading; those of the flight where it never does.
    """

    place: int
    number: int | None
    learnt: int
    flown: Trajectory
    predicted: Trajectory
    error: float
    rmse: Floats
    fit: Floats
    inside: float | None
    piece: int

    @property
    def predicted_well(self) -> bool:
        """Whether the error is at most what is allowed."""
        return self.error <= LEFT

    @property
    def error_words(self) -> str:
        """The error beside what is allowed."""
        by = f"error {two_digits(self.error)}" if math.isfinite(self.error) else "it diverged"
        return f"{by}; at most {LEFT:g} is allowed"


@dataclass(frozen=True, eq=False)
class TwinBefore:
    """A twin that was known earlier.

    Args:
        learnt: number of the first experiments that it had learnt.
        twin: with a band if the committee of that time is known.
    """

    learnt: int
    twin: Twin


def unseen_flights(
    experiments: Sequence[Experiment], twins: Sequence[TwinBefore], setup: Setup
) -> tuple[Unseen, ...]:
    """Each flight beside the free run of the latest twin that had not learnt it.

    Args:
        experiments: in the order of `tell`.
        twins: that were known earlier, in any order.
        setup: of the campaign.

    Returns:
        One for each flight of which such a twin is known.
    """
    found = []
    for place, run in enumerate(experiments):
        known = [before for before in twins if before.learnt <= place]
        if known:
            found.append(_beside(place, run, max(known, key=lambda before: before.learnt), setup))
    return tuple(found)


def _beside(place: int, run: Experiment, before: TwinBefore, setup: Setup) -> Unseen:
    twin = before.twin
    predicted = twin.free_run(run.replayed, run.trajectory)
    rmse, fit, inside = followed(twin, run.trajectory, predicted)
    lasted = bool(np.isfinite(rmse).all())
    sizes = np.array([state.scale if setup.in_scales else 1.0 for state in setup.signals.states])
    missed = float(np.square(rmse / sizes).mean()) if lasted else float("inf")
    # Of whole flights as the campaign counts them.
    whole = missed if run.before is None else run.before
    piece = piece_of(twin, run)
    error = normalised_error(whole, run.frozen)
    if piece < run.trajectory.steps:
        error = normalised_error(missed, _frozen_in_pieces(twin, run.trajectory, piece))
    return Unseen(
        place, run.number, before.learnt, run.trajectory, predicted, error, rmse, fit, inside, piece
    )


def piece_of(twin: Twin, run: Experiment) -> int:
    """Steps after which the free run of a twin begins again at a reading; those of the flight where it never does.

    Args:
        twin: that is flown.
        run: the experiment; under a test's own controller it never does.
    """
    return run.trajectory.steps if run.test is not None else twin.piece_of(run.trajectory)


def _frozen_in_pieces(twin: Twin, flown: Trajectory, piece: int) -> float:
    """Error of the model that never moves from where each piece of a record begins."""
    return float(squares(flown.states[1:], held(flown.states, piece), twin.signals).mean())


def followed(twin: Twin, flown: Trajectory, predicted: Trajectory) -> tuple[Floats, Floats, float | None]:
    """How well a free run follows a flight.

    Args:
        twin: whose run it is.
        flown: the flight.
        predicted: the free run.

    Returns:
        RMSE (n_x,) and FIT % (n_x,) of each state over the readings after the first, infinite where the run is shorter
        than the flight; and the share of the readings inside its band, None without one.
    """
    signals = twin.signals
    read = continued(flown, signals, flown.states[0]).states[1:]
    rows = min(len(read), len(predicted.states) - 1)
    off = signals.difference(read[:rows], predicted.states[1 : rows + 1])
    around = np.square(read - read.mean(axis=0)).sum(axis=0)
    inside = None
    if predicted.band is not None and rows:
        low, high = predicted.band[:, 1 : rows + 1]
        middle = 0.5 * (low + high)
        within = np.abs(signals.difference(read[:rows], middle)) <= 0.5 * (high - low)
        # Readings of a flight that the twin did not live to see are outside.
        inside = float(within.sum() / read.size)
    if rows < len(read) or rows == 0:
        lost = np.full(signals.n_x, np.inf)
        return lost, -lost, inside
    squares = np.square(off).sum(axis=0)
    share = np.divide(squares, around, out=np.full_like(squares, np.nan), where=around > 0.0)
    return np.sqrt(squares / rows), 100.0 * (1.0 - np.sqrt(share)), inside
