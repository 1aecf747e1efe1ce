"""Recorded runs as regression needs them: readings, weights, and the inputs of a model within each period."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.interpolation import FALLS, FEWEST, integration_error, middles, points, segments
from twinloop.identification.stored import stored
from twinloop.law.actuation import Actuation, HiddenState, partners
from twinloop.records import Recorded
from twinloop.signals import Signals

ORDERS = (3, 4, 5, 6)
"""Orders of the differences in which noise is looked for."""
SLOW = 0.6
"""Share of a state's rows that are readings at most, if its sensor is slow."""
HELD = 2.0**-47
"""Share of a reading that its rounding may take, with a tenth of it (`BEST_SENSOR`) the rounding of a sum or two."""
HELD_IN_SQUARES = 2.0**-23
"""Share of a number of which a tenth is left to see once it stands squared in a sum."""


@dataclass(frozen=True, eq=False)
class Run(Recorded, kind="run"):
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

    @property
    def engine(self) -> tuple[Floats, Floats, Floats]:
        """Readings, weights and commands, as the engine takes them."""
        return self.states, self.weights, self.commands

    def continued(self, signals: Signals) -> Run:
        """The run with periodic states that go on from reading to reading by the short way."""
        if not signals.periods:
            return self
        states = signals.continued(self.states, self.states[0])
        return replace(self, states=states, smooth=self.smooth + (states - self.states))

    def part(self, first: int, last: int) -> Run:
        """The run from one period to another."""
        rows = slice(first, last + 1)
        return Run(self.states[rows], self.commands[first:last], self.weights[rows], self.smooth[rows])


@dataclass(frozen=True, eq=False)
class Stages:
    """Inputs of a model at the start, the middle and the end of each period (rows, inputs), all runs in one.

    `integration` is the variance, a period, of what integrating through them leaves of what moves each state (n_x,).
    """

    start: Floats
    middle: Floats
    end: Floats
    runs: tuple[slice, ...]
    integration: Floats

    def storing(self, hidden: Sequence[HiddenState], signals: Signals) -> Stages:
        """The same with hidden states behind its inputs that are integrated with the states."""
        found = self
        for place, one in enumerate(hidden):
            if partners(hidden)[place] < place:
                continue
            start, middle, end = stored(one, (self.start, self.middle, self.end), self.runs, signals)
            found = replace(
                found,
                start=np.column_stack([found.start, start]),
                middle=np.column_stack([found.middle, middle]),
                end=np.column_stack([found.end, end]),
            )
        return found


def stages(runs: Sequence[Run], signals: Signals, actuation: Actuation) -> Stages:
    """What a model sees within each period: states, effects of commands in units of their scale, hidden states.

    The state in the middle is Hermite's where a state's derivative is another.

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
    all_effects = [actuation.effects(signals, run.commands) for run in runs]
    between = [segments(effects[0], effects[2]) for effects in all_effects]
    pieces = [run.smooth[part] for run, rows in zip(runs, between, strict=True) for part in rows]
    numbers = points(pieces)
    for run, effects, rows in zip(runs, all_effects, between, strict=True):
        before, after = run.smooth[:-1], run.smooth[1:]
        middle = middles(run.smooth, rows, numbers)
        for i, state in enumerate(signals.states):
            if state.derivative_of is not None:
                parent = signals.state_names.index(state.derivative_of)
                middle[:, parent] = 0.5 * (before[:, parent] + after[:, parent])
                middle[:, parent] += signals.dt / 8.0 * (before[:, i] - after[:, i])
        parts.append(
            tuple(  # type: ignore[arg-type]
                np.hstack([signals.wrapped(x), e[:, : signals.n_u] / scales, e[:, signals.n_u :]])
                for x, e in zip((before, middle, after), effects, strict=True)
            )
        )
        slices.append(slice(first, first + len(before)))
        first += len(before)
    start, middle, end = (np.concatenate(stage) for stage in zip(*parts, strict=True))
    noise = guessed_noise(runs, np.array([state.scale for state in signals.states]))
    found = Stages(start, middle, end, tuple(slices), integration_error(pieces, noise))
    return found.storing(actuation.stored, signals)


def guessed_noise(runs: Sequence[Run], scales: Floats) -> Floats:
    """Variance of each sensor as if all that no polynomial follows were noise; a first guess from above.

    Noise looks the same in differences of any order, once divided by what they multiply it by; motion fades from order
    to order where it is smooth: as long as it does, the next order is taken.

    Args:
        runs: recorded.
        scales: of the states (n_x,).

    Returns:
        Variances (n_x,), never below what rounding leaves.
    """
    guess = np.full(len(scales), np.inf)
    for order in ORDERS:
        differences = [np.diff(run.states, n=order, axis=0) for run in runs if len(run.states) > order]
        if sum(len(found) for found in differences) < (1 if order == ORDERS[0] else FEWEST):
            break
        squares = np.sort(np.square(np.concatenate(differences)), axis=0)
        # The median of a squared normal number is 0.4549.
        found = squares[len(squares) // 2] / (0.4549 * math.comb(2 * order, order))
        guess = np.where(found < FALLS * guess, found, guess)
    least = rounding(runs, scales)
    answer: Floats = np.where(np.isfinite(guess), np.maximum(guess, least), least)
    for i in range(len(scales)):
        # Of a slow sensor what lies between its readings is a polynomial by itself.
        new = [run.weights[:, i] > 0.0 for run in runs]
        if any(rows.any() for rows in new) and max(map(np.mean, new)) < SLOW:
            read = [
                Run.of(run.states[rows, i : i + 1], run.commands) for run, rows in zip(runs, new, strict=True)
            ]
            answer[i] = guessed_noise(read, scales[[i]])[0]
    return answer


def rounding(runs: Sequence[Run], scales: Floats) -> Floats:
    """Variance that readings are taken to have at least about a polynomial: ten deviations of what rounding leaves.

    A number of 53 bits holds 2^-53 of a reading; a sum of squares as much of what moves a state from one reading to the
    next squared, which is 2^-26 of that move.

    Args:
        runs: recorded.
        scales: of the states (n_x,), for states that never left 0.

    Returns:
        Variances (n_x,), above 0.
    """
    moves = np.concatenate([np.diff(run.states, axis=0) for run in runs])
    moved = np.sqrt(np.square(moves).mean(axis=0)) if len(moves) else np.zeros(len(scales))
    sizes = np.max([np.abs(run.states).max(axis=0) for run in runs], axis=0)
    least = np.maximum(moved * HELD_IN_SQUARES, sizes * HELD)
    deviations = np.where(least > 0.0, least, scales * HELD)
    variances: Floats = deviations * deviations
    return variances
