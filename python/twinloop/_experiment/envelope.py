"""Leaving the envelope, the one definition: a flight leaves it when its true state is outside, be it for one period.

A simulated flight knows its true states, drawn noise or not, so that one beyond a bound is enough. Of a flown one
readings are all that is known, and a single one may be the sensor's, as noise is drawn anew for each: soon after it a
second one must be outside. Not the next one, for what swings within a few periods is outside at its crests alone. A
guard waits for no second one, for it may be too late then. All look at the usage of the envelope, the
most of all states: 1 at a bound, and more outside.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.signals import Signals, State

SOON = 5
"""Readings in a row of which two that are outside are no accident: two crests of what swings in up to eight periods,
where it is outside on both sides."""


def is_bounded(signals: Signals) -> bool:
    """Whether any state has an envelope; otherwise no flight can leave one."""
    return any(state.envelope is not None for state in signals.states)


def usages_of(signals: Signals, states: Floats, only: State | None = None) -> Floats:
    """The most that any state uses of its envelope (n,); 0 where none is declared.

    Args:
        signals: of the system.
        states: (n, n_x).
        only: the state that counts; None: all do.
    """
    envelope = [state.envelope if only is None or state == only else None for state in signals.states]
    return _core.usages(signals.engine, envelope, states)


def outside(usages: Floats) -> NDArray[np.bool_]:
    """Where the envelope is left.

    Args:
        usages: of it, any shape; at a bound it is still kept.

    Returns:
        A flag each. Of the worst usages of simulated flights, in their true states, it says which ones leave it.
    """
    return ~np.asarray(usages <= 1.0)


def band_outside(state: State, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Where a band of predicted values of a state is not wholly inside its envelope.

    Args:
        state: with an envelope.
        low: smallest value at each sample (n,), in its unit; of an angle that wraps, on any turn.
        high: largest value (n,), on the same turn as `low`, or beyond it.

    Returns:
        A flag each (n,); one that is not finite is outside.
    """
    assert state.envelope is not None  # the caller asks about those that have one
    least, most = state.envelope
    if state.period is not None:
        # As a whole: with both ends inside, a band may still lead through what is outside, from turn to turn.
        turns = np.rint((0.5 * (low + high) - 0.5 * (least + most)) / state.period)
        low, high = low - turns * state.period, high - turns * state.period
    return ~((low >= least) & (high <= most))


def readings_leave(usages: Floats) -> bool:
    """Whether a flown flight left the envelope, as far as its readings tell.

    Args:
        usages: of it at each reading (n + 1,).
    """
    return bool((np.diff(np.flatnonzero(outside(usages))) < SOON).any())


def gone_from(usages: Floats) -> int | None:
    """The first reading from which a flown flight is outside for good: two in a row, and most of those that are left.

    A flight that overshoots comes back; one that has fallen, stalled or hit something does not.

    Args:
        usages: of the envelope at each reading (n + 1,).

    Returns:
        Its place; None where there is none.
    """
    beyond = outside(usages)
    left = np.arange(len(beyond), 0, -1)
    most = 2 * beyond[::-1].cumsum()[::-1] > left
    gone = beyond[:-1] & beyond[1:] & most[:-1]
    return int(gone.argmax()) if gone.any() else None
