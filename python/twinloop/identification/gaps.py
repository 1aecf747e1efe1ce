"""Masses behind gaps: what presses on each and its rate, by readings of the rate of what drives it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats


class Masses(NamedTuple):
    """Masses that the same drives, each behind a gap of its own; all times in s.

    Args:
        turns: in which each turns by one radian on what presses, were it fixed on the other side (k,).
        gaps: half of each gap, in units of what drives times s (k,).
        dampings: of what presses, over its stiffness (k,).
        times: after which 1/e of its own rate is left (k,).
    """

    turns: Floats
    gaps: Floats
    dampings: Floats
    times: Floats


def behind_gaps(
    masses: Masses, rates: tuple[Floats, Floats, Floats], runs: Sequence[slice], dt: float
) -> tuple[Floats, Floats, Floats]:
    """What presses on masses, and their rates: one Runge-Kutta step of order four a period, as a law takes it.

    Args:
        masses: k of them.
        rates: of what drives them, in units of its scale, at the start, the middle and the end of each period (rows,).
        runs: rows of each run.
        dt: period, s.

    Returns:
        Both at the start, the middle and the end of each period (rows, 2, k).
    """
    driven = np.column_stack(rates)
    found = np.zeros((len(driven), 3, 2, len(masses.turns)))
    for k, mass in enumerate(zip(*(numbers.tolist() for numbers in masses), strict=True)):
        for rows in runs:
            pressed = _core.behind_gap(mass, driven[rows], dt)
            found[rows, :, :, k] = pressed.reshape(-1, 3, 2)
    return found[:, 0], found[:, 1], found[:, 2]
