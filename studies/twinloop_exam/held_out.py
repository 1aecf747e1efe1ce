"""A hundred controllers that no learner has flown, and how far a twin is off under each of them."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop_exam.quality import true_states
from twinloop_exam.systems import Subject

COUNT = 100
SEED = 20_090_518


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Controllers and the true runs under them.

    Args:
        tests: one for each controller; no noise, no excitation.
        states: true states (n + 1, n_x) of each, SI units, radians.
    """

    tests: Sequence[Test]
    states: Sequence[Floats]

    def errors(self, simulate: Callable[[Test], Trajectory]) -> Floats:
        """Normalised closed-loop error of a twin under each controller; 1 is a model that never moves.

        Args:
            simulate: flies a test on the twin.

        Returns:
            Errors (tests,): mean squared error over that of the model that never moves on the same test; infinite for
            a run that ends before the truth does.
        """
        return np.array(
            [
                normalised_error(simulate(test), states)
                for test, states in zip(self.tests, self.states, strict=True)
            ]
        )

    def packed(self) -> bytes:
        """The true runs, to be kept."""
        buffer = io.BytesIO()
        arrays: dict[str, Any] = {str(i): states for i, states in enumerate(self.states)}
        np.savez_compressed(buffer, **arrays)
        return buffer.getvalue()


def normalised_error(simulated: Trajectory, truth: Floats) -> float:
    """Error of one simulated run over that of the model that never moves.

    Args:
        simulated: run of the twin, cut where it diverges.
        truth: true states (n + 1, n_x).

    Returns:
        At least 0; infinite where the twin diverges.
    """
    steps = len(truth) - 1
    if steps == 0:
        return 1.0  # a truth that was cut at once tells no twin from one that never moves
    if simulated.steps < steps:
        return math.inf
    wrong = true_states(simulated)[1 : steps + 1] - truth[1:]
    moved = truth[1:] - truth[0]
    frozen = float(np.mean(moved**2))
    error = float(np.mean(wrong**2))
    if frozen == 0.0:
        return 0.0 if error == 0.0 else math.inf
    return error / frozen


def controllers(subject: Subject) -> Floats:
    """The held-out gains: uniform in the box, the same whenever they are asked for.

    Args:
        subject: the system.

    Returns:
        Genes (100, size), in their units.
    """
    draw = np.random.Generator(np.random.Philox(np.random.SeedSequence([SEED])))
    low = np.array([gain.low for gain in subject.family.gains])
    high = np.array([gain.high for gain in subject.family.gains])
    return np.asarray(low + (high - low) * draw.random((COUNT, subject.family.size)))


def fly(subject: Subject) -> HeldOut:
    """Flies the held-out controllers on the truth.

    Args:
        subject: the system.

    Returns:
        The controllers with their true runs.
    """
    tests = [subject.test(genes) for genes in controllers(subject)]
    return HeldOut(tests, [true_states(subject.true_rig.run(test)) for test in tests])


def unpacked(subject: Subject, kept: bytes) -> HeldOut:
    """The held-out set from runs that were kept.

    Args:
        subject: the system.
        kept: as `HeldOut.packed`.

    Returns:
        The controllers with their true runs.
    """
    with np.load(io.BytesIO(kept), allow_pickle=False) as runs:
        states = [np.asarray(runs[str(i)], dtype=np.float64) for i in range(COUNT)]
    return HeldOut([subject.test(genes) for genes in controllers(subject)], states)
