"""Mistaken: a record that was told as the flight of one test, and is that of another."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop.campaign.excited import SEEN, Excited, apart, as_excited, given, hows
from twinloop.test import Test
from twinloop.trajectory import Trajectory

NEARER = 100.0
"""Times nearer, in squares, that recorded commands have to be to those of another test."""


def flight_of(test: Test, run: Trajectory, others: Sequence[Test]) -> Test | None:
    """The other test whose commands are those on record, where those of the test are not; None where there is none.

    Args:
        test: that it was told as the flight of.
        run: that was recorded.
        others: further tests.
    """
    own = min(_off(test, run, how) for how in hows(test))
    if own <= SEEN * SEEN:
        return None
    # One whose excitation was left out as well might be any test with these gains.
    found = [
        (min(_off(other, run, how) for how in (Excited.HELD_BACK, Excited.WHOLE)), other)
        for other in others
        if other.number != test.number and other.steps >= run.steps
    ]
    off, nearest = min(found, key=lambda each: each[0], default=(own, test))
    return nearest if NEARER * off <= own else None


def _off(test: Test, run: Trajectory, how: Excited) -> float:
    return float(apart(run.commands, given(as_excited(test, how), run.states), test).mean())
