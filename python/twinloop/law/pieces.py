"""Pieces: how far a flight can be followed without its controller, however right a model is.

Nothing corrects a replay of recorded commands. On a system that is unstable by itself it leaves the flight, whatever
the model: what the first reading is off grows along the record. So such a flight is judged in pieces, each begun at its
own reading, while the memory of lags, delays and hidden states goes on. A piece is as long as possible, so long as a
deviation of the size of the sensor's noise, grown by the model's own slopes along the record, stays small beside what
the system itself moves in a piece. Where noise leaves no such length, it is the one at which the two are furthest
apart. A model that grows the deviation faster than the system moves has no length at all, and follows nothing: shorter
pieces would make no model right.

Nothing corrects what disturbs a system on a replay either, such as gusts. So known disturbances add to the deviation in
each period, and a piece may then be as short as any that foresees something, if they leave most of the motion there.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import exp
from twinloop.law.accuracy import left, squares
from twinloop.law.beginning import start_of, states_read
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise, reaches
from twinloop.trajectory import Trajectory, continued

SHARE = 0.02
"""Of how far a state moves: by so much a right model is taken to be off from where a piece begins, if noise is less."""
SMALL = 0.02
"""Of what the system moves in a piece, mean squares, that such a deviation may have grown to, if noise allows it."""
MOST = 0.25
"""The same in any case: above it no prediction that is long enough to be seen could be right."""
LARGE = 100.0
"""Mean square of a deviation, in units of how far states move, after which it is followed no further."""
LEAST = 10
"""Steps of a piece: one that foresees less foresees nothing."""
Deviations = tuple[Floats, Floats, Floats]
"""How deviations go on: their first covariance (m, m), what each period does to it (n, m, m), what it adds (m,). They
are those of the states, in units of how far these move, and the correlated disturbances behind them."""
STARTS = 64
"""Readings, spread over the flight, from which the growth is followed."""


def in_pieces(replay: Replay, model: _core.Model, readings: Floats, length: int) -> Replay:
    """A replay that begins again at the reading of each piece.

    Args:
        replay: of a flight (n steps).
        model: that is to fly it.
        readings: of the flight (n + 1, n_x).
        length: steps of a piece.
    """
    if length >= replay.steps:
        return replay
    anchors = np.full((replay.steps + 1, readings.shape[1]), np.nan)
    anchors[:-1:length] = states_read(model, readings, replay.signals)[:-1:length]
    anchors[0] = replay.initial_state
    return dataclasses.replace(replay, anchors=anchors)


def held(readings: Floats, length: int) -> Floats:
    """What the model that never moves makes of readings after the first, held from where a piece begins (n, n_x)."""
    return np.repeat(readings[:-1:length], length, axis=0)[: len(readings) - 1]


def judged_length(
    model: _core.Model,
    flight: Trajectory,
    noise: Noise,
    limits: Limits,
    workers: _core.Workers | None = None,
) -> int:
    """Steps of the pieces in which a model is held against a flight without its controller.

    Args:
        model: to be judged.
        flight: of at least one step.
        noise: of the sensors, and disturbances.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        All steps, if a free run follows the whole flight, or could be expected to, or if there is no useful length at
        which the model could be followed.
    """
    signals = limits.signals
    scales = np.array([state.scale for state in signals.states])
    readings = continued(flight, signals, flight.states[0]).states
    start = start_of(model, readings, flight.commands, limits, workers)
    whole = Replay(signals, start, flight.commands)
    runs = drawn_runs(model, whole, limits, workers=workers)
    free, frozen = (
        float(squares(readings[1:], states, signals).mean())
        for states in (np.asarray(runs.read[0])[1:], readings[0])
    )
    if int(runs.lasted[0]) < flight.steps:
        free = np.inf
    if not left(free, frozen, float(np.square(noise.sensors / scales).mean())):
        return flight.steps
    length = followed_length(model, whole, readings, noise, limits, workers)
    return flight.steps if length < LEAST else -(-flight.steps // -(-flight.steps // length))


def followed_length(
    model: _core.Model,
    whole: Replay,
    readings: Floats,
    noise: Noise,
    limits: Limits,
    workers: _core.Workers | None = None,
) -> int:
    """Steps of a piece in which what noise and disturbances do stays small beside what the system moves.

    Args:
        model: whose slopes let it grow.
        whole: replay of the flight (n steps).
        readings: of the flight (n + 1, n_x), periodic states continued.
        noise: of the sensors, and disturbances.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        The most at which it is small enough, otherwise those at which it is smallest; 0: there are none.
    """
    scales = np.array([state.scale for state in limits.signals.states])
    moves = np.maximum(readings.std(axis=0), np.maximum(noise.sensors, 1e-9 * scales))
    off = np.maximum(noise.sensors, SHARE * moves)
    slopes = _slopes(model, whole, readings, off, limits, workers)
    if slopes is None:
        return 0
    shares = _shares(_deviations(slopes, off, moves, noise), readings / moves, noise.sensors / moves)
    length, least = 0, MOST
    for step, share in enumerate(shares, 1):
        if share <= max(SMALL, least):
            length, least = step, share
    disturbed = bool(noise.correlated) and len(shares) >= LEAST and shares[LEAST - 1] <= MOST
    return max(length, LEAST) if disturbed else length


def _shares(deviations: Deviations, moved: Floats, sensors: Floats) -> list[float]:
    """Of what the system moves in a piece what a deviation comes to, mean squares over the piece: one for each length.

    Args:
        deviations: how they go on.
        moved: readings in units of how far states move (n + 1, n_x).
        sensors: standard deviations of their noise in the same units (n_x,).
    """
    first, slopes, added = deviations
    n_x = moved.shape[1]
    starts = np.unique(np.linspace(0, len(slopes) - 1, STARTS).astype(int))
    spread = np.tile(first, (len(starts), 1, 1))
    grown = went = 0.0
    shares = []
    for step in range(1, len(slopes) + 1):
        going = starts + step <= len(slopes)
        starts, spread = starts[going], spread[going]
        spread = _moved_on(slopes[starts + step - 1], spread) + np.diag(added)
        now = np.trace(spread[:, :n_x, :n_x], axis1=1, axis2=2) / n_x
        if not now.mean() < LARGE:
            break
        grown += float(now.mean())
        went += float((np.square(moved[starts + step] - moved[starts]) - 2.0 * np.square(sensors)).mean())
        shares.append(grown / went if went > 0.0 else np.inf)
    return shares


def _deviations(slopes: Floats, off: Floats, moves: Floats, noise: Noise) -> Deviations:
    """How deviations of the states, off at first by (n_x,), go on with the disturbances that noise knows.

    Args:
        slopes: of each step over deviations of the states (n, n_x, n_x), in their units.
        off: deviations that a piece begins with (n_x,), in their units.
        moves: how far the states move (n_x,), in their units.
        noise: with the disturbances.
    """
    n_x, gusts = len(moves), noise.correlated
    size = n_x + len(gusts)
    onward = np.zeros((len(slopes), size, size))
    onward[:, :n_x, :n_x] = slopes * moves / moves[:, np.newaxis]
    first, added = np.zeros(size), np.zeros(size)
    first[:n_x], added[:n_x] = np.square(off / moves), np.square(noise.moves / moves)
    for i, gust in enumerate(gusts, n_x):
        kept = float(exp(-noise.dt / gust.correlation_time))
        onward[:, i, i] = kept
        first[i], added[i] = gust.sd * gust.sd, (1.0 - kept * kept) * gust.sd * gust.sd
        for state, reach in zip(gust.states, reaches(gust.form, noise.dt, len(gust.states)), strict=True):
            onward[:, state, i] = reach / moves[state]
    return np.diag(first), onward, added


def _moved_on(slopes: Floats, spread: Floats) -> Floats:
    """Covariances (starts, m, m) a period later: S C Sᵀ, summed in a fixed order."""
    half = (slopes[:, :, :, np.newaxis] * spread[:, np.newaxis, :, :]).sum(axis=2)
    onward: Floats = (half[:, :, np.newaxis, :] * slopes[:, np.newaxis, :, :]).sum(axis=3)
    return onward


def _slopes(
    model: _core.Model,
    whole: Replay,
    readings: Floats,
    off: Floats,
    limits: Limits,
    workers: _core.Workers | None,
) -> Floats | None:
    """Slopes of each step along the record (n, n_x, n_x), over deviations (n_x,); None where a step is not finite."""
    n_x = readings.shape[1]
    states = model.states_of(readings)
    begun = np.concatenate([states[np.newaxis], states + np.diag(off)[:, np.newaxis, :]])
    begun[:, -1] = np.nan  # where the last step ends nothing begins
    runs = _core.replay(
        model, limits.engine, whole.initial_state, whole.commands, anchors=begun, workers=workers
    )
    if int(np.min(runs.lasted)) < whole.steps:
        return None
    ends = np.asarray(runs.states)[:, 1:]
    slopes = limits.signals.difference(ends[1:], ends[0]) / off.reshape(n_x, 1, 1)
    return np.ascontiguousarray(np.moveaxis(slopes, 0, 2))
