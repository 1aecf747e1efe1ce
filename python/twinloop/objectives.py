"""What models and tests are judged by, one function a formula, all minimised (paper, section IV)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats, Integers, floats, number
from twinloop.controllers import Family
from twinloop.errors import InvalidInput
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory

__all__ = [
    "closed_loop",
    "discrimination",
    "final_distances",
    "frozen_error",
    "instability",
    "k_step",
    "lasted",
    "normalised_error",
    "open_loop",
    "selected_tests",
]


def selected_tests(
    tests: Sequence[Test], trajectories: Sequence[Trajectory], limits: Limits | None = None
) -> _core.SelectedTests:
    """Tests with their measured runs, as the engine judges models on them.

    Args:
        tests: at least one, all of one family.
        trajectories: one for each test.
        limits: magnitudes at which a run has diverged; None: ten times each state's scale.

    Returns:
        The engine's set of selected tests.

    Raises:
        InvalidInput: none, another number of trajectories, or shapes that do not fit.
    """
    if not tests or len(tests) != len(trajectories):
        raise InvalidInput(
            f"Selected tests: expected a trajectory for each of at least one test, found {len(tests)} tests"
            f" and {len(trajectories)} trajectories; pass both in the same order."
        )
    family = tests[0].family
    selected = _core.SelectedTests((limits or Limits(family.signals)).setting(family.engine))
    for test, trajectory in zip(tests, trajectories, strict=True):
        selected = selected.with_test(
            test.genes, test.target_state, trajectory.states, trajectory.commands, test.excitation,
            None if test.hold_back is None else test.hold_back.engine,
        )  # fmt: skip
    return selected


def open_loop(
    models: Sequence[_core.Model], selected: _core.SelectedTests, workers: _core.Workers | None = None
) -> Floats:
    """One-step-ahead error: mean squared error of M(ω_t, η_t) against η_{t+1} (paper, section IV.B).

    The memory of a model with lags, delays or hidden states follows the recorded commands of each test from its
    beginning. The model predicts from each recorded state with that memory.

    Args:
        models: m of them.
        selected: N tests with their trajectories.
        workers: threads of the engine; one by default.

    Returns:
        Errors (m, N), SI units squared, mean over steps and components; infinite where a prediction is not finite.

    Raises:
        InvalidInput: models for other signals.
    """
    return _core.open_loop(models, selected, workers)


def closed_loop(
    models: Sequence[_core.Model], selected: _core.SelectedTests, workers: _core.Workers | None = None
) -> Floats:
    """Free-run error with the controller in the loop (paper, section IV.B).

    Args:
        models: m of them.
        selected: N tests with their trajectories.
        workers: threads of the engine; one by default.

    Returns:
        Errors (m, N), SI units squared, mean over the n predicted states and all components; infinite for a run that
        diverged; `lasted` gives its length. Only the ranking of the paper's model loop uses a finite number instead.

    Raises:
        InvalidInput: models for other signals.
    """
    return _core.closed_loop(models, selected, workers)[0]


def lasted(
    models: Sequence[_core.Model], selected: _core.SelectedTests, workers: _core.Workers | None = None
) -> Integers:
    """Number of steps of free runs with the controller in the loop, before they diverge.

    Args:
        models: m of them.
        selected: N tests with their trajectories.
        workers: threads of the engine; one by default.

    Returns:
        Steps (m, N); all recorded steps of the test if the run does not diverge.

    Raises:
        InvalidInput: models for other signals.
    """
    return _core.closed_loop(models, selected, workers)[1]


def k_step(
    models: Sequence[_core.Model],
    selected: _core.SelectedTests,
    steps: int,
    workers: _core.Workers | None = None,
) -> Floats:
    """Error k steps ahead: of free runs of k steps from every recorded state, under the recorded commands.

    It lies between the one-step error, which hardly shows accumulated errors, and the free run, which after a while
    shows nothing else. Lags, delays and hidden states start each run with the memory of the earlier commands.

    Args:
        models: m of them.
        selected: N tests with their trajectories.
        steps: k, from 1, which gives `open_loop`, to the steps of the shortest test.
        workers: threads of the engine; one by default.

    Returns:
        Errors (m, N), SI units squared, mean over the n + 1 − k predictions and all components; infinite where a
        prediction is not finite.

    Raises:
        InvalidInput: models for other signals, or a test that is shorter.
    """
    return _core.k_step(models, selected, steps, workers)


def frozen_error(trajectory: Trajectory, signals: Signals | None = None) -> float:
    """Closed-loop error of the model that never moves (specification, section 3).

    Args:
        trajectory: a recorded run of at least one step.
        signals: of the system; None if no state is periodic.

    Returns:
        Mean square of states 1 to n minus state 0, over steps and components, SI units squared.

    Raises:
        InvalidInput: a trajectory without steps.
    """
    if trajectory.steps < 1:
        raise InvalidInput("Frozen error: expected at least one step, found none; record a longer run.")
    states = trajectory.states
    moved = states[1:] - states[0] if signals is None else signals.difference(states[1:], states[0])
    return float(math.fsum((moved * moved).ravel().tolist()) / moved.size)


def normalised_error(closed_loop_error: float, frozen: float) -> float:
    """Closed-loop error over that of the model that never moves; 1 means useless.

    Args:
        closed_loop_error: of a model on a test.
        frozen: `frozen_error` of the test's trajectory.

    Returns:
        The ratio; infinite if the run diverged, or if the system never moved and the model did.
    """
    if frozen > 0.0:
        return closed_loop_error / frozen
    return 1.0 if closed_loop_error == 0.0 else math.inf


def final_distances(
    models: Sequence[_core.Model],
    family: Family,
    genes: ArrayLike,
    task: _core.Task,
    *,
    limits: Limits | None = None,
    workers: _core.Workers | None = None,
) -> Floats:
    """Final distance δ of tests on models (paper, section IV.C).

    Args:
        models: m of them.
        family: of the controllers.
        genes: gains of k tests (k, size), in their units.
        task: start, target and length of all of them.
        limits: magnitudes at which a run has diverged; None: ten times each state's scale.
        workers: threads of the engine; one by default.

    Returns:
        Distances (m, k); infinite where the run diverged.

    Raises:
        InvalidInput: shapes that do not fit.
    """
    return _core.final_distances(
        models, (limits or Limits(family.signals)).setting(family.engine), genes, task, workers=workers
    )  # fmt: skip


def discrimination(distances: ArrayLike, cap: float) -> Floats:
    """1 / (variance over models + 1e-9) of capped final distances (paper, section IV.C).

    Args:
        distances: (models, tests), infinite where a run diverged.
        cap: largest distance that counts.

    Returns:
        One objective per test (tests,), to be minimised.

    Raises:
        InvalidInput: not a matrix, or a cap that is not above 0.
    """
    limit = number("Discrimination, cap", cap, above=0.0)
    return _core.discrimination(_capped(distances, limit), limit)


def instability(distances: ArrayLike, cap: float) -> Floats:
    """Variance over mutants of a test's final distance on the best model (paper, section IV.C).

    Args:
        distances: (mutants, tests), infinite where a run diverged.
        cap: largest distance that counts; a mutant at the cap counts as its square.

    Returns:
        One objective per test (tests,), to be minimised.

    Raises:
        InvalidInput: not a matrix, or a cap that is not above 0.
    """
    limit = number("Instability, cap", cap, above=0.0)
    return _core.instability(_capped(distances, limit), limit)


def _capped(distances: ArrayLike, cap: float) -> Floats:
    """Distances (rows, tests) where infinity counts as the cap; NaN is refused."""
    rows = np.asarray(distances)
    if rows.dtype.kind == "f":
        rows = np.where(np.isposinf(rows), cap, rows)
    return floats("Final distances (rows, tests)", rows, (None, None))
