"""Gusts: what disturbances do to a flight, which a committee under the noise of sensors alone does not show."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop._experiment.envelope import outside
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.errors import engine_input
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise
from twinloop.planning.quality import Quality
from twinloop.signals import Signals
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
        left: of so many drawn flights, how many they drive out of the envelope, or make diverge.
        drawn: number of these flights.
    """

    bias: float
    spread: float
    left: int = 0
    drawn: int = DRAWS

    def added_to(self, predicted: float, spread: float) -> tuple[float, float]:
        """A quality that was predicted without disturbances, and its standard deviation, with them."""
        return predicted + self.bias, sqrt(spread * spread + self.spread * self.spread)

    @property
    def risk(self) -> float:
        """Probability of leaving the envelope in them; 0 where no drawn flight does, which shows no more than others.

        Half a flight is added on either side: few flights are no certainty.
        """
        return (self.left + 0.5) / (self.drawn + 1.0) if self.left else 0.0


UNMOVED = Moved(0.0, 0.0)
"""A flight that nothing disturbs."""


@dataclass(frozen=True, eq=False)
class Gusts:
    """Disturbances that are known, and who flies in them.

    Args:
        model: that is flown.
        noise: with the disturbances.
        quality: that is measured.
        unit: of which the draws are a part: the same for all flights.
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
        drawn = self.noise.disturbance(DRAWS // 2, test.steps, self.unit.stream("repeats"))
        if not drawn.any():
            return UNMOVED
        still = np.zeros((1, *drawn.shape[1:]))
        disturbance = np.concatenate([still, drawn, -drawn])
        runs = drawn_runs(self.model, test, self.limits, disturbance=disturbance, workers=self.workers)
        lasts = runs.lasted == test.steps
        if not lasts[0]:
            return UNMOVED
        kept = [
            not outside(_usages(test.signals, states)).any()
            for states, whole in zip(runs.states[1:], lasts[1:], strict=True)
            if whole
        ]
        t = test.signals.dt * np.arange(test.steps + 1, dtype=np.float64)
        values = [
            self.quality.flown(Trajectory(t, states, commands), test.target_state)
            for states, commands, whole in zip(runs.measured, runs.commands, lasts, strict=True)
            if whole
        ]
        added = np.array(values[1:] or values) - values[0]
        return Moved(float(added.mean()), float(added.std()), DRAWS - sum(kept))


def _usages(signals: Signals, states: Floats) -> Floats:
    """Of the envelope, at each of some states (n + 1, n_x)."""
    with engine_input():
        return _core.usages(signals.engine, [state.envelope for state in signals.states], states)
