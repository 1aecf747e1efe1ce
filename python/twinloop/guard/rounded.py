"""Sensors that round, and stand still though the twin says that under these commands they should have moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.law.beginning import states_read
from twinloop.law.twin import Twin
from twinloop.trajectory import Trajectory

STEPS = 3.0
"""Rounding steps that a sensor must at least be behind the twin: within one it may rightly stand still."""
MARGIN = 2.0
"""How many times what the twin missed by in flights that it learnt from a sensor must be behind it, beyond that."""
BEGINNINGS = 8
"""Windows that a stretch of a known flight is covered by, of equal length and begun at different periods."""


class RoundedWatch:
    """States whose rounded reading has stood still for as long as its limit, while the whole committee moved it.

    The committee goes on from a reading that has repeated itself since, under the commands that were sent.
    All members must agree that the reading should be away by three rounding steps, and by twice as much as the twin
    misses in windows of the same length of the flights that it learnt from. A sensor whose limit is longer than these
    flights is not watched: nobody knows how well the twin foretells it.

    Args:
        twin: with a committee.
        pitches: of what each sensor rounds to (n_x,), 0 for one that does not: it is not watched here.
        limits: equal readings in a row (n_x,), periods, before which nothing is said.
    """

    def __init__(self, twin: Twin, pitches: Floats, limits: NDArray[np.int64]) -> None:
        self.twin = twin
        self.limits = limits
        self.behind = np.full(len(pitches), np.inf)
        for i in np.flatnonzero(pitches > 0.0):
            missed = [_missed(twin, flight, int(limits[i]))[:, i] for flight in twin.flights]
            known = np.abs(np.concatenate(missed))
            if len(known):
                self.behind[i] = STEPS * pitches[i] + MARGIN * float(known.max())

    def frozen(self, states: Floats, commands: Floats, repeated: NDArray[np.int64]) -> NDArray[np.bool_]:
        """States (n_x,) whose sensor is frozen.

        Args:
            states: readings of the flight so far (k + 1, n_x).
            commands: sent between them (k, n_u).
            repeated: how many readings in a row equalled the one before, for each state (n_x,).
        """
        found = np.zeros(len(repeated), bool)
        for i in np.flatnonzero(np.isfinite(self.behind) & (repeated >= self.limits)):
            length = int(self.limits[i])
            begins = np.zeros(len(states), bool)
            begins[: len(states) - length] = True
            moved = _agreed(self.twin, states, commands, [begins])[0, -1, i]
            found[i] = abs(moved) > self.behind[i]
        return found


def _missed(twin: Twin, flight: Trajectory, length: int) -> Floats:
    """What the committee agrees to be off by at the ends of windows of a flight (w, n_x); none where it is shorter."""
    steps, n_x = flight.steps, flight.states.shape[1]
    if steps < length:
        return np.zeros((0, n_x))
    # The period after a window's end begins the next one.
    firsts = np.unique(np.linspace(0, min(length, steps - length), BEGINNINGS).astype(int))
    begins = np.array([(np.arange(steps + 1) - first) % (length + 1) == 0 for first in firsts])
    begins[:, 0] = True
    off = _agreed(twin, flight.states, flight.commands, list(begins))
    ends = [np.arange(first + length, steps + 1, length + 1) for first in firsts]
    return np.concatenate([run[end] for run, end in zip(off, ends, strict=True)])


def _agreed(twin: Twin, states: Floats, commands: Floats, begins: Sequence[NDArray[np.bool_]]) -> Floats:
    """By how much all members put readings to one side of what was read, at least; 0 where they do not agree.

    Args:
        twin: with a committee.
        states: readings of a flight (k + 1, n_x).
        commands: sent between them (k, n_u).
        begins: at which readings each of m runs begins again (k + 1,).

    Returns:
        (m, k + 1, n_x); 0 where a member diverged.
    """
    off = []
    for member in twin.members:
        read = states_read(member, states, twin.signals)
        anchors = np.stack([np.where(begin[:, np.newaxis], read, np.nan) for begin in begins])
        runs = _core.replay(member, twin.limits.engine, read[0], commands, anchors=anchors)
        off.append(twin.signals.difference(runs.read, states))
    every = np.array(off)
    least, most = every.min(axis=0), every.max(axis=0)
    agreed = np.where(least > 0.0, least, np.where(most < 0.0, most, 0.0))
    return np.where(np.isfinite(every).all(axis=0), agreed, 0.0)
