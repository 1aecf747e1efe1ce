"""Excited: how the excitation of a test was flown, as the recorded commands show it.

A program that flies a test may leave its excitation out, may not be able to hold it back, or may add it once more to
commands that have it already. The flight is learnt as it was flown, so a twin that is held against it has to be flown
in the same way.
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.test import Test
from twinloop.trajectory import Trajectory

BETTER = 0.25
"""Share of the square that is off below which another excitation explains commands better. An excitation that was sent
late is never further off than this: |e(t - d) - e(t)|² is at most 4 |e|² on average, whatever the delay."""
SEEN = 0.005
"""Share of their bounds by which commands are off at least before another excitation is looked for."""
NEARER = 100.0
"""Times nearer to those of a controller, in squares, that recorded commands are once the fault of a log is put right:
they follow from its readings almost exactly."""
AT_BOUND = 1e-9
"""Share of their bounds within which commands are at one."""


class Excited(Enum):
    """How the excitation of a test was flown."""

    HELD_BACK = "as the test says"
    WHOLE = "without holding it back"
    NOT = "not at all"
    TWICE = "twice"
    NEGATED = "with the other sign"


def excited(test: Test, run: Trajectory) -> Excited:
    """How the excitation of a test was flown, by the recorded commands; as the test says where they are not clear.

    Args:
        test: as it was asked for.
        run: that was recorded of it.
    """
    if test.excitation is None:
        return Excited.HELD_BACK
    asked = off_from(test, run)
    if asked <= SEEN * SEEN:
        return Excited.HELD_BACK
    others = (Excited.WHOLE, Excited.NOT, Excited.TWICE, Excited.NEGATED)
    off = {how: off_from(as_excited(test, how), run) for how in others}
    best = min(off, key=lambda how: off[how])
    return best if off[best] < BETTER * asked else Excited.HELD_BACK


def hidden(test: Test, run: Trajectory) -> bool:
    """Whether bounds hide the excitation of a test that seems to be left out: it may have been added all the same.

    A program may add it to a command before the bounds clip the sum. Where the controller alone is at a bound, and the
    recorded command too, nothing tells the two apart.

    Args:
        test: as it was asked for.
        run: that was recorded of it.
    """
    if excited(test, run) is not Excited.NOT:
        return False
    quiet = given(test.quiet(), run.states)
    low, high = np.array([command.bounds for command in test.family.signals.commands]).T
    near = AT_BOUND * (high - low)
    held = (np.maximum(quiet, run.commands) <= low + near) | (np.minimum(quiet, run.commands) >= high - near)
    sent = np.where(held, quiet, run.commands)
    asked = np.where(held, quiet, given(test, run.states))
    off = float(apart(sent, asked, test).mean())
    return off <= SEEN * SEEN or float(apart(sent, quiet, test).mean()) >= BETTER * off


def hows(test: Test) -> list[Excited]:
    """In which ways the excitation of a test may have been flown.

    Args:
        test: as it was asked for.
    """
    return [how for how in Excited if how is Excited.HELD_BACK or test.excitation is not None]


def as_excited(test: Test, how: Excited) -> Test:
    """The same test with its excitation flown in another way.

    Args:
        test: as it was asked for.
        how: it was flown.
    """
    if how is Excited.NOT:
        return test.quiet()
    if how is Excited.TWICE and test.excitation is not None:
        return replace(test, excitation=2.0 * test.excitation, hold_back=None)
    if how is Excited.NEGATED and test.excitation is not None:
        return replace(test, excitation=-test.excitation)
    return replace(test, hold_back=None) if how is Excited.WHOLE else test


def given(test: Test, states: Floats) -> Floats:
    """What a test's controller gives on some readings, with its excitation held back as it says (n, n_u).

    Args:
        test: that was flown.
        states: that were read (n + 1, n_x).
    """
    targets = np.array([test.target(k) for k in range(len(states) - 1)])
    return test.controller().commands(states[:-1], targets)


def given_in_spans(test: Test, states: Floats) -> Floats:
    """The same in units of the commands' spans (n, n_u).

    Args:
        test: that was flown.
        states: that were read (n + 1, n_x).
    """
    return given(test, states) / span_of(test)


def apart(sent: Floats, asked: Floats, test: Test) -> Floats:
    """Mean squares of what commands (n, n_u) are off from others, in units of their spans (n_u,).

    Args:
        sent: on record.
        asked: by a controller.
        test: with the signals.
    """
    return np.asarray(np.square((sent - asked) / span_of(test)).mean(axis=0))


def off_from(test: Test, run: Trajectory) -> float:
    """How far recorded commands are from those of a test, mean square over all of them, in units of their spans.

    Args:
        test: as it may have been flown.
        run: that was recorded.
    """
    return float(apart(run.commands, given(test, run.states), test).mean())


def span_of(test: Test) -> Floats:
    """From the smallest to the largest value of each command (n_u,)."""
    low, high = np.array([command.bounds for command in test.family.signals.commands]).T
    return np.asarray(high - low)
