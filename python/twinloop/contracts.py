"""What a system or a family of controllers must keep to; reusable checks, for us and for third parties."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop.controllers import Family, UnboundFamily
from twinloop.errors import TwinloopError
from twinloop.signals import Signals
from twinloop.systems import System
from twinloop.test import Test
from twinloop.trajectory import check_recorded, completed
from twinloop.unmeasured import completed_state

__all__ = ["ContractBroken", "check_controller", "check_system"]


class ContractBroken(TwinloopError, AssertionError):
    """A requirement that a system or controller violates."""


def check_system(
    system: System,
    controller: UnboundFamily | None = None,
    *,
    gains: Mapping[str, float] | None = None,
    initial_state: Floats | None = None,
    target_state: Floats | None = None,
    steps: int = 20,
) -> None:
    """Runs a short test on a system and checks its result.

    Args:
        system: to check.
        controller: a family to fly; by default the system's own.
        gains: by name; by default the system's own.
        initial_state: (n_x,), SI units, radians; by default the system's own, or zeros.
        target_state: (n_x,), the same units; by default the system's own, or zeros.
        steps: length of the test.

    Raises:
        ContractBroken: a requirement that is violated, with the value that was found.
        InvalidInput: a trajectory that cannot be learnt.
    """
    signals = system.signals
    _promise(isinstance(signals, Signals), f"signals to be twinloop.Signals, found {type(signals).__name__}")
    described = controller or getattr(system, "controller", None)
    chosen = gains or getattr(system, "default_gains", None)
    _promise(
        described is not None and chosen is not None, "a controller and gains to fly, found none; pass them"
    )
    assert described is not None and chosen is not None
    family: Family = described.bind(signals)
    start = _first(initial_state, getattr(system, "initial_state", None), np.zeros(signals.n_x))
    target = _first(target_state, getattr(system, "target_state", None), np.zeros(signals.n_x))
    start, target = (completed_state("Start and target", end, signals) for end in (start, target))
    test = Test(family, family.genes(chosen), start, target, steps)
    trajectory = completed(system.run(test), signals, test.initial_state)
    check_recorded(trajectory, Limits(signals), steps)
    if trajectory.ended == "completed":
        _promise(trajectory.steps == steps, f"a completed run of {steps} steps, found {trajectory.steps}")
    else:
        _promise(bool(trajectory.reason), f"a reason why the run ended as {trajectory.ended!r}, found none")
    for command, sent in zip(signals.commands, trajectory.commands.T, strict=True):
        low, high = command.bounds
        inside = bool((sent >= low).all() and (sent <= high).all())
        _promise(inside, f"{command.name} within {low:g} to {high:g}, found {sent.min():g} to {sent.max():g}")
    again = completed(system.run(test), signals, test.initial_state)
    # Whose sensors are exact answers alike, unless it says that something else is noisy.
    exact = trajectory.true_states is not None and np.allclose(
        trajectory.states, trajectory.true_states, rtol=0.0, atol=1e-6 * min(s.scale for s in signals.states)
    )
    if exact and not np.any(getattr(system, "noise", 0.0)):
        same = again.states.tobytes() == trajectory.states.tobytes()
        _promise(same, "a system without noise to answer a test twice alike, found two different runs")


def check_controller(family: UnboundFamily, signals: Signals, seed: int = 0) -> None:
    """Draws controllers of a family and checks that they are bounded and repeatable, and that `reset` works.

    Args:
        family: to check.
        signals: for the family.
        seed: of the drawn gains and states.

    Raises:
        ContractBroken: a requirement that is violated, with the value that was found.
    """
    bound = family.bind(signals)
    low = np.array([gain.low for gain in bound.gains])
    high = np.array([gain.high for gain in bound.gains])
    scales = np.array([state.scale for state in signals.states])
    bounds = np.array([command.bounds for command in signals.commands])
    stream = np.random.default_rng(seed)
    for _ in range(20):
        controller = bound.controller(low + (high - low) * stream.random(bound.size))
        _promise(
            len(controller.parameters) == len(bound.law_gains),
            f"{len(bound.law_gains)} named gains, found {controller.parameters}",
        )
        states = scales * stream.uniform(-1.0, 1.0, (10, signals.n_x))
        target = scales * stream.uniform(-1.0, 1.0, signals.n_x)
        first = np.array([controller.command(state, target) for state in states])
        _promise(
            first.shape == (10, signals.n_u), f"commands of shape ({signals.n_u},), found {first.shape[1:]}"
        )
        inside = bool((first >= bounds[:, 0]).all() and (first <= bounds[:, 1]).all())
        _promise(inside, f"commands within their bounds, found {first.min(axis=0)} to {first.max(axis=0)}")
        controller.reset()
        second = np.array([controller.command(state, target) for state in states])
        _promise(
            first.tobytes() == second.tobytes(),
            "reset() to forget the run before, found other commands after it",
        )


def _first(*candidates: Floats | None) -> Floats:
    return next(candidate for candidate in candidates if candidate is not None)


def _promise(kept: bool, sentence: str) -> None:
    if not kept:
        raise ContractBroken(f"Expected {sentence}.")
