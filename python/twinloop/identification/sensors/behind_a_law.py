"""Whether a sensor is late once a law moves the states: what damps a rate within a period looks like an offset, too.

A search for offsets takes disturbances for all that drives a state, held over each period. Under a law the drive
changes within it: of a rate that is damped with a time constant T the trapezoid of its readings errs as if it were
early by dt²/(12 T). So an offset has to describe the readings more briefly behind a linear law as well, for which
nothing has to be selected.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.errors import engine_input
from twinloop.identification.records import Run, Stages, stages
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import RIDGE, floor_of
from twinloop.identification.sensors.offsets import PRICE, moved
from twinloop.law.actuation import Actuation
from twinloop.signals import Signals

ROUNDS = 3
"""Times that weights and noise are estimated in turn."""


def that_hold(
    runs: Sequence[Run], signals: Signals, chains: Sequence[Chain], offsets: Floats, workers: _core.Workers
) -> Floats:
    """The offsets that shorten the description of the readings behind a linear law by more than they cost.

    Args:
        runs: as recorded.
        signals: of the system.
        chains: all of them.
        offsets: that were found where nothing but disturbances drives the states (n_x,), s.
        workers: how the work is carried out.

    Returns:
        The same with 0 for those that do not; those of states that no output drives stay, for no law moves them (n_x,).
    """
    held = offsets
    for size in dict.fromkeys(offsets[offsets != 0.0].tolist()):
        late = set(np.flatnonzero(offsets == size).tolist())
        touched = [chain for chain in chains if late & set(chain.states)]
        if any(chain.output is None for chain in touched):
            continue
        without = np.where(offsets == size, 0.0, held)
        lengths = [
            _described(moved(runs, signals, tried), signals, touched, workers) for tried in (held, without)
        ]
        if not lengths[0] < lengths[1] - PRICE:
            held = without
    return held


def _described(
    runs: Sequence[Run], signals: Signals, chains: Sequence[Chain], workers: _core.Workers
) -> float:
    """−2 log of the likelihood of the readings of some chains behind a linear law with the most likely noise."""
    seen = stages(runs, signals, Actuation.direct(signals))
    return sum(_length(runs, seen, signals, chain, workers) for chain in chains)


def _length(
    runs: Sequence[Run], seen: Stages, signals: Signals, chain: Chain, workers: _core.Workers
) -> float:
    start, middle, end = (
        np.column_stack([np.ones(len(stage)), stage]) for stage in (seen.start, seen.middle, seen.end)
    )
    columns = list(chain.states)
    records = [
        (run.states[:, columns], run.weights[:, columns], start[rows], middle[rows], end[rows])
        for run, rows in zip(runs, seen.runs, strict=True)
    ]
    low, slow = floor_of(chain, signals.dt, float(seen.integration[columns[0]]))
    with engine_input():
        regression = _core.Regression(len(columns), signals.dt, chain.form, records)
        sensors = np.maximum(chain.rough, low)
        motion = (max(float(chain.rough[0]) / signals.dt, slow.white), slow.correlated, 10.0 * signals.dt)
        length = np.inf
        for _ in range(ROUNDS):
            solved = regression.gram(sensors, motion, workers).solve(list(range(start.shape[1])), RIDGE)
            if solved is None:
                break
            ((sensors, motion, length),) = _core.most_likely_noises(
                [(regression, solved[0], sensors, motion, low, slow)], workers
            )
    return float(length)
