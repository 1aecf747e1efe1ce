"""The band of a predicted flight as a sequential test: are readings outside for longer than chance explains?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats
from twinloop.law.twin import Twin
from twinloop.law.uncertainty import NINE_OF_TEN
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory

DRAWS = 32
"""Flights of each member of the committee that the threshold is a quantile of."""
FEWEST = 3
"""Periods in a row that must be outside: one bad reading ends no flight."""
HARMLESS = 0.1
"""Share of half an envelope's width that the band's half width is at least: what is off by less does no harm by itself,
and where it leads to is looked for ahead, from the reading. A committee learnt from two flights may be that wrong far
from them, and so sure of itself that no level of alarm would hold."""
START = 5.0
"""Standard deviations of a sensor by which a first reading may be off the start that was asked for."""


class BandWatch:
    """Page's cumulative sum (Biometrika 41, 1954) of how far readings are outside the calibrated band.

    Each period adds w − 1, at most 1, where w is the distance of the reading from the mean in half widths of the band,
    none below a tenth of half the envelope's, the largest over states; the sum never falls below 0. It alarms above the
    level that a given share of the committee's own flights exceed somewhere: members, noise and disturbances drawn,
    with the calibrated spread. So the share is one of flights, and the test knows that errors of a flight last. The
    level is no lower than what flights that the twin learnt from reach against their own bands: what it cannot follow
    there is no surprise.

    Args:
        twin: with a committee and its noise.
        test: that is flown.
        false_alarms: share of flights, by the committee, that the watch ends without cause.
        flown: flights so far, with the tests that they were.
    """

    def __init__(
        self,
        twin: Twin,
        test: Test | Replay,
        false_alarms: float,
        flown: Sequence[tuple[Test, Trajectory]] = (),
    ) -> None:
        self.signals = twin.signals
        drawn = twin.drawn(test, DRAWS)
        assert drawn is not None and twin.noise is not None  # checked where a band is made
        states, noise = drawn
        lasts = np.isfinite(states).all(axis=(1, 2))
        self.sensors = np.maximum(twin.noise.sensors, [1e-9 * state.scale for state in twin.signals.states])
        self.level = np.inf
        self.mean = self.half = np.zeros((0, self.signals.n_x))
        self.limit = 0.0
        self.reset()
        if lasts.mean() <= 1.0 - false_alarms:
            return  # the committee holds anything for possible: no reading is a surprise
        origin = states[lasts][0]
        off = self.signals.difference(states[lasts], origin)
        middle = off.mean(axis=0)
        spread = twin.inflation * (off - middle)
        self.mean = origin + middle
        known = np.sqrt(np.square(spread).mean(axis=0) + np.square(self.sensors))
        self.half = np.maximum(NINE_OF_TEN * known, HARMLESS * _rooms(self.signals))
        worst = (np.abs(spread + noise[lasts]) / self.half).max(axis=2)
        total, highest = np.zeros(len(worst)), np.zeros(len(worst))
        for k in range(worst.shape[1]):
            total = _added(total, worst[:, k])
            highest = np.maximum(highest, total)
        self.level = max(float(np.quantile(highest, 1.0 - false_alarms)), FEWEST - 1.0)
        for known, flight in flown:
            own = BandWatch(twin, twin.as_flown(known, flight), false_alarms)
            own.level = np.inf
            for reading in flight.states:
                own.alarms(reading)
                self.level = max(self.level, own.total)

    def reset(self) -> None:
        """Back to the start of a flight."""
        self.total = 0.0
        self.period = 0
        self.outside = 0
        self.off = False

    def alarms(self, reading: Floats) -> bool:
        """Whether this reading (n_x,), the next one of the flight, is one too many outside."""
        k = self.period
        self.period += 1
        if k >= len(self.mean) or self.off:
            return False
        distances = np.abs(self.signals.difference(reading, self.mean[k]))
        if k == 0 and (distances > START * self.sensors).any():
            self.off = True  # the band is that of a flight from elsewhere
            return False
        worst = float((distances / self.half[k]).max())
        self.outside = self.outside + 1 if worst > 1.0 else 0
        self.total = float(_added(np.array(self.total), np.array(worst)))
        return self.total > self.level


def _added(total: Floats, worst: Floats) -> Floats:
    """The sum after another period."""
    return np.maximum(0.0, total + np.minimum(worst, 2.0) - 1.0)


def _rooms(signals: Signals) -> Floats:
    """Half the width of each state's envelope, or its scale where it has none (n_x,)."""
    return np.array(
        [
            state.scale if state.envelope is None else 0.5 * (state.envelope[1] - state.envelope[0])
            for state in signals.states
        ]
    )
