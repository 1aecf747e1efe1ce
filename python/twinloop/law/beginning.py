"""Beginning: the state in which a record, or a piece of it, begins for a model.

Within a record it is as it was read, except for rates that are computed of readings: these lie half a period behind,
and have the noise of a difference over a period. Such a rate is the slope of what it is computed of. At the start of a
record the noise of a single reading would be all that a free run shows of it, where nothing corrects it later on. So it
is the state with which the model follows the first readings best, the very first among them, each by its noise (steps
of Gauss and Newton; of computed rates one after the other).
"""

from __future__ import annotations

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import product
from twinloop.controllers.riccati import solve_linear
from twinloop.law.flight import drawn_runs
from twinloop.law.reports import computed, reports_of, slopes_of
from twinloop.signals import Signals

FIRST = 12
"""Readings after the first by which the rate at the start is found."""
TURNS = 4
"""Steps of Gauss and Newton, for each computed rate or for all states at once."""
BESIDE = 1e-3
"""Share of its scale by which a rate is varied for the slopes of the readings."""
EXACT = 1e-6
"""Least noise of a sensor, as a share of its state's scale, by which its readings count."""
SURE = 3.0
"""Standard deviations of its noise by which a first reading may be off."""
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
    if not steps:
        return start
    if not rates:
        return _smoothed(model, start, readings, commands[:steps], limits, workers)
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


def _smoothed(
    model: _core.Model,
    read: Floats,
    readings: Floats,
    commands: Floats,
    limits: Limits,
    workers: _core.Workers | None,
) -> Floats:
    """The state (n_x,) with which a model follows first readings best, with what was read of it among them.

    It is no further from what was read than noise explains: what a model is wrong about must not move it.

    Args:
        model: that follows.
        read: the state as it was read (n_x,).
        readings: of the whole record (n + 1, n_x), by which the noise of each is known.
        commands: as sent in the first steps.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    signals, steps = limits.signals, len(commands)
    noise = _noise(readings, np.array([state.scale for state in signals.states]))

    def missed(state: Floats) -> Floats | None:
        run = drawn_runs(model, Replay(signals, state, commands), limits, workers=workers)
        if int(run.lasted[0]) < steps:
            return None
        off = signals.difference(np.asarray(run.read[0])[1:], readings[1 : steps + 1]) / noise
        found: Floats = np.concatenate([off.ravel(), (state - read) / noise])
        return found

    best, left = read, missed(read)
    for _ in range(TURNS):
        beside = [missed(best + step) for step in np.diag(noise)]
        if left is None or any(each is None for each in beside):
            break
        slopes = np.stack([each - left for each in beside if each is not None], axis=1)
        step = solve_linear(product(slopes.T, slopes), product(slopes.T, left[:, np.newaxis]))
        if step is None:
            break
        tried = best - noise * step[:, 0]
        after = missed(tried)
        if after is None or not float((after * after).sum()) < float((left * left).sum()):
            break
        best, left = tried, after
    found: Floats = np.clip(best, read - SURE * noise, read + SURE * noise)
    return found


def _noise(readings: Floats, scales: Floats) -> Floats:
    """Standard deviation of each sensor (n_x,), by third differences, which leave little of a motion."""
    squared = np.square(np.diff(readings, n=3, axis=0)) if len(readings) > 3 else np.zeros((1, len(scales)))
    # The median of a squared normal number is 0.4549; a third difference has twenty times the variance.
    found: Floats = np.maximum(np.sqrt(np.nanmedian(squared, axis=0) / (0.4549 * 20.0)), EXACT * scales)
    return found
