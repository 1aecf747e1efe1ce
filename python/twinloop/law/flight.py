"""Flies one test on dynamics, real or learnt, through the engine's roll-out; there is no second loop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.controllers import PID, Mixer
from twinloop.errors import engine_input
from twinloop.limits import Limits
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory

Dynamics = _core.Model | _core.Quadrotor | Callable[[Floats, Floats], Floats]


def fly(
    dynamics: Dynamics,
    test: Test,
    *,
    noise: Floats | None = None,
    disturbance: Floats | None = None,
    limits: Limits | None = None,
) -> Trajectory:
    """Closes the loop of the test's controller around dynamics, with the test's excitation.

    Args:
        dynamics: an engine's model or plant, or a function (state (n_x,), command (n_u,)) -> next state.
        test: what to fly.
        noise: what the sensors add to each state (n + 1, n_x), in the units of the states; None: nothing.
        disturbance: what is added to the true state after each step (n, n_x), such as process noise or gusts,
            in the units of the states; None: nothing.
        limits: where the run counts as diverged and is cut; None: at ten times a state's scale.

    Returns:
        The measured run, with the true states beside it; cut before the step that diverged.

    Raises:
        InvalidInput: the engine refused the arguments.
    """
    within = limits or Limits(test.family.signals)
    with engine_input():
        runs = _core.rollout(
            dynamics,
            within.setting(test.family),
            test.genes[np.newaxis],
            test.task,
            noise=_one(noise),
            excitation=_one(test.excitation),
            disturbance=_one(disturbance),
        )
    return _trajectory(runs, test.steps, within)


def fly_commands(
    dynamics: _core.Model | _core.Quadrotor,
    initial_state: Floats,
    commands: Floats,
    limits: Limits,
) -> Trajectory:
    """A free run under given commands, without a controller.

    Args:
        dynamics: an engine's model or plant.
        initial_state: where it starts (n_x,), in the units of the states.
        commands: each held for a period (n, n_u), n at least 1, in their units, sent as they are.
        limits: where the run counts as diverged and is cut, with the signals of the dynamics.

    Returns:
        The run; cut before the step that diverged.

    Raises:
        InvalidInput: the engine refused the arguments.
    """
    with engine_input():
        runs = _core.replay(dynamics, limits.engine, initial_state, commands)
    return _trajectory(runs, len(commands), limits)


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


def driven(signals: Signals, initial_state: Floats, commands: Floats) -> Test:
    """A test that sends given commands, whatever the states do.

    Its controller asks for nothing, so that there is no second loop: the commands are its excitation.

    Args:
        signals: of the system.
        initial_state: where it starts (n_x,), SI units, radians.
        commands: at least one row (n, n_u), in their units; what lies beyond a bound is clipped.

    Returns:
        The test.
    """
    name = signals.state_names[0]
    gains = {f"{name}.{term}": (0.0, 1.0) for term in ("kp", "ki", "kd")}
    nothing = PID(axes=[(name, None)], gains=gains, output=Mixer(np.zeros((signals.n_u, 1))))
    family = nothing.bind(signals)
    return Test(
        family, np.zeros(family.size), initial_state, initial_state, len(commands), excitation=commands
    )


def _why_cut(last: Floats, lasted: int, limits: Limits) -> str:
    """When a run was cut, and the state that was the furthest off a period before."""
    worst = int(np.argmax(np.abs(last) / limits.states))
    state = limits.signals.states[worst]
    return (
        f"a state left {limits.divergence_factor:g} times its scale, or stopped being finite,"
        f" {(lasted + 1) * limits.signals.dt:.3g} s after the start; before that {state.name} was at"
        f" {last[worst]:.3g} {state.unit}".rstrip()
    )


def _one(rows: Floats | None) -> Floats | None:
    """What acts on the one run, as the engine wants it: an axis of runs first."""
    return None if rows is None else rows[np.newaxis]
