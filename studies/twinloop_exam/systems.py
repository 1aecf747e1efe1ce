"""The exam's systems by name: what a learner flies, and the truth that it is judged on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from twinloop import systems
from twinloop._ground.arrays import Floats
from twinloop.controllers import Family, UnboundFamily
from twinloop.errors import NotAvailable, unknown
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop_exam import quality

JUDGE_SEED = 987_654
"""Of the noise under which controllers are judged; far from the seeds of campaigns."""
NOISY_RUNS = 200
NOISE = 1e-3
"""Of the sensors, rad; five times as much in rad/s."""


class Draw(IntEnum):
    """What an exam draws beside the noise of its systems; the first number of its units of work."""

    RANDOM_GAINS = 1
    OPTIMUM = 2
    GAUSSIAN_PROCESS = 3


class Rig(Protocol):
    """A system with a task: what the exam needs to know of it."""

    @property
    def signals(self) -> Signals:
        """Its states, commands and period."""
        ...

    @property
    def controller(self) -> UnboundFamily:
        """The family of controllers that is tuned."""
        ...

    @property
    def initial_state(self) -> Floats:
        """Where every test starts (n_x,)."""
        ...

    @property
    def target_state(self) -> Floats:
        """Where every test should end (n_x,)."""
        ...

    @property
    def duration(self) -> float:
        """Length of a test, s."""
        ...

    @property
    def default_gains(self) -> Mapping[str, float]:
        """The first controller, C0, by name."""
        ...

    def run(self, test: Test) -> Trajectory:
        """Runs one experiment."""
        ...


@dataclass(frozen=True)
class Subject:
    """One system of the exam.

    Args:
        name: of the system in the exam.
        quality: what its controllers are judged by, "final_distance" or "iae".
        fresh: makes the system as a learner meets it, from a seed.
        truth: makes the same without noise and gusts.
        judged_runs: runs over whose noise a controller's quality is averaged; 0: one run of the truth.
        what: it is, for a table.
    """

    name: str
    quality: str
    fresh: Callable[[int], Any]
    truth: Callable[[], Any]
    judged_runs: int = 0
    what: str = ""

    def rig(self, seed: int) -> Rig:
        """The system as a learner meets it, not flown yet.

        Args:
            seed: of its noise and, where it has a say, of its first controller.
        """
        rig: Rig = self.fresh(seed)
        return rig

    @cached_property
    def true_rig(self) -> Rig:
        """The system without noise and gusts."""
        rig: Rig = self.truth()
        return rig

    @cached_property
    def family(self) -> Family:
        """Of the controllers, bound to the system's signals."""
        return self.true_rig.controller.bind(self.true_rig.signals)

    @property
    def signals(self) -> Signals:
        """Of the system."""
        return self.family.signals

    def test(self, genes: ArrayLike, family: Family | None = None) -> Test:
        """The exam's task under a controller, without excitation.

        Args:
            genes: gains (size,), in their units.
            family: that they belong to; by default the system's own.

        Returns:
            A test that belongs to no campaign.
        """
        rig = self.true_rig
        steps = round(rig.duration / self.signals.dt)
        return Test(family or self.family, np.asarray(genes), rig.initial_state, rig.target_state, steps)

    def true_quality(self, genes: ArrayLike, runs: int | None = None, seed: int = JUDGE_SEED) -> float:
        """Quality of a controller of the system's own family, as `judged`.

        Args:
            genes: gains (size,), in their units.
            runs: as for `judged`.
            seed: as for `judged`.
        """
        return self.judged(self.test(genes), runs, seed)

    def judged(self, test: Test, runs: int | None = None, seed: int = JUDGE_SEED) -> float:
        """Quality of a test on the true states, to be minimised.

        Args:
            test: to be flown.
            runs: over whose noise it is averaged; by default `judged_runs`. Equal for all controllers.
            seed: of that noise.

        Returns:
            Final distance (SI units) or integrated absolute error (rad s).
        """
        runs = self.judged_runs if runs is None else runs
        rig = self.rig(seed) if runs else self.true_rig
        found = [
            quality.of_states(self.quality, quality.true_states(rig.run(test)), test)
            for _ in range(max(1, runs))
        ]
        return float(np.mean(found))

    @property
    def nothing(self) -> float:
        """Quality of doing nothing."""
        return quality.of_nothing(self.quality, self.test(np.array([g.low for g in self.family.gains])))


def _quadrotor(noise: float) -> Callable[[int], Any]:
    return lambda seed: systems.Quadrotor(noise=noise, seed=seed)


def _harsh(seed: int) -> Any:
    return systems.Quadrotor.harsh(noise=NOISE, seed=seed)


def _harsh_in_calm_air() -> Any:
    harsh = _harsh(0)
    return systems.Quadrotor(drag=harsh.drag, motor_lag=harsh.motor_lag)


SUBJECTS: dict[str, Subject] = {
    subject.name: subject
    for subject in (
        Subject(
            "quadrotor-0",
            "final_distance",
            _quadrotor(0.0),
            systems.Quadrotor,
            what="the built-in quadrotor, no noise",
        ),
        Subject(
            "quadrotor",
            "final_distance",
            _quadrotor(NOISE),
            systems.Quadrotor,
            NOISY_RUNS,
            f"{NOISE:g} rad and {5.0 * NOISE:g} rad/s of noise on the sensors",
        ),
        Subject(
            "quadrotor-noisy",
            "final_distance",
            _quadrotor(10.0 * NOISE),
            systems.Quadrotor,
            NOISY_RUNS,
            "ten times that noise",
        ),
        Subject(
            "quadrotor-harsh",
            "iae",
            _harsh,
            _harsh_in_calm_air,
            what="the noise of `quadrotor`, with drag, a motor lag and gusts",
        ),
        Subject(
            "rotorpy",
            "iae",
            lambda seed: systems.RotorPy(noise=NOISE, seed=seed),
            systems.RotorPy,
            what="a vehicle by others, with the same noise",
        ),
    )
}
"""Systems of the exam by name."""


def subject(name: str) -> Subject:
    """A system of the exam.

    Args:
        name: its name.

    Returns:
        The system; making it may still fail where it needs what is not installed.

    Raises:
        InvalidInput: an unknown name.
    """
    if name not in SUBJECTS:
        raise unknown("system of the exam", name, SUBJECTS)
    return SUBJECTS[name]


def why_missing(name: str) -> str | None:
    """Why a system cannot be flown here; None if it can.

    Args:
        name: of the system.

    Raises:
        InvalidInput: an unknown name.
    """
    asked = subject(name)
    try:
        _ = asked.family
    except NotAvailable as reason:
        return str(reason)
    return None
