"""What a controller asks of the actuators and of the envelope, and how its quality hangs on each gain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twinloop._experiment.envelope import usages_of
from twinloop._ground.arrays import Floats
from twinloop.campaign.setup import Setup
from twinloop.law.flight import fly
from twinloop.law.twin import Twin
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory

AT_A_BOUND = 1e-6
"""Share of a range within which a value counts as at its end."""
CHANGES = (-0.2, -0.1, 0.0, 0.1, 0.2)
"""Of one gain at a time, as shares of its value."""
CHANGES_OF_NONE = (-0.05, -0.025, 0.0, 0.025, 0.05)
"""Of a gain near 0, as shares of its range: the usual value of a gain is a quarter of that."""
NEAR_NONE = 0.01
"""Share of its range below which a gain is near 0; on a logarithmic scale none is."""


@dataclass(frozen=True, eq=False)
class Effort:
    """The use of one command by a flight.

    Args:
        command: its name.
        used: root mean square of the command about the middle of its bounds, as a share of half their distance.
        saturated: share of the periods at a bound.
        moved: root mean square of its change from period to period, in the same share.
    """

    command: str
    used: float
    saturated: float
    moved: float


def effort(trajectory: Trajectory, signals: Signals) -> tuple[Effort, ...]:
    """What a flight asks of each command.

    Args:
        trajectory: with at least one command.
        signals: of the system.
    """
    found = []
    for command, sent in zip(signals.commands, trajectory.commands.T, strict=True):
        low, high = command.bounds
        half = 0.5 * (high - low)
        place = (sent - 0.5 * (low + high)) / half
        changes = np.diff(place)
        found.append(
            Effort(
                command.name,
                float(np.sqrt(np.square(place).mean())),
                float((np.abs(place) >= 1.0 - AT_A_BOUND).mean()),
                float(np.sqrt(np.square(changes).mean())) if len(changes) else 0.0,
            )
        )
    return tuple(found)


@dataclass(frozen=True)
class GainSlope:
    """The dependence of the quality on one gain.

    Args:
        gain: its name.
        value: of the gain, in its unit.
        changes: of the gain, as shares of `size`.
        size: the value; the range of the gain where the value is near 0, of which no share is a change to speak of.
        of_range: whether it is the range.
        qualities: on the twin, without noise, for each change; infinite if the flight diverges; None beyond the
            gain's bounds.
        at_bound: "", "lower" or "upper": see `Family.at_bounds`.
    """

    gain: str
    value: float
    changes: tuple[float, ...]
    size: float
    of_range: bool
    qualities: tuple[float | None, ...]
    at_bound: str


def gain_slopes(twin: Twin, setup: Setup, best: Test) -> tuple[GainSlope, ...]:
    """The quality against each gain, the others held.

    Args:
        twin: that flies.
        setup: of the campaign.
        best: test of the controller.
    """
    found = []
    bounds = setup.family.at_bounds(best.genes)
    for i, gain in enumerate(setup.family.gains):
        value = float(best.genes[i])
        span = gain.high - gain.low
        of_range = not gain.logarithmic and abs(value) < NEAR_NONE * span
        changes, size = (CHANGES_OF_NONE, span) if of_range else (CHANGES, value)
        qualities: list[float | None] = []
        for change in changes:
            tried = value + change * size
            if not gain.low <= tried <= gain.high:
                qualities.append(None)
                continue
            genes = best.genes.copy()
            genes[i] = tried
            qualities.append(_quality(twin, setup, replace(best.quiet(), genes=genes)))
        found.append(
            GainSlope(gain.name, value, changes, size, of_range, tuple(qualities), bounds[gain.name])
        )
    return tuple(found)


def _quality(twin: Twin, setup: Setup, test: Test) -> float:
    run = fly(twin.model, test, limits=twin.limits)
    return setup.quality.flown(run, test.target_state) if run.steps == test.steps else float("inf")


def strongest_commands(flight: Trajectory, signals: Signals, state: int) -> list[int]:
    """The two commands that go most with a state, or with its derivative where that is declared; all if there are few.

    Args:
        flight: flown or predicted.
        signals: of the system.
        state: its place.

    Returns:
        Their places, in order.
    """
    if signals.n_u <= 2:
        return list(range(signals.n_u))
    name = signals.state_names[state]
    rate = next((k for k, s in enumerate(signals.states) if s.derivative_of == name), state)
    values = np.diff(flight.states[:, rate])
    sent = flight.commands - flight.commands.mean(axis=0)
    together = np.abs((sent * (values - values.mean())[:, np.newaxis]).sum(axis=0))
    size = together / (1e-12 + np.sqrt(np.square(sent).sum(axis=0)))
    return sorted(np.argsort(-size, kind="stable")[:2].tolist())


def envelope_use(states: Floats, signals: Signals) -> tuple[tuple[str, float], ...]:
    """The most that each state with an envelope uses of it: 1 at a bound.

    Args:
        states: (n, n_x).
        signals: of the system.
    """
    return tuple(
        (state.name, float(usages_of(signals, states, state).max()))
        for state in signals.states
        if state.envelope is not None
    )


def outside_of(flown: Floats, planned: Floats) -> float:
    """Share of planned rows that lie beyond the smallest box around what was flown, in any column.

    Args:
        flown: rows (n, c).
        planned: rows (m, c).
    """
    low, high = flown.min(axis=0), flown.max(axis=0)
    room = 1e-9 * (high - low)
    return float(((planned < low - room) | (planned > high + room)).any(axis=1).mean())
