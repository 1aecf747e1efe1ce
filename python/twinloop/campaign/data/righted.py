"""Righted: one change of a log's columns after which its commands are those that its test's controller gives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, combinations, product

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.data.excited import NEARER, apart, as_excited, excited, given, hows
from twinloop.campaign.data.odd_one_out import UNITS
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop.unmeasured import completed_readings

LITTLE = 0.02
"""Share of their bounds by which commands may differ whatever they do."""
FOLLOWED = 0.1
"""Share of what the controller's commands do, in squares, that recorded ones may leave of it after a change: one that
stands still is near to many that hardly move."""
SHOWN = 20
"""Share of the rows, inverted, that shows most wrong changes: a controller takes its time for each row."""
ROUNDED = 1.0 + 1e-9
"""Times that a sum over some rows may be the one over all."""
FACTORS = (*UNITS, *(1.0 / unit for unit in UNITS))


@dataclass(frozen=True, eq=False)
class Change:
    """A log with other columns.

    Args:
        words: what was changed, after "with".
        states: readings (n + 1, n_x) then.
        commands: as sent (n, n_u) then.
    """

    words: str
    states: Floats
    commands: Floats


def exchanged_states(test: Test, run: Trajectory) -> Iterator[Change]:
    """Any two states whose columns are exchanged, whatever their units.

    Args:
        test: that the run is told as a flight of.
        run: that was recorded.
    """
    names = test.signals.state_names
    for i, j in combinations(test.signals.measured, 2):
        states = run.states.copy()
        states[:, [i, j]] = run.states[:, [j, i]]
        yield _of_states(f"{names[i]} and {names[j]} exchanged", states, run, test.signals)


def other_signs(test: Test, run: Trajectory) -> Iterator[Change]:
    """The other sign of a command, of a state, or of a state with its derivatives.

    Args:
        test: that the run is told as a flight of.
        run: that was recorded.
    """
    return _scaled(test.signals, run, -1.0)


def other_units(test: Test, run: Trajectory) -> Iterator[Change]:
    """The same columns in another unit in which logs are written.

    Args:
        test: that the run is told as a flight of.
        run: that was recorded.
    """
    return chain.from_iterable(_scaled(test.signals, run, factor) for factor in FACTORS)


def crossed(test: Test, run: Trajectory) -> Iterator[Change]:
    """A command exchanged with another one, or with a state.

    Args:
        test: that the run is told as a flight of.
        run: that was recorded.
    """
    signals = test.signals
    for first, second in combinations(range(signals.n_u), 2):
        commands = run.commands.copy()
        commands[:, [first, second]] = run.commands[:, [second, first]]
        names = signals.command_names[first], signals.command_names[second]
        yield Change(f"{names[0]} and {names[1]} exchanged", run.states, commands)
    for i, j in product(signals.measured, range(signals.n_u)):
        yield with_state(test, run, i, j)


def begun_later(test: Test, run: Trajectory) -> Iterator[Change]:
    """The log without its first rows, of which half are left at least: it may have begun before the flight did.

    Args:
        test: that the run is told as a flight of.
        run: that was recorded.
    """
    for rows in range(1, run.steps // 2 + 1):
        words = f"the first {rows} rows left out" if rows > 1 else "the first row left out"
        yield Change(words, run.states[rows:], run.commands[rows:])


def with_state(test: Test, run: Trajectory, state: int, command: int) -> Change:
    """A command exchanged with a state.

    Args:
        test: that the run is told as a flight of.
        run: that was recorded.
        state: its number; it is measured.
        command: its number.
    """
    signals = test.signals
    states, commands = run.states.copy(), run.commands.copy()
    states[:-1, state], commands[:, command] = run.commands[:, command], run.states[:-1, state]
    words = f"{signals.state_names[state]} and {signals.command_names[command]} exchanged"
    return Change(words, _of_states(words, states, run, signals).states, commands)


def nearest(test: Test, run: Trajectory, changes: Iterator[Change]) -> str:
    """The change that brings the recorded commands nearest to those of the test's controller, in words.

    Args:
        test: that the run is told as a flight of.
        run: that was recorded.
        changes: to be tried.

    Returns:
        Its words; empty where commands are off by little as they are, or no change explains them.
    """
    before = apart(run.commands, given(as_excited(test, excited(test, run)), run.states), test)
    if not (before > LITTLE * LITTLE).any():
        return ""
    most = float(before.mean()) / NEARER
    tried = [(_off(test, change, most), change.words) for change in changes]
    off, words = min(tried, default=(np.inf, ""))
    return words if off <= most else ""


def _off(test: Test, change: Change, most: float) -> float:
    """How far its commands are from those of the controller, whatever became of the excitation.

    Infinitely far where they do not follow them, or where the first rows alone are off by more than all rows may be:
    all changes but one are wrong, and most show it there.
    """
    found, rows = np.inf, len(change.commands)
    first = rows // SHOWN
    for how in hows(test):
        flown = as_excited(test, how)
        if first:
            begun = apart(change.commands[:first], given(flown, change.states[: first + 1]), test)
            if first * float(begun.mean()) > ROUNDED * rows * most:
                continue
        asked = given(flown, change.states)
        off = float(apart(change.commands, asked, test).mean())
        if off <= FOLLOWED * float(apart(asked, asked.mean(axis=0), test).mean()):
            found = min(found, off)
    return found


def _scaled(signals: Signals, run: Trajectory, factor: float) -> Iterator[Change]:
    # Divided by enough, a command is near to any that stays at 0; one in a smaller unit is beyond its bounds anyway.
    for j, name in enumerate(signals.command_names if abs(factor) >= 1.0 else ()):
        commands = run.commands.copy()
        commands[:, j] *= factor
        yield Change(_multiplied(name, factor), run.states, commands)
    for place in signals.measured:
        alone, family = (place,), _with_derivatives(signals, place)
        for columns in dict.fromkeys((alone, family)):
            states = run.states.copy()
            states[:, list(columns)] *= factor
            names = " and ".join(signals.state_names[i] for i in columns)
            yield _of_states(_multiplied(names, factor), states, run, signals)


def _multiplied(name: str, factor: float) -> str:
    if factor == -1.0:
        return f"the sign of {name} changed"
    return f"{name} " + (
        f"multiplied by about {factor:.4g}" if factor > 1.0 else f"divided by about {1.0 / factor:.4g}"
    )


def _with_derivatives(signals: Signals, place: int) -> tuple[int, ...]:
    """A state and its measured derivatives, of any order."""
    found = [place]
    for i in found:
        name = signals.state_names[i]
        found += [k for k in signals.measured if signals.states[k].derivative_of == name and k not in found]
    return tuple(found)


def _of_states(words: str, states: Floats, run: Trajectory, signals: Signals) -> Change:
    """What no sensor reads is made of readings, and changes with them."""
    if signals.unmeasured:
        states = completed_readings(states[:, signals.measured], signals, states[0])
    return Change(words, states, run.commands)
