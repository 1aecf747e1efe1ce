"""Controllers that nobody has flown, with the true runs of those that the plant survives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import NamedTuple

import numpy as np

from twinloop._experiment.envelope import outside, usages_of
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.law.flight import fly
from twinloop.law.twin import Twin
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop_exam.zoo.plant import Plant, true_states

COUNT = 40
MOST = 400
"""Controllers that are tried, where few survive."""
SEED = 20_261_122
OFF = 1e-4
"""Share of the states' scales that a second start of the plant is off by: less than any sensor would tell."""
REPEATED = 0.01
"""Error of the plant's second run, over that of a model that never moves, up to which a flight can be foretold."""


class Accuracy(NamedTuple):
    """How far a twin is off under controllers that nobody has flown.

    Args:
        error: the median of the mean squared error in units of the states' scales over that of a model that never
            moves; infinite where the twin diverges, None without controllers.
        error_inside: the same over the controllers whose true flight stays inside the envelope.
        error_repeated: the same over those whose flight the plant itself repeats from a start that is hardly off.
        diverged: controllers under which the twin diverges.
    """

    error: float | None
    error_inside: float | None
    error_repeated: float | None
    diverged: int


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Controllers drawn uniformly from the box of gains, and how the plant flies under them.

    Args:
        tests: without excitation; the plant survives them.
        states: true states (n + 1, n_x) of each.
        tried: controllers that were drawn.
        repeated: of each, whether the plant repeats it from a start that is hardly off. Where it does not, such as
            under pulses or at the edge of stability, no law foretells it: no sensor shows a start so exactly.
    """

    tests: Sequence[Test]
    states: Sequence[Floats]
    tried: int
    repeated: Sequence[bool]

    def judged(self, twin: Twin) -> Accuracy:
        """How far a twin is off under these controllers.

        Args:
            twin: to be judged.
        """
        signals = twin.signals
        errors = [
            _error(signals, fly(twin.model, test, limits=twin.limits), truth)
            for test, truth in zip(self.tests, self.states, strict=True)
        ]
        inside = [not outside(usages_of(signals, truth)).any() for truth in self.states]
        return Accuracy(
            _median(errors),
            _median(list(compress(errors, inside))),
            _median(list(compress(errors, self.repeated))),
            sum(not np.isfinite(error) for error in errors),
        )


def _error(signals: Signals, run: Trajectory, truth: Floats) -> float:
    """Mean squared error of a run in units of the scales over that of a model that never moves; infinite if it ends."""
    if len(run.states) < len(truth):
        return np.inf
    scales = np.array([state.scale for state in signals.states])
    off = signals.difference(true_states(run), truth) / scales
    still = signals.difference(truth[:1], truth) / scales
    return float(np.square(off).mean() / np.square(still).mean())


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
    repeated: list[bool] = []
    tried = 0
    while len(tests) < count and tried < MOST:
        tried += 1
        test = plant.test(plant.family.from_unit(draw.uniforms(plant.family.size)))
        run = plant.truth.run(test)
        moved = run.steps and float(np.ptp(true_states(run), axis=0).max()) > 0.0
        if run.ended == "completed" and moved:
            tests.append(test)
            states.append(true_states(run))
            repeated.append(repeats(plant, test, states[-1]))
    return HeldOut(tests, states, tried, repeated)


def repeats(plant: Plant, test: Test, states: Floats) -> bool:
    """Whether a plant without noise flies a test alike from a start that is hardly off.

    Args:
        plant: without noise.
        test: to be flown.
        states: true states of its own run (n + 1, n_x).
    """
    again = plant.truth.run(replace(test, initial_state=_hardly_off(plant, test)))
    return _error(plant.truth.signals, again, states) <= REPEATED


def _hardly_off(plant: Plant, test: Test) -> Floats:
    """A start off by `OFF` of each state's scale, one state up and the next one down."""
    scales = np.array([state.scale for state in plant.truth.signals.states])
    return np.asarray(test.initial_state + OFF * scales * np.resize([1.0, -1.0], len(scales)))
