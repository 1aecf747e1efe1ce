"""The real thing: whatever has signals and runs a test."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory


@runtime_checkable
class System(Protocol):
    """A simulator, a rig, a robot. Subclass it, or write any class with these two members.

    `signals` has its states, commands and period, and may be an attribute or a property. `run` flies a test. A system
    may also offer `default_gains`, a safe first controller, by name; and `stop()`, which ends a run that is interrupted
    or given up while it is on a thread of its own.
    """

    if TYPE_CHECKING:

        @property
        def signals(self) -> Signals:
            """Its states, commands and period."""
            ...
    else:
        # A property here would let no subclass say `self.signals = ...`.
        signals: Signals

    def run(self, test: Test) -> Trajectory:
        """Runs one experiment.

        Args:
            test: with the controller, the initial state, the target and the number of steps.

        Returns:
            The measured run; shorter than the test if the run was cut.
        """
        ...
