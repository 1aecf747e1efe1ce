"""Readings that cannot be: no number, too far out, or the same to the last bit for longer than the sensor ever gave."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats
from twinloop._ground.rounding import on_grid
from twinloop.trajectory import Trajectory

LONGER = 2
"""How many times the longest repetition in recorded flights a repetition must be exceeded by."""
FEWEST = 5
"""Equal readings in a row, at least, that are taken for a frozen sensor."""
FINE = 10.0
"""Rounding steps in a sensor's noise from which on its readings repeat hardly more than those of any other one."""
BY_CHANCE = 2
"""Repetitions in a row, at most, in recorded flights of such a one."""


class SensorWatch:
    """The states whose readings cannot be trusted.

    Args:
        farthest: magnitude of each state (n_x,) beyond which no reading is recorded: such a one is none.
        flights: recorded before, which say how long each sensor repeats itself; none: no sensor is taken for frozen.
        read: which states a sensor reads (n_x,); what is made of readings does not freeze.
        banded: whether there is a twin with a band: then a sensor that rounds, and repeats itself at rest for as long
            as that lasts, is not taken for frozen by its repetitions alone.
        noise: of each sensor, as the twin has it (n_x,); beside much of it rounding is none. None: not known.

    Attributes:
        watched: states (n_x,) that are taken for frozen by their repetitions alone.
        pitches: of what the others round to (n_x,), in the states' units; 0 where that is not so.
        limit: repetitions in a row (n_x,) from which on a sensor may be frozen; None: not known.
        repeated: readings in a row that equalled the one before (n_x,).
    """

    def __init__(
        self,
        farthest: Floats,
        flights: Sequence[Trajectory],
        read: Sequence[int],
        banded: bool,
        noise: Floats | None = None,
    ) -> None:
        n_x = len(farthest)
        self.farthest = farthest
        self.watched = np.isin(np.arange(n_x), read)
        longest = np.zeros(n_x, np.int64)
        for flight in flights:
            longest = np.maximum(longest, _longest(flight.states))
        self.pitches = np.zeros(n_x)
        if banded and flights:
            readings = np.concatenate([flight.states for flight in flights])
            pitches = np.array([on_grid(column) for column in readings.T])
            known = np.zeros(n_x) if noise is None else noise
            fine = (known >= FINE * pitches) & (longest <= BY_CHANCE)
            self.pitches = np.where(self.watched & ~fine, pitches, 0.0)
            self.watched &= self.pitches == 0.0
        self.limit = np.maximum(LONGER * longest + 1, FEWEST) if flights else None
        self.last = np.full(n_x, np.nan)
        self.repeated = np.zeros(n_x, np.int64)

    def reset(self) -> None:
        """Back to the start of a flight."""
        self.last[:] = np.nan
        self.repeated[:] = 0

    def missing(self, reading: Floats) -> NDArray[np.bool_]:
        """States (n_x,) whose reading is no number, or so far out that it is none of the state."""
        return ~np.isfinite(reading) | (np.abs(reading) > self.farthest)

    def frozen(self, reading: Floats) -> NDArray[np.bool_]:
        """States (n_x,) whose sensor is frozen, with this reading, the next one of the flight."""
        self.repeated[:] = np.where(reading == self.last, self.repeated + 1, 0)
        self.last[:] = reading
        if self.limit is None:
            return np.zeros(len(reading), bool)
        found: NDArray[np.bool_] = self.watched & (self.repeated >= self.limit)
        return found


def _longest(states: Floats) -> np.ndarray:
    """The most readings in a row that were equal to the one before, for each state."""
    longest = now = np.zeros(states.shape[1], np.int64)
    for equal in states[1:] == states[:-1]:
        now = np.where(equal, now + 1, 0)
        longest = np.maximum(longest, now)
    return longest
