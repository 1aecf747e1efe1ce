"""Gusts: what disturbances do to a flight, which a committee under the noise of sensors alone does not show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop._experiment.envelope import outside, usages_of
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise
from twinloop.planning.leaving import least_risk
from twinloop.planning.quality import Quality
from twinloop.test import Test
from twinloop.trajectory import Trajectory

DRAWS = 32
"""Flights under drawn disturbances: half of them, and the same with the opposite sign, so that what a disturbance does
to a quality in proportion is no bias."""


class Moved(NamedTuple):
    """What disturbances do to a flight.

    Args:
        bias: what they add to its quality on average; most flights are worse for them.
        spread: standard deviation of what they add.
        left: how many of the `DRAWS` flights they drive out of the envelope, or make diverge.
    """

    bias: float
    spread: float
    left: int = 0

    def added_to(self, predicted: float, spread: float) -> tuple[float, float]:
        """A quality that was predicted without disturbances, and its standard deviation, with them."""
        return predicted + self.bias, sqrt(spread * spread + self.spread * self.spread)

    @property
    def risk(self) -> float:
        """Least probability of leaving the envelope in them; 0 where no drawn flight does."""
        return least_risk(self.left, DRAWS)


UNMOVED = Moved(0.0, 0.0)
"""A flight that nothing disturbs."""


@dataclass(frozen=True, eq=False)
class Gusts:
    """Disturbances that are known, and the model that flies in them. All flights meet the same draws.

    Args:
        model: that is flown.
        noise: with the disturbances.
        quality: that is measured.
        unit: of which the draws are a part.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """

    model: _core.Model
    noise: Noise
    quality: Quality
    unit: Unit
    limits: Limits
    workers: _core.Workers

    def on(self, test: Test) -> Moved:
        """What they do to a flight; nothing to one that does not last without them.

        Args:
            test: to be flown.
        """
        parts = test.genes, test.initial_state, test.target_state, test.excitation
        flight = (test.steps, test.hold_back, *(None if part is None else part.tobytes() for part in parts))
        if flight not in self._flown:
            self._flown[flight] = self._moved(test)
        return self._flown[flight]

    @cached_property
    def _flown(self) -> dict[tuple[object, ...], Moved]:
        """What they do to the flights that it was asked of so far."""
        return {}

    def tuned_in(self, draws: int, steps: int) -> Floats:
        """What moves the states after each step while gains are tuned (draws, n, n_x).

        Half of them are drawn, always alike, and the other half are their opposites. A flight is judged (`on`) in draws
        of its own: gains that are good in some draws must not be judged in the same.

        Args:
            draws: an even number of them.
            steps: n of them.
        """
        return self._drawn(self.unit.part(0), draws, steps)

    def _drawn(self, unit: Unit, draws: int, steps: int) -> Floats:
        if (unit, draws, steps) not in self._known:
            half = self.noise.disturbance(draws // 2, steps, unit.stream("repeats"))
            self._known[unit, draws, steps] = np.concatenate([half, -half])
        return self._known[unit, draws, steps]

    @cached_property
    def _known(self) -> dict[tuple[Unit, int, int], Floats]:
        """Draws by their unit, their number and that of the steps."""
        return {}

    def _moved(self, test: Test) -> Moved:
        drawn = self._drawn(self.unit, DRAWS, test.steps)
        if not drawn.any():
            return UNMOVED
        still = np.zeros((1, *drawn.shape[1:]))
        runs = drawn_runs(
            self.model, test, self.limits, disturbance=np.concatenate([still, drawn]), workers=self.workers
        )
        lasts = runs.lasted == test.steps
        if not lasts[0]:
            return UNMOVED
        lasting = runs.states[1:][lasts[1:]]
        usages = usages_of(test.signals, lasting.reshape(-1, lasting.shape[2])).reshape(lasting.shape[:2])
        left = DRAWS - len(lasting) + int(outside(usages).any(axis=1).sum())
        t = test.signals.dt * np.arange(test.steps + 1, dtype=np.float64)
        values = [
            self.quality.flown(Trajectory(t, states, commands), test.target_state)
            for states, commands in zip(runs.measured[lasts], runs.commands[lasts], strict=True)
        ]
        added = np.array(values[1:] or values) - values[0]
        return Moved(float(added.mean()), float(added.std()), left)
