"""Flies one test on dynamics, real or learnt, through the engine's roll-out; there is no second loop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats
from twinloop._ground.texts import in_unit
from twinloop.errors import InvalidInput
from twinloop.test import Test
from twinloop.trajectory import Trajectory

Dynamics = _core.Model | _core.Quadrotor | Callable[[Floats, Floats], Floats]


def fly(
    dynamics: Dynamics,
    test: Test | Replay,
    *,
    noise: Floats | None = None,
    disturbance: Floats | None = None,
    limits: Limits | None = None,
) -> Trajectory:
    """Flies a test: its controller closes the loop around dynamics, with its excitation; or recorded commands.

    Args:
        dynamics: an engine's model or plant, or, for a test, a function (state (n_x,), command (n_u,)) -> next state.
        test: what to fly.
        noise: what the sensors add to each reading (n + 1, n_x), in the units of the states; None: nothing.
        disturbance: what is added to the true state after each step (n, n_x), such as process noise or gusts,
            in the units of the states; None: nothing.
        limits: where the run counts as diverged and is cut; None: at ten times a state's scale.

    Returns:
        The measured run, with the true states beside it; cut before the step that diverged.

    Raises:
        InvalidInput: the engine refused the arguments.
    """
    within = limits or Limits(test.signals)
    runs = drawn_runs(dynamics, test, within, noise=_one(noise), disturbance=_one(disturbance))
    return _trajectory(runs, test.steps, within)


def drawn_runs(
    dynamics: Dynamics,
    test: Test | Replay,
    limits: Limits,
    *,
    noise: Floats | None = None,
    disturbance: Floats | None = None,
    workers: _core.Workers | None = None,
) -> _core.Runs:
    """The same test, flown once for each draw of noise and disturbance.

    Args:
        dynamics: as for `fly`.
        test: what to fly.
        limits: where a run counts as diverged and is cut.
        noise: draws of what the sensors add (m, n + 1, n_x); None: nothing.
        disturbance: draws of what is added to the true state after each step (m, n, n_x); None: nothing.
        workers: how the work is carried out.

    Returns:
        m runs; a single one without draws.

    Raises:
        InvalidInput: the engine refused the arguments.
    """
    if isinstance(test, Replay):
        if not isinstance(dynamics, (_core.Model, _core.Quadrotor)):
            raise InvalidInput(
                "Replay: expected a model or plant of the engine, found a function; fly a test."
            )
        return _core.replay(
            dynamics, limits.engine, test.initial_state, test.commands, noise=noise, disturbance=disturbance,
            anchors=_anchored(test, noise, disturbance), workers=workers,
        )  # fmt: skip
    count = _count(noise, disturbance)
    excitation = None if test.excitation is None else np.tile(test.excitation, (count, 1, 1))
    return _core.rollout(
        dynamics, limits.setting(test.family.engine), np.tile(test.genes, (count, 1)), test.task,
        noise=noise, excitation=excitation, disturbance=disturbance, workers=workers,
        hold_back=None if test.hold_back is None else test.hold_back.engine,
    )  # fmt: skip


def _count(*draws: Floats | None) -> int:
    """Number of runs."""
    return next((len(drawn) for drawn in draws if drawn is not None), 1)


def _anchored(test: Replay, noise: Floats | None, disturbance: Floats | None) -> Floats | None:
    """Where each run begins again (m, n + 1, n_x)."""
    if test.anchors is None:
        return None
    seen = 0.0 if noise is None else noise
    return np.tile(test.anchors, (_count(noise, disturbance), 1, 1)) + seen


def _trajectory(runs: _core.Runs, steps: int, limits: Limits) -> Trajectory:
    """The first of the runs."""
    lasted = int(runs.lasted[0])
    completed = lasted == steps
    reason = "" if completed else _why_cut(runs.states[0, lasted], lasted, limits)
    return Trajectory(
        limits.signals.dt * np.arange(lasted + 1, dtype=np.float64),
        runs.measured[0, : lasted + 1],
        runs.commands[0, :lasted],
        ended="completed" if completed else "diverged",
        reason=reason,
        true_states=runs.states[0, : lasted + 1],
    )


def _why_cut(last: Floats, lasted: int, limits: Limits) -> str:
    """When a run was cut, and the state that was the furthest off a period before."""
    worst = int(np.argmax(np.abs(last) / limits.states))
    state = limits.signals.states[worst]
    return (
        f"a state left {limits.divergence_factor:g} times its scale, or stopped being finite,"
        f" {(lasted + 1) * limits.signals.dt:.3g} s after the start; before that {state.name} was at"
        f" {in_unit(f'{last[worst]:.3g}', state.unit)}"
    )


def _one(rows: Floats | None) -> Floats | None:
    """What acts on the one run, as the engine wants it: an axis of runs first."""
    return None if rows is None else rows[np.newaxis]
