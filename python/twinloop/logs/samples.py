"""Samples at times of their own, brought onto one period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput
from twinloop.signals import TURNS, State

APART = 2.0
"""Periods by which two samples may be apart: between them nobody knows what was."""


@dataclass(frozen=True)
class Window:
    """The part of a log that is meant.

    Args:
        start: seconds after its beginning; None: from when all that is wanted is there.
        stop: seconds after its beginning; None: as long as all that is wanted is there.
    """

    start: float | None = None
    stop: float | None = None


@dataclass(frozen=True, eq=False)
class Samples:
    """What was logged of one signal.

    Args:
        address: what messages call it.
        times: (m,), s after the beginning of the log, increasing.
        values: (m,).
    """

    address: str
    times: Floats
    values: Floats


def refuse_gaps(
    called: str, samples: Samples, start: float, stop: float, dt: float, apart: float = APART
) -> None:
    """Refuses samples that are too far apart.

    Args:
        called: what messages call the log.
        samples: at least two.
        start: of the part that is meant, s.
        stop: of it, s.
        dt: the period, s.
        apart: periods that two may be apart.

    Raises:
        InvalidInput: two that enclose a time of that part are further apart.
    """
    inside: NDArray[np.bool_] = (samples.times[1:] > start) & (samples.times[:-1] < stop)
    gaps = np.where(inside, np.diff(samples.times), 0.0)
    place = int(np.argmax(gaps))
    if gaps[place] > apart * dt * (1.0 + 1e-6):
        raise InvalidInput(
            f"Log {called}: expected samples of {samples.address} at most {apart:g} periods ({1e3 * apart * dt:g} ms)"
            f" apart, found {1e3 * gaps[place]:.4g} ms after {samples.times[place]:.6g} s; log it more often, choose a"
            " longer dt, or a part without that gap."
        )


def interpolated(samples: Samples, state: State, times: Floats) -> Floats:
    """Values between samples; of an angle that wraps between two of them by the short way, so that it jumps nowhere.

    Args:
        samples: of a state, at least two.
        state: which.
        times: wanted (n,), s; what lies a little after the last sample goes on as the last two say.
    """
    turn = state.period or TURNS.get(state.unit)
    values = samples.values if turn is None else without_jumps(samples.values, turn)
    found = np.interp(times, samples.times, values)
    after = np.maximum(0.0, times - samples.times[-1])
    slope = (values[-1] - values[-2]) / (samples.times[-1] - samples.times[-2])
    return np.asarray(found + slope * after)


def held(samples: Samples, times: Floats) -> Floats:
    """The values sampled last.

    Args:
        samples: of a command.
        times: wanted (n,), s.
    """
    return samples.values[np.searchsorted(samples.times, times + 1e-9, side="right") - 1]


def mean_held(samples: Samples, times: Floats) -> Floats:
    """The mean, from each time to the next, of values that are held from one sample to the next (n,).

    A loop that jitters sends each command a little early or late. What the mean does in a period is what these did.

    Args:
        samples: of a command.
        times: of the periods' ends (n + 1,), s, not before the first sample.
    """
    steps = np.diff(samples.times)
    sums = np.concatenate([[0.0], np.cumsum(samples.values[:-1] * steps)])
    place = np.clip(np.searchsorted(samples.times, times, side="right") - 1, 0, len(samples.times) - 1)
    until = sums[place] + samples.values[place] * (times - samples.times[place])
    return np.asarray(np.diff(until) / np.diff(times))


def without_jumps(values: Floats, turn: float) -> Floats:
    """Values that take the short way from one to the next; one that is no number changes none behind it.

    Args:
        values: of an angle (m,).
        turn: a whole one.
    """
    found = values.copy()
    known = np.isfinite(values)
    found[known] = np.unwrap(values[known], period=turn)
    return found
