"""Controllers that nobody has flown, with the true runs of those that the plant survives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from twinloop._experiment.envelope import outside, usages_of
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.law.flight import fly
from twinloop.law.twin import Twin
from twinloop.test import Test
from twinloop_exam.zoo.plant import Plant, true_states

COUNT = 40
MOST = 400
"""Controllers that are tried, where few survive."""
SEED = 20_261_122


class Accuracy(NamedTuple):
    """How far a twin is off under controllers that nobody has flown.

    Args:
        error: the median of the mean squared error in units of the states' scales over that of a model that never
            moves; infinite where the twin diverges, None without controllers.
        error_inside: the same over the controllers whose true flight stays inside the envelope.
        diverged: controllers under which the twin diverges.
    """

    error: float | None
    error_inside: float | None
    diverged: int


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Controllers drawn uniformly from the box of gains, and how the plant flies under them.

    Args:
        tests: without excitation; the plant survives them.
        states: true states (n + 1, n_x) of each.
        tried: controllers that were drawn.
    """

    tests: Sequence[Test]
    states: Sequence[Floats]
    tried: int

    def judged(self, twin: Twin) -> Accuracy:
        """How far a twin is off under these controllers.

        Args:
            twin: to be judged.
        """
        errors = []
        scales = np.array([state.scale for state in twin.signals.states])
        for test, truth in zip(self.tests, self.states, strict=True):
            run = fly(twin.model, test, limits=twin.limits)
            if run.steps < test.steps:
                errors.append(np.inf)
                continue
            off = twin.signals.difference(true_states(run), truth) / scales
            still = twin.signals.difference(truth[:1], truth) / scales
            errors.append(float(np.square(off).mean() / np.square(still).mean()))
        signals = twin.signals
        inside = [
            error
            for error, truth in zip(errors, self.states, strict=True)
            if not outside(usages_of(signals, truth)).any()
        ]
        diverged = sum(not np.isfinite(error) for error in errors)
        return Accuracy(_median(errors), _median(inside), diverged)


def _median(errors: Sequence[float]) -> float | None:
    """The middle by rank: half of the sum of two infinite errors is none."""
    return sorted(errors)[len(errors) // 2] if errors else None


def held_out(plant: Plant, count: int = COUNT) -> HeldOut:
    """Flies drawn controllers until enough have survived, or too many were tried.

    Args:
        plant: without noise.
        count: of those that survive.
    """
    draw = Unit(SEED).part(0).stream("exam")
    tests: list[Test] = []
    states: list[Floats] = []
    tried = 0
    while len(tests) < count and tried < MOST:
        tried += 1
        test = plant.test(plant.family.from_unit(draw.uniforms(plant.family.size)))
        run = plant.truth.run(test)
        moved = run.steps and float(np.ptp(true_states(run), axis=0).max()) > 0.0
        if run.ended == "completed" and moved:
            tests.append(test)
            states.append(true_states(run))
    return HeldOut(tests, states, tried)
