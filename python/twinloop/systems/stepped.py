"""Systems that move on a period at a time: steps are checked, sensors noisy if asked for, runs counted."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats, at_least_zero, whole
from twinloop.errors import InvalidInput, SystemFailure, unknown
from twinloop.law.flight import fly
from twinloop.signals import Signals
from twinloop.systems.base import System
from twinloop.systems.sensors import run_stream
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory

Step = Callable[[Floats, Floats], ArrayLike]
"""(state (n_x,), command (n_u,)) -> state (n_x,) one period later."""
Deviations = Mapping[str, float] | Sequence[float] | float
"""Standard deviations of sensors: by name of the state, one for each, or one for all; in the units of the states."""


class Episode(Protocol):
    """One run that has begun: `start` is where (n_x,), which may be elsewhere than was asked for."""

    start: Floats

    def __call__(self, state: Floats, command: Floats) -> ArrayLike:
        """The state (n_x,) one period later, under the command (n_u,)."""
        ...

    def finished(self, flown: Trajectory) -> Trajectory:
        """The run as it is recorded, once it has ended."""
        ...

    def close(self) -> None:
        """Gives back what it holds, however it ended."""
        ...


class Stepped(System):
    """What `Simulated` and wrappers of other people's simulators share; a kind of them defines `_begin`.

    `runs` counts the runs that came to an end; the noise of the next one depends on it and on the seed alone.

    Args:
        signals: its states, commands and period.
        noise: standard deviations of the sensors, in the units of the states: by name, one for each state, or one for
            all; the noisy state is read and recorded.
        seed: of the noise; run r draws from a stream of (seed, r).
        default_gains: a controller that it is safe to begin with, by name.

    Raises:
        InvalidInput: no signals, or a noise or a seed that cannot be used.
    """

    def __init__(
        self,
        signals: Signals,
        *,
        noise: Deviations = 0.0,
        seed: int = 0,
        default_gains: Mapping[str, float] | None = None,
    ) -> None:
        kind = type(self).__name__
        if not isinstance(signals, Signals):
            raise InvalidInput(
                f"{kind}, signals: expected twinloop.Signals, found {signals!r}; describe them first."
            )
        self._signals = signals
        self.noise = deviations(f"{kind}, noise", noise, signals)
        self.seed = whole(f"{kind}, seed", seed)
        self.runs = 0
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
            The run; `ended` is "diverged" where a state left ten times its scale, or stopped being finite, and the run
            was cut there.

        Raises:
            SystemFailure: the system raised, or returned something that is no state.
            InvalidInput: the test is for other signals.
        """
        check_signals(test, self._signals)
        episode = self._begin(test)
        noise = None
        if self.noise.any():
            shape = (test.steps + 1, self._signals.n_x)
            noise = self.noise * run_stream(self.seed, self.runs).standard_normal(shape)
        checked = CheckedStep(episode, self._signals.n_x)
        with closing(episode):
            try:
                flown = fly(checked, dataclasses.replace(test, initial_state=episode.start), noise=noise)
            except SystemFailure:
                raise
            except Exception:
                if checked.failure is not None:
                    raise checked.failure from checked.failure.__cause__
                raise
        self.runs += 1
        return episode.finished(flown)

    def _begin(self, test: Test) -> Episode:
        """A run of a test, at its start."""
        raise NotImplementedError


def deviations(what: str, noise: Deviations, signals: Signals) -> Floats:
    """Standard deviations of sensors, one for each state.

    Args:
        what: how to call them in an error.
        noise: by name, one for each state, or one for all.
        signals: whose states they are.

    Returns:
        They (n_x,), in the units of the states.

    Raises:
        InvalidInput: an unknown state, another number of them, or one below zero.
    """
    names = signals.state_names
    if isinstance(noise, Mapping):
        for name in noise:
            if name not in names:
                raise unknown(f"state in {what}", name, names)
        found: Sequence[object] = [noise.get(name, 0.0) for name in names]
    elif np.ndim(noise) == 1:
        found = list(np.asarray(noise).tolist())
    else:
        found = [noise] * len(names)
    if len(found) != len(names):
        raise InvalidInput(
            f"{what}: expected one number for each of the states {', '.join(names)}, found {len(found)};"
            " name them: {'" + names[0] + "': …}."
        )
    return np.array([at_least_zero(f"{what} of {n}", one) for n, one in zip(names, found, strict=True)])


class CheckedStep:
    """A step function whose answers are checked and whose steps are counted.

    Args:
        step: to be checked.
        n_x: number of states that it should answer with.
    """

    def __init__(self, step: Step, n_x: int) -> None:
        self.step = step
        self.n_x = n_x
        self.count = 0
        self.failure: SystemFailure | None = None

    def __call__(self, state: Floats, command: Floats) -> Floats:
        """The state one period later."""
        number = self.count
        self.count += 1
        # Copies: what the function does to its arguments must not reach the roll-out.
        try:
            answer = self.step(np.array(state), np.array(command))
        except SystemFailure as failure:
            self.failure = failure
            raise
        except Exception as cause:
            self.failure = SystemFailure(
                f"The step function raised {type(cause).__name__} at step {number}: {cause}; correct it for that"
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
