"""Gusts: by how much disturbances move the quality that a flight is measured to have."""

from __future__ import annotations

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
"""Flights under drawn disturbances."""


def moved_by_gusts(
    model: _core.Model,
    noise: Noise,
    test: Test,
    quality: Quality,
    unit: Unit,
    limits: Limits,
    workers: _core.Workers,
) -> float:
    """Root mean square by which drawn disturbances move the quality of a flight, their bias included.

    A committee flies candidates under the noise of sensors alone, so its spread does not have this.

    Args:
        model: that is flown.
        noise: with the disturbances.
        test: to be flown.
        quality: that is measured.
        unit: of which the draws are a part.
        limits: where a run counts as diverged, which then counts for nothing.
        workers: how the work is carried out.
    """
    moved = noise.disturbance(DRAWS, test.steps, unit.stream("repeats"))
    still = np.zeros((1, *moved.shape[1:]))
    runs = drawn_runs(model, test, limits, disturbance=np.concatenate([still, moved]), workers=workers)
    t = test.signals.dt * np.arange(test.steps + 1, dtype=np.float64)
    values = [
        quality.flown(Trajectory(t, states, commands), test.target_state)
        for states, commands, lasted in zip(runs.measured, runs.commands, runs.lasted, strict=True)
        if lasted == test.steps
    ]
    if runs.lasted[0] < test.steps or len(values) < 2:
        return 0.0
    return float(np.sqrt(np.square(np.array(values[1:]) - values[0]).mean()))
