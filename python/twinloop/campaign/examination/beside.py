"""Flights beside the free runs of the twin of today, which has learnt them: what is left, and where readings lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.examination.unseen import followed, piece_of
from twinloop.campaign.history import Experiment
from twinloop.law.twin import Twin
from twinloop.trajectory import Trajectory, continued


@dataclass(frozen=True, eq=False)
class Beside:
    """A flight and the free run of the twin from its start, under the test's own controller.

    Args:
        run: the experiment.
        flown: its record, in which states that are periodic do not jump.
        simulated: the free run, cut where it diverges; with a band if the twin has a committee.
        places: of the readings in the band, as long as the free run lasts (rows, n_x): 0 its middle, ±1 its ends; None
            without a band.
        inside: share of the readings after the first inside the band; None without one.
        piece: steps after which the free run begins again at a reading; those of the flight where it never does.
    """

    run: Experiment
    flown: Trajectory
    simulated: Trajectory
    places: Floats | None
    inside: float | None
    piece: int


def beside(twin: Twin, run: Experiment) -> Beside:
    """A flight beside the free run of a twin.

    Args:
        twin: of today.
        run: the experiment.
    """
    simulated = twin.free_run(run.replayed, run.trajectory)
    flown = continued(run.trajectory, twin.signals, run.trajectory.states[0])
    _, _, inside = followed(twin, run.trajectory, simulated)
    return Beside(
        run, flown, simulated, _places(twin, run.trajectory, simulated), inside, piece_of(twin, run)
    )


def _places(twin: Twin, flown: Trajectory, simulated: Trajectory) -> Floats | None:
    if simulated.band is None:
        return None
    rows = min(len(flown.states), len(simulated.states))
    low, high = simulated.band[:, :rows]
    off = twin.signals.difference(flown.states[:rows], 0.5 * (low + high))
    return np.asarray(off / np.maximum(0.5 * (high - low), 1e-300))
