"""Gusts: by how much disturbances move the quality that a flight is measured to have."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.streams import Unit
from twinloop.law.flight import drawn_runs
from twinloop.law.noise import Noise
from twinloop.planning.quality import Quality
from twinloop.test import Test
from twinloop.trajectory import Trajectory

DRAWS = 32
"""Flights under drawn disturbances: half of them, and the same with the opposite sign, so that what a disturbance does
to a quality in proportion is no bias."""


class Moved(NamedTuple):
    """What disturbances do to the quality of a flight.

    Args:
        bias: what they add to it on average; most flights are worse for them.
        spread: standard deviation of what they add.
    """

    bias: float
    spread: float

    def added_to(self, predicted: float, spread: float) -> tuple[float, float]:
        """A quality that was predicted without disturbances, and its standard deviation, with them."""
        return predicted + self.bias, sqrt(spread * spread + self.spread * self.spread)


UNMOVED = Moved(0.0, 0.0)
"""A flight that nothing disturbs."""


def moved_by_gusts(
    model: _core.Model,
    noise: Noise,
    test: Test,
    quality: Quality,
    unit: Unit,
    limits: Limits,
    workers: _core.Workers,
) -> Moved:
    """By how much drawn disturbances move the quality of a flight.

    A committee flies candidates under the noise of sensors alone, so neither its prediction nor its spread has this.

    Args:
        model: that is flown.
        noise: with the disturbances.
        test: to be flown.
        quality: that is measured.
        unit: of which the draws are a part.
        limits: where a run counts as diverged, which then counts for nothing.
        workers: how the work is carried out.
    """
    drawn = noise.disturbance(DRAWS // 2, test.steps, unit.stream("repeats"))
    still = np.zeros((1, *drawn.shape[1:]))
    runs = drawn_runs(
        model, test, limits, disturbance=np.concatenate([still, drawn, -drawn]), workers=workers
    )
    t = test.signals.dt * np.arange(test.steps + 1, dtype=np.float64)
    values = [
        quality.flown(Trajectory(t, states, commands), test.target_state)
        for states, commands, lasted in zip(runs.measured, runs.commands, runs.lasted, strict=True)
        if lasted == test.steps
    ]
    if runs.lasted[0] < test.steps or len(values) < 2:
        return UNMOVED
    added = np.array(values[1:]) - values[0]
    return Moved(float(added.mean()), float(added.std()))
