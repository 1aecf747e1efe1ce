"""Mistaken: a record that was told as the flight of one test, and is that of another."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop.campaign.data.excited import NEARER, SEEN, Excited, as_excited, hows, off_from
from twinloop.test import Test
from twinloop.trajectory import Trajectory


def flight_of(test: Test, run: Trajectory, others: Sequence[Test]) -> Test | None:
    """The other test whose commands are those on record, where those of the test are not; None where there is none.

    Args:
        test: that it was told as the flight of.
        run: that was recorded.
        others: further tests.
    """
    own = min(off_from(as_excited(test, how), run) for how in hows(test))
    if own <= SEEN * SEEN:
        return None
    # One whose excitation was left out as well might be any test with these gains.
    found = [
        (min(off_from(as_excited(other, how), run) for how in (Excited.HELD_BACK, Excited.WHOLE)), other)
        for other in others
        if other.number != test.number and other.steps >= run.steps
    ]
    off, nearest = min(found, key=lambda each: each[0], default=(own, test))
    return nearest if NEARER * off <= own else None
