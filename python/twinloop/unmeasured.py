"""Unmeasured: states that no sensor reads, as what readings of others change by over a period."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats, floats
from twinloop.signals import Signals, State

FIRST = 10
"""Changes at the start of a run that say by how much they differ from period to period."""
FAR = 3.0
"""Times that by which the first one may be off the rate that a run was to begin with."""


def lacks(values: ArrayLike, signals: Signals) -> bool:
    """Whether states or readings (…, columns) have columns for those states alone that are measured."""
    if not signals.unmeasured:
        return False
    try:
        shape = np.shape(values)
    except ValueError:  # of rows that differ: what reads them says so
        return False
    return bool(shape) and shape[-1] == len(signals.measured)


def columns_of(values: ArrayLike, signals: Signals) -> int:
    """How many columns states or readings should have: one for each state, or for each that is measured."""
    return len(signals.measured) if lacks(values, signals) else signals.n_x


def names_of(values: ArrayLike, signals: Signals) -> tuple[str, ...]:
    """Names of the states that columns of states or readings are of."""
    names = signals.state_names
    return tuple(names[i] for i in signals.measured) if lacks(values, signals) else names


def logged(signals: Signals, there: Collection[str]) -> tuple[State, ...]:
    """States of which a log has columns: all of them, or those alone that are measured.

    Args:
        signals: of the system.
        there: names of its columns.
    """
    if all(state.measured or state.name in there for state in signals.states):
        return tuple(signals.states)
    return tuple(state for state in signals.states if state.measured)


def completed_readings(readings: Floats, signals: Signals, start: Floats | None = None) -> Floats:
    """Readings of a run of all states (n + 1, n_x).

    Args:
        readings: of those that are measured, in their order.
        signals: of the system.
        start: the state that the run was to start from (n_x,); None: nobody knows.

    Returns:
        The readings (n + 1, n_x). A rate begins as the start has it, or as the first change says where nobody knows, or
        where it is so far off that the run began in motion.
    """
    states = _among(readings, signals)
    if not len(states):
        return states
    for i, of in sources(signals):
        changes = _change(states[1:, of], states[:-1, of], of, signals)
        states[1:, i] = changes
        begun = float(changes[0]) if len(changes) else 0.0
        usual = float(np.abs(np.diff(changes[:FIRST])).max(initial=0.0))
        states[0, i] = begun if start is None or abs(begun - start[i]) > FAR * usual else start[i]
    return states


def completed_state(what: str, values: ArrayLike, signals: Signals) -> Floats:
    """A state (n_x,), at rest where it is not measured.

    Args:
        what: how to call it in an error.
        values: (n_x,), or of those alone that are measured, in their order.
        signals: of the system.

    Raises:
        InvalidInput: another shape, or numbers that are not finite.
    """
    found = floats(f"{what}{or_measured(signals)}", values, (columns_of(values, signals),))
    return _among(found, signals) if lacks(found, signals) else found


def or_measured(signals: Signals) -> str:
    """What an error adds where measured states alone would do as well."""
    return f" (or the {len(signals.measured)} that are measured)" if signals.unmeasured else ""


def completed_rows(what: str, rows: ArrayLike, signals: Signals) -> Floats:
    """A state (n_x,), or those of each row (rows, n_x).

    Args:
        what: how to call them in an error.
        rows: of those alone that are measured, in their order, one state or several.
        signals: of the system.

    Raises:
        InvalidInput: another shape, or numbers that are not finite.
    """
    if np.ndim(rows) == 1:
        return completed_state(what, rows, signals)
    return completed_readings(floats(what, rows, (None, len(signals.measured))), signals)


class Differences:
    """Readings in the course of a run, completed with what they change by over each period.

    Args:
        signals: of the system.
    """

    def __init__(self, signals: Signals) -> None:
        self.signals = signals
        self.reset()

    def reset(self) -> None:
        """Forgets the run; the next one begins at rest."""
        self._last: Floats | None = None

    def completed(self, reading: Floats) -> Floats:
        """The state (n_x,) as a controller is given it.

        Args:
            reading: (n_x,), or (number that is measured,); NaN is allowed.
        """
        signals = self.signals
        if reading.ndim != 1 or not lacks(reading, signals):
            return reading
        state, last = _among(reading, signals), self._last
        if last is not None:
            for i, of in sources(signals):
                state[i] = _change(state[of], last[of], of, signals)
        self._last = state
        return state


def in_words(signals: Signals) -> list[str]:
    """How each state is made that is not measured, for a program that has to."""
    names, dt, wrapping = signals.state_names, signals.dt, [i for i, _ in signals.periods]
    return [
        f"{names[i]} is not measured: ({names[of]} - {names[of]} a period before) / {dt:g} s"
        f"{', the difference taken the short way' if of in wrapping else ''}, 0 in the first period"
        for i, of in sources(signals)
    ]


def _among(measured: Floats, signals: Signals) -> Floats:
    """Values of all states (…, n_x), those that are not measured 0."""
    values = np.zeros((*measured.shape[:-1], signals.n_x))
    values[..., signals.measured] = measured
    return values


def sources(signals: Signals) -> Sequence[tuple[int, int]]:
    """Places of states that are not measured, and of what each is the derivative of."""
    names = signals.state_names
    return [(i, names.index(str(signals.states[i].derivative_of))) for i in signals.unmeasured]


def _change(now: Floats, before: Floats, of: int, signals: Signals) -> Floats:
    """What readings of a state change by, a second; of one that wraps, the short way."""
    change = np.asarray(now - before)
    period = signals.states[of].period
    if period is not None:
        change = change - np.rint(change / period) * period
    return change / signals.dt
