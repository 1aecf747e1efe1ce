"""Plants written as equations: integrated finely, with whatever is between commands, states and sensors."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.signals import Signals
from twinloop.systems.stepped import Deviations, Stepped
from twinloop.test import Test
from twinloop.trajectory import Trajectory

Row = Sequence[float]
Derivative = Callable[[Row, Row], Row]
"""(inner state, command) -> derivative of the inner state, 1/s."""
Advance = Callable[[Row, Row, float], Row]
"""(inner state, command, step in s) -> inner state a step later."""


def runge_kutta(derivative: Derivative) -> Advance:
    """The classic method of order four.

    Args:
        derivative: of the inner state.
    """

    def advance(z: Row, u: Row, h: float) -> Row:
        k1 = derivative(z, u)
        k2 = derivative([a + 0.5 * h * b for a, b in zip(z, k1, strict=True)], u)
        k3 = derivative([a + 0.5 * h * b for a, b in zip(z, k2, strict=True)], u)
        k4 = derivative([a + h * b for a, b in zip(z, k3, strict=True)], u)
        return [
            a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(z, k1, k2, k3, k4, strict=True)
        ]

    return advance


def _itself(row: Row) -> Row:
    return row


@dataclass(frozen=True)
class Mechanism:
    """How a plant moves.

    Args:
        advance: its inner state.
        substeps: of `advance` in a period.
        inner: the inner state that a state (n_x,) at rest stands for.
        outer: the state (n_x,) of an inner state.
        delay: whole periods before a command acts.
        rest: the command that acts until then (n_u,).
        late: by how many of the sub-steps each state is read late (n_x,); empty: not at all.
    """

    advance: Advance
    substeps: int = 10
    inner: Callable[[Row], Row] = _itself
    outer: Callable[[Row], Row] = _itself
    delay: int = 0
    rest: Row = ()
    late: Sequence[int] = ()


class Machine(Stepped):
    """A plant of equations.

    `true_states` are the states at each sample, without noise, even where sensors are late.

    Args:
        signals: its states, commands and period.
        mechanism: how it moves.
        noise: standard deviations of the sensors, in the units of the states.
        seed: of the noise; None: there is none.
    """

    def __init__(
        self, signals: Signals, mechanism: Mechanism, noise: Deviations, seed: int | None = None
    ) -> None:
        super().__init__(signals, noise=0.0 if seed is None else noise, seed=seed or 0)
        self.mechanism = mechanism

    def _begin(self, test: Test) -> _Run:
        return _Run(self, test)


class _Run:
    """One run: the inner state, the commands that are under way, and what sensors have not told yet."""

    def __init__(self, machine: Machine, test: Test) -> None:
        self.mechanism, self.dt = machine.mechanism, machine.signals.dt
        self.start = np.array(test.initial_state)
        self.z: Row = list(self.mechanism.inner(self.start.tolist()))
        self.under_way = [list(self.mechanism.rest)] * self.mechanism.delay
        self.path = [self.start.tolist()] * (1 + max(self.mechanism.late, default=0))
        self.states = [self.start]

    def __call__(self, state: Floats, command: Floats) -> Floats:
        """The state as sensors without noise read it one period later."""
        m = self.mechanism
        self.under_way.append(command.tolist())
        acting = self.under_way.pop(0)
        try:
            for _ in range(m.substeps):
                self.z = m.advance(self.z, acting, self.dt / m.substeps)
                if m.late:
                    self.path = [*self.path[1:], list(m.outer(self.z))]
        except (OverflowError, ZeroDivisionError, ValueError):  # the run has diverged
            self.z = [float("nan")] * len(self.z)
            return np.full(len(self.start), np.nan)
        here = np.array(m.outer(self.z), dtype=np.float64)
        self.states.append(here)
        if not m.late:
            return here
        return np.array([self.path[-1 - steps][i] for i, steps in enumerate(m.late)])

    def finished(self, flown: Trajectory) -> Trajectory:
        """With the states at the samples themselves."""
        return dataclasses.replace(flown, true_states=np.array(self.states[: flown.steps + 1]))

    def close(self) -> None:
        """Nothing is held."""
