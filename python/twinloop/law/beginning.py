"""Beginning: the state in which a record, or a piece of it, begins for a model.

It is as it was read, except for rates that are computed of readings: these lie half a period behind, and have the
noise of a difference over a period. Within a record such a rate is the slope of what it is computed of; at its start,
that with which the model follows the first readings best (steps of Gauss and Newton, one rate after the other).
"""

from __future__ import annotations

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats
from twinloop.law.flight import drawn_runs
from twinloop.law.reports import computed, reports_of, slopes_of
from twinloop.signals import Signals

FIRST = 12
"""Readings after the first by which the rate at the start is found."""
TURNS = 4
"""Steps for each rate."""
BESIDE = 1e-3
"""Share of its scale by which a rate is varied for the slopes of the readings."""
TINY = 1e-300
"""So that what does not show is not divided by nothing."""


def states_read(model: _core.Model, readings: Floats, signals: Signals) -> Floats:
    """The states of a record (n + 1, n_x), as far as its readings tell.

    Args:
        model: that they are states of.
        readings: of the record (n + 1, n_x).
        signals: of the system.
    """
    states: Floats = model.states_of(np.ascontiguousarray(readings))
    for i, rate in slopes_of(states, reports_of(model, signals.n_x), signals).items():
        states[:, i] = rate
    return states


def start_of(
    model: _core.Model,
    readings: Floats,
    commands: Floats,
    limits: Limits,
    workers: _core.Workers | None = None,
) -> Floats:
    """The state at the start of a record without a controller (n_x,).

    Args:
        model: that is to fly it.
        readings: of the record (n + 1, n_x), periodic states continued.
        commands: as sent (n, n_u).
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    signals = limits.signals
    rates = list(computed(reports_of(model, signals.n_x)))
    start: Floats = model.states_of(readings[:1])[0]
    steps = min(FIRST, len(commands))
    if not rates or not steps:
        return start
    begun = states_read(model, readings, signals)[0]
    scales = np.array([state.scale for state in signals.states])
    others = [i for i in range(signals.n_x) if i not in rates]

    def missed(state: Floats) -> Floats | None:
        run = drawn_runs(model, Replay(signals, state, commands[:steps]), limits, workers=workers)
        if int(run.lasted[0]) < steps:
            return None
        off = signals.difference(np.asarray(run.read[0])[1:], readings[1 : steps + 1]) / scales
        found: Floats = off[:, others].ravel()
        return found

    best: Floats = begun
    left = missed(begun)
    for i in rates * TURNS:
        beside = best.copy()
        beside[i] += BESIDE * scales[i]
        moved = missed(beside)
        if left is None or moved is None:
            break
        by = (moved - left) / BESIDE
        tried = best.copy()
        tried[i] -= scales[i] * float((by * left).sum()) / max(float((by * by).sum()), TINY)
        after = missed(tried)
        if after is not None and float((after * after).sum()) < float((left * left).sum()):
            best, left = tried, after
    return best
