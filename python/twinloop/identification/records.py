"""Recorded runs as regression needs them: readings, weights, and the inputs of a model within each period."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop.arrays import Floats
from twinloop.law.actuation import Actuation
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class Run:
    """One recorded run.

    Args:
        states: readings (n + 1, n_x).
        commands: (n, n_u).
        weights: 1 for a reading that counts, 0 for one that is ignored (n + 1, n_x).
        smooth: what the states are taken to have been (n + 1, n_x); the readings until a model knows better.
    """

    states: Floats
    commands: Floats
    weights: Floats
    smooth: Floats

    @staticmethod
    def of(states: Floats, commands: Floats) -> Run:
        """A run of which every reading counts."""
        return Run(states, commands, np.ones_like(states), states)

    def continued(self, signals: Signals) -> Run:
        """The run with periodic states that go on from reading to reading by the short way."""
        states = signals.continued(self.states, self.states[0])
        shifted = states - self.states
        return self if states is self.states else replace(self, states=states, smooth=self.smooth + shifted)

    def part(self, first: int, last: int) -> Run:
        """The run from one period to another."""
        rows = slice(first, last + 1)
        return Run(self.states[rows], self.commands[first:last], self.weights[rows], self.smooth[rows])


@dataclass(frozen=True, eq=False)
class Stages:
    """Inputs of a model at the start, the middle and the end of each period (rows, inputs), all runs in one."""

    start: Floats
    middle: Floats
    end: Floats
    runs: tuple[slice, ...]


def stages(runs: Sequence[Run], signals: Signals, actuation: Actuation) -> Stages:
    """What a model sees within each period: states, effects of commands in units of their scale, hidden states.

    The state in the middle is Hermite's where a state's derivative is another, and the mean elsewhere.

    Args:
        runs: recorded.
        signals: of the system.
        actuation: between commands and model.

    Returns:
        The three sets of inputs.
    """
    scales = np.array([command.size for command in signals.commands])
    parts: list[tuple[Floats, Floats, Floats]] = []
    slices, first = [], 0
    for run in runs:
        before, after = run.smooth[:-1], run.smooth[1:]
        middle = 0.5 * (before + after)
        for i, state in enumerate(signals.states):
            if state.derivative_of is not None:
                parent = signals.state_names.index(state.derivative_of)
                middle[:, parent] += signals.dt / 8.0 * (before[:, i] - after[:, i])
        effects = actuation.effects(signals, run.commands)
        parts.append(
            tuple(  # type: ignore[arg-type]
                np.hstack([signals.wrapped(x), e[:, : signals.n_u] / scales, e[:, signals.n_u :]])
                for x, e in zip((before, middle, after), effects, strict=True)
            )
        )
        slices.append(slice(first, first + len(before)))
        first += len(before)
    start, middle, end = (np.concatenate(stage) for stage in zip(*parts, strict=True))
    return Stages(start, middle, end, tuple(slices))


def guessed_noise(runs: Sequence[Run], scales: Floats) -> Floats:
    """Variance of each sensor as if all that changes faster than a parabola were noise; a first guess from above.

    Args:
        runs: recorded.
        scales: of the states (n_x,).

    Returns:
        Variances (n_x,), never below what rounding leaves.
    """
    thirds = [np.diff(run.states, n=3, axis=0) for run in runs if len(run.states) > 3]
    low = (1e-7 * scales) ** 2
    if not thirds:
        return low
    squares = np.sort(np.concatenate(thirds) ** 2, axis=0)
    # The median of a squared normal number is 0.4549; a third difference has 20 times the variance.
    guess: Floats = np.maximum(squares[len(squares) // 2] / (0.4549 * 20.0), low)
    return guess
