"""A plant of the zoo: a system with a task, a first controller, and what it truly has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats
from twinloop.controllers import Family, Mixer, UnboundFamily
from twinloop.errors import NotAvailable
from twinloop.planning.quality import Quality, quality_of, weights_of
from twinloop.signals import Signals
from twinloop.systems.base import System
from twinloop.test import Test
from twinloop.trajectory import Trajectory

CUT_FACTOR = 10.0
"""A flight that was cut counts as this many times doing nothing: finite, for optimisers, and clearly bad."""
STRUCTURES = ("actuator", "offset", "hidden", "lasting")
"""What a lesson may find beside equations: lags or delays of commands, sensors read at other times, hidden states,
disturbances that last."""


@dataclass(frozen=True)
class Task:
    """What is asked of a plant.

    Args:
        controller: the family that is tuned.
        start: where every test starts (n_x,).
        target: where every test should end (n_x,).
        duration: of a test, s.
        first: gains of the first controller, by name.
        weights: of states in the quality, by name, where those that go without saying are not meant.
    """

    controller: UnboundFamily
    start: ArrayLike
    target: ArrayLike
    duration: float
    first: Mapping[str, float]
    weights: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Plant:
    """A plant with its task.

    Args:
        name: in the zoo.
        kind: what it is, in a few words.
        make: the system as a learner meets it, of a seed; None: the same without noise and disturbances.
        task: what is asked of it, of the system without noise.
        has: what it truly has, of `STRUCTURES`; finding anything else is a falsehood.
    """

    name: str
    kind: str
    make: Callable[[int | None], System]
    task: Callable[[Any], Task]
    has: frozenset[str] = frozenset()

    @cached_property
    def truth(self) -> System:
        """Without noise and disturbances.

        Raises:
            NotAvailable: a package that it needs is not installed.
        """
        return self.make(None)

    @cached_property
    def asked(self) -> Task:
        """The task."""
        return self.task(self.truth)

    @property
    def signals(self) -> Signals:
        """Of the system."""
        return self.truth.signals

    @cached_property
    def family(self) -> Family:
        """Of the controllers, bound to the signals."""
        return self.asked.controller.bind(self.signals)

    @cached_property
    def quality(self) -> Quality:
        """Integrated absolute error, as a campaign has it by default."""
        weights = weights_of("iae", self.signals, self.asked.weights)
        return quality_of("iae", self.signals, weights.tolist())

    @property
    def why_missing(self) -> str | None:
        """Why it cannot be flown here; None if it can."""
        try:
            _ = self.truth
        except NotAvailable as reason:
            return str(reason)
        return None

    def test(self, gains: Mapping[str, float] | ArrayLike) -> Test:
        """The task under a controller, without excitation, of no campaign.

        Args:
            gains: by name, or (size,) in order, in their units.
        """
        asked, signals = self.asked, self.signals
        start, target = (np.asarray(state, dtype=np.float64) for state in (asked.start, asked.target))
        steps = round(asked.duration / signals.dt)
        return Test(self.family, self.family.genes(gains), start, target, steps)

    def judged(self, run: Trajectory, test: Test) -> float:
        """Quality of a flight on its true states, to be minimised.

        Args:
            run: the flight.
            test: that was flown.
        """
        return self.quality_of_states(true_states(run), test)

    def quality_of_states(self, states: Floats, test: Test) -> float:
        """Quality of states (m + 1, n_x); of fewer than the test's, `CUT_FACTOR` times that of doing nothing."""
        if len(states) < test.steps + 1:
            still = np.tile(test.initial_state, (test.steps + 1, 1))
            return CUT_FACTOR * self.quality_of_states(still, test)
        t = self.signals.dt * np.arange(len(states), dtype=np.float64)
        still_commands = np.zeros((test.steps, self.signals.n_u))
        return self.quality.flown(Trajectory(t, states, still_commands), test.target_state)

    def true_quality(self, gains: Mapping[str, float] | ArrayLike) -> float:
        """Quality of a controller on the plant without noise, disturbances and excitation.

        Args:
            gains: by name, or (size,) in order, in their units.
        """
        test = self.test(gains)
        return self.judged(self.truth.run(test), test)


def about_rest(*commands: float) -> Mixer:
    """Axis i drives command i; where no axis asks for anything, commands are those of rest.

    Args:
        commands: of rest, in their units.
    """
    return Mixer(np.eye(len(commands)), np.array(commands))


def true_states(run: Trajectory) -> Floats:
    """States without sensor noise where the system knows them, else as measured (n + 1, n_x)."""
    return run.states if run.true_states is None else run.true_states
