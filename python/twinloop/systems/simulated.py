"""A system made of a step function: somebody's simulator, called once a period."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from twinloop.arrays import Floats
from twinloop.errors import InvalidInput, SystemFailure
from twinloop.law.flight import fly
from twinloop.signals import Signals
from twinloop.systems.base import System
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory

Step = Callable[[Floats, Floats], ArrayLike]


class Simulated(System):
    """Runs tests on `step(state (n_x,), command (n_u,)) -> next state (n_x,)`.

    A run in which a state leaves ten times its scale, or stops being finite, is cut there and says so.

    Args:
        signals: its states, commands and period.
        step: the state one period later; it may keep no state of its own between runs.
        default_gains: a controller that it is safe to begin with, by name.

    Raises:
        InvalidInput: `step` cannot be called, or `signals` are none.
    """

    def __init__(
        self, signals: Signals, step: Step, *, default_gains: Mapping[str, float] | None = None
    ) -> None:
        if not isinstance(signals, Signals):
            raise InvalidInput(
                f"Simulated, signals: expected twinloop.Signals, found {signals!r}; describe them first."
            )
        if not callable(step):
            raise InvalidInput(
                f"Simulated, step: expected a function (state, command) -> next state, found {step!r}."
            )
        self._signals = signals
        self._step = step
        if default_gains is not None:
            self.default_gains = dict(default_gains)

    @property
    def signals(self) -> Signals:
        """Its states, commands and period."""
        return self._signals

    def run(self, test: Test) -> Trajectory:
        """Runs one experiment.

        Args:
            test: what to fly.

        Returns:
            The run; `ended` is "diverged" where it was cut.

        Raises:
            SystemFailure: the step function raised, or returned something that is no state.
            InvalidInput: the test is for other signals.
        """
        check_signals(test, self._signals)
        guard = _Guard(self._step, self._signals.n_x)
        try:
            return fly(guard, test)
        except SystemFailure:
            raise
        except Exception:
            if guard.failure is not None:
                raise guard.failure from guard.failure.__cause__
            raise


class _Guard:
    """A step function whose answers are checked and whose steps are counted."""

    def __init__(self, step: Step, n_x: int) -> None:
        self.step = step
        self.n_x = n_x
        self.count = 0
        self.failure: SystemFailure | None = None

    def __call__(self, state: Floats, command: Floats) -> Floats:
        number = self.count
        self.count += 1
        # Copies: what the function does to its arguments must not reach the roll-out.
        try:
            answer = self.step(np.array(state), np.array(command))
        except Exception as cause:
            self.failure = SystemFailure(
                f"The step function raised {type(cause).__name__} at step {number}: {cause}; mend it for that"
                " state and command, or return a state that is not finite to end the run there."
            )
            raise self.failure from cause
        try:
            following = np.asarray(answer, dtype=np.float64)
            if following.shape != (self.n_x,):
                raise TypeError(f"the shape {following.shape}")
        except (TypeError, ValueError) as cause:
            self.failure = SystemFailure(
                f"The step function was expected to return {self.n_x} numbers, the next state, at step"
                f" {number}; found {cause}; return an array of shape ({self.n_x},)."
            )
            raise self.failure from cause
        return following
