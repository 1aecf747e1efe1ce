"""The real thing: whatever has signals and runs a test."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory


@runtime_checkable
class System(Protocol):
    """A simulator, a rig, a robot. Subclass it, or write any class with these two members.

    A system may also offer `default_gains`, a controller that it is safe to begin with, by name.
    """

    @property
    def signals(self) -> Signals:
        """Its states, commands and period."""
        ...

    def run(self, test: Test) -> Trajectory:
        """Runs one experiment.

        Args:
            test: the controller to close the loop with, where to start, where to end, for how many steps.

        Returns:
            What was measured; shorter than the test if the run was cut.
        """
        ...
