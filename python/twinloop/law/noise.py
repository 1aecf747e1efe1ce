"""What a twin does not predict: noise of sensors, and disturbances, white and lasting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.elementary import exp
from twinloop.records import Recorded


class LastingDisturbance(NamedTuple):
    """What drives states beside the commands and is forgotten slowly, such as gusts.

    Args:
        states: that it drives: the first one, then its integral, and so on.
        integrated: whether it is a derivative of the first one, and not what is added to it in a period.
        sd: its standard deviation, in the unit of the first state, a second where it is a derivative.
        memory: time after which it is forgotten to 1/e, s.
    """

    states: tuple[int, ...]
    integrated: bool
    sd: float
    memory: float


@dataclass(frozen=True, eq=False)
class Noise(Recorded, kind="noise"):
    """What a twin does not predict.

    Args:
        sensors: standard deviation of each state's sensor (n_x,), in its unit.
        moves: standard deviation of what a white disturbance adds to each state in a period (n_x,), in its unit.
        lasting: disturbances that last.
        dt: period, s.
    """

    sensors: Floats
    moves: Floats
    lasting: tuple[LastingDisturbance, ...] = ()
    dt: float = 1.0

    def drawn(self, draws: int, steps: int, stream: _core.Stream) -> tuple[Floats, Floats]:
        """What sensors add to readings (draws, steps + 1, n_x), and disturbances to states (draws, steps, n_x)."""
        noise = self.sensors * stream.normals(draws, steps + 1, len(self.sensors))
        return noise, self.disturbance(draws, steps, stream)

    def disturbance(self, draws: int, steps: int, stream: _core.Stream) -> Floats:
        """Draws of what disturbances add to the states (draws, steps, n_x)."""
        added = self.moves * stream.normals(draws, steps, len(self.moves))
        for states, integrated, size, memory in self.lasting:
            kept = float(exp(-self.dt / memory))
            fresh = stream.normals(draws, steps)
            gust = np.empty((draws, steps))
            gust[:, 0] = fresh[:, 0]
            for k in range(1, steps):
                gust[:, k] = kept * gust[:, k - 1] + np.sqrt(1.0 - kept * kept) * fresh[:, k]
            reach = 1.0
            for i, state in enumerate(states if integrated else states[:1]):
                reach *= self.dt / (i + 1) if integrated else 1.0
                added[:, :, state] += reach * size * gust
        return added
