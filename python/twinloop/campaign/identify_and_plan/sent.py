"""Sent: the commands on record, beside those that the controller gives for the recorded states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Enum

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.test import Test

OTHER = 0.5
"""Share of what commands do that may differ from what their controller gives, squared."""
LITTLE = 0.02
"""Share of their bounds by which commands may differ whatever they do."""
LEVELS = 5
"""Values that commands have at most that are sent in pulses."""
PULSES = 2.0
"""Times the span of a command that pulses may be behind or ahead of it."""
BETTER = 0.25
"""Share of the square that is off below which another excitation explains commands better. An excitation that was sent
late is never further off than this: |e(t - d) - e(t)|² is at most 4 |e|² on average, whatever the delay."""
SEEN = 0.005
"""Share of their bounds by which commands are off at least before another excitation is looked for."""


class Excited(Enum):
    """How the excitation of a test was flown."""

    HELD_BACK = "as the test says"
    WHOLE = "without holding it back"
    NOT = "not at all"


def excited(run: Experiment) -> Excited:
    """How the excitation of a test was flown, by the recorded commands; as the test says where they are not clear.

    Args:
        run: that was recorded.
    """
    if run.test is None or run.test.excitation is None:
        return Excited.HELD_BACK
    sent, states, span = run.trajectory.commands, run.trajectory.states, _span(run.test)
    asked = _off(sent, _given(run.test, states), span)
    if asked <= SEEN * SEEN:
        return Excited.HELD_BACK
    others = (Excited.WHOLE, Excited.NOT)
    off = {how: _off(sent, _given(as_excited(run.test, how), states), span) for how in others}
    best = min(off, key=lambda how: off[how])
    return best if off[best] < BETTER * asked else Excited.HELD_BACK


def as_excited(test: Test, how: Excited) -> Test:
    """The same test with its excitation flown in another way.

    Args:
        test: as it was asked for.
        how: it was flown.
    """
    if how is Excited.NOT:
        return test.quiet()
    return replace(test, hold_back=None) if how is Excited.WHOLE else test


def other_commands(experiments: Sequence[Experiment]) -> list[int]:
    """Numbers of the tests whose recorded commands have little to do with those of their controllers.

    Args:
        experiments: that were learnt from; controllers are run on the readings.
    """
    return [number for number, pulsed in _unlike(experiments).items() if not pulsed]


def in_pulses(experiments: Sequence[Experiment]) -> list[int]:
    """Numbers of the tests whose commands were sent in pulses, as a relay sends them: right in their sum alone.

    Args:
        experiments: that were learnt from; controllers are run on the readings.
    """
    return [number for number, pulsed in _unlike(experiments).items() if pulsed]


def _unlike(experiments: Sequence[Experiment]) -> dict[int, bool]:
    """Tests in which what was sent is not what the controller gives, by number: whether it was sent in pulses."""
    found: dict[int, bool] = {}
    for run in experiments:
        if run.test is None or run.test.number in found:
            continue
        # An excitation that was left out, or not held back, is another fault, and is said by itself.
        sent, given = (
            run.trajectory.commands,
            _given(as_excited(run.test, excited(run)), run.trajectory.states),
        )
        span = _span(run.test)
        size = np.square((given - given.mean(axis=0)) / span).mean()
        off = _off(sent, given, span)
        if off > OTHER * size and off > LITTLE * LITTLE:
            found[run.test.number] = _pulses(sent, given, span)
    return found


def _pulses(sent: Floats, given: Floats, span: Floats) -> bool:
    """Whether few levels were sent, and until any time as much as the controller gives, up to a pulse or two."""
    if any(len(np.unique(command)) > LEVELS for command in sent.T):
        return False
    return bool((np.abs(np.cumsum(sent - given, axis=0)) <= PULSES * span).all())


def _given(test: Test, states: Floats) -> Floats:
    """What a test's controller gives on some readings, with its excitation held back as it says (n, n_u)."""
    controller = test.controller()
    controller.reset()
    return np.array([controller.command(state, test.target(k)) for k, state in enumerate(states[:-1])])


def _off(sent: Floats, given: Floats, span: Floats) -> float:
    """Mean square between commands, in units of their spans."""
    return float(np.square((sent - given) / span).mean())


def _span(test: Test) -> Floats:
    """From the smallest to the largest value of each command (n_u,)."""
    low, high = np.array([command.bounds for command in test.family.signals.commands]).T
    return np.asarray(high - low)
