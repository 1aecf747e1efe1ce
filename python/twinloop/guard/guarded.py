"""A system whose every run is guarded: what `campaign.run` flies where a guard shall watch."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._experiment.hold_back import HoldBack
from twinloop._ground.arrays import Floats, floats
from twinloop.controllers import Controller, Family
from twinloop.controllers.custom import Law
from twinloop.errors import InvalidInput
from twinloop.guard.guard import Guard
from twinloop.records import Record, Recorded
from twinloop.signals import Signals
from twinloop.systems.base import System
from twinloop.test import Test
from twinloop.trajectory import Trajectory

GUARDED = "guarded"
"""Kind of the record of a system that is guarded: a command that reads it has no guard to fly it with."""


class Guarded(System):
    """Runs tests with a guard in the loop; if the guard ends a run, the run up to there is returned as aborted.

    The system continues under the fallback to the end of the test; `flown` has that run, `guard` the guard.

    Args:
        system: anything with `signals` and `run(test)` that closes the loop with the test's controller.
        guard: makes the guard of a test.
    """

    def __init__(self, system: System, guard: Callable[[Test], Guard]) -> None:
        self.system = system
        self.make = guard
        self.guard: Guard | None = None
        self.flown: Trajectory | None = None
        gains = getattr(system, "default_gains", None)
        if gains is not None:
            self.default_gains = gains

    @property
    def signals(self) -> Signals:
        """Of the system."""
        return self.system.signals

    @property
    def runs(self) -> int:
        """Runs that the system has made, if it counts them: the noise of its next one may depend on it."""
        runs: int = getattr(self.system, "runs")  # noqa: B009 - a system need not declare it
        return runs

    @runs.setter
    def runs(self, runs: int) -> None:
        setattr(self.system, "runs", runs)  # noqa: B010 - a system need not declare it

    def run(self, test: Test) -> Trajectory:
        """Runs one experiment.

        Args:
            test: what to fly.

        Returns:
            The measured run, up to the moment when the guard tripped. If that was a reading that is none, which no
            record holds, it ends a period sooner; and where the system cannot make a record with it, what the guard has
            recorded is the run.

        Raises:
            InvalidInput: the system did not ask the test's controller for every command, so that nobody watched.
        """
        self.flown = None
        self.guard = guard = self.make(test)
        try:
            self.flown = run = self.system.run(led_by(guard, test))
        except InvalidInput:
            if guard.tripped_at is None or guard.tripped_at > test.steps:
                raise
            return guard.trajectory()
        if guard.period < run.steps:
            raise InvalidInput(
                f"Guarded: expected a system that asks test.controller() for the command of each period, found one that"
                f" asked {guard.period} times in {run.steps} periods, so that no guard watched; let its run(test) close"
                " the loop with it. The run is in `flown`."
            )
        if guard.tripped_at is None or guard.tripped_at > run.steps:
            return run
        steps = guard.recorded
        return dataclasses.replace(
            run,
            t=run.t[: steps + 1],
            states=run.states[: steps + 1],
            commands=run.commands[:steps],
            ended="aborted",
            reason=guard.reason,
            true_states=None if run.true_states is None else run.true_states[: steps + 1],
            band=None if run.band is None else run.band[:, : steps + 1],
        )


def record_of(system: object) -> Record | None:
    """The record of a system, which says whether it is guarded; None where it has none.

    Args:
        system: guarded or not.
    """
    if isinstance(system, Guarded):
        record = record_of(system.system)
        return None if record is None else {"kind": GUARDED, "version": 1, "system": record}
    return system.to_record() if isinstance(system, Recorded) else None


def unguarded(record: Record) -> Record:
    """The record of a system by itself, guarded or not.

    Args:
        record: of a system.
    """
    return unguarded(record["system"]) if record["kind"] == GUARDED else record


def led_by(law: Law, test: Test) -> Test:
    """The same test with somebody else in the loop, who adds the excitation himself, or does not.

    Readings come to him as they are: NaN, for a missing one, is his affair.

    Args:
        law: with `reset()` and `command(state, target)`.
        test: that a system shall run.

    Returns:
        A test that no campaign knows.
    """
    family = test.family
    gains = [gain.engine for gain in family.law_gains]
    engine = _core.Family.python(family.signals.engine, lambda values: law, gains)
    return dataclasses.replace(test.quiet(), family=_Led(family.signals, family.law_gains, engine, law))


@dataclasses.dataclass(frozen=True, eq=False)
class _Led(Family):
    """A family whose only controller is somebody else.

    Args:
        law: who commands.
    """

    law: Law

    def controller(
        self, genes: ArrayLike, excitation: ArrayLike | None = None, hold_back: HoldBack | None = None
    ) -> Controller:
        """He, for one run."""
        return _AsRead(self, floats("Genes", genes, (self.size,)))


class _AsRead(Controller):
    """A controller that hands readings on as they are."""

    def command(self, state: ArrayLike, target: ArrayLike) -> Floats:
        """The command for the coming period, within its bounds; see `Controller.command`."""
        assert isinstance(self.family, _Led)
        commands = self.family.signals.commands
        low, high = np.array([command.bounds for command in commands]).T
        given = cast(Floats, state), cast(Floats, target)
        sent = floats("Command", self.family.law.command(*given), (len(commands),))
        return np.clip(sent, low, high)
