"""Masses behind gaps: what presses on each and its rate, by readings of the rate of what drives it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.play import press


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
    stiffness, fades = 1.0 / np.square(masses.turns), 1.0 / masses.times
    starting, midway, ending = (np.zeros((len(rates[0]), 2, len(masses.turns))) for _ in range(3))
    starts = {rows.start: rows.stop for rows in runs if rows.stop > rows.start}
    twist = rate = np.zeros(len(masses.turns))

    def slopes(twist: Floats, rate: Floats, driven: float) -> tuple[Floats, Floats, Floats]:
        turning = driven - rate
        pressed = press(twist, turning, masses.gaps, masses.dampings)
        return turning, stiffness * pressed - fades * rate, pressed

    with np.errstate(over="ignore", invalid="ignore"):
        for row, (first, half, last) in enumerate(zip(*(each.tolist() for each in rates), strict=True)):
            if row in starts:
                twist, rate = np.zeros(len(masses.turns)), np.full(len(masses.turns), first)
            a, b, pressed = slopes(twist, rate, first)
            starting[row, 0], starting[row, 1] = pressed, rate
            c, d, _ = slopes(twist + 0.5 * dt * a, rate + 0.5 * dt * b, half)
            e, f, _ = slopes(twist + 0.5 * dt * c, rate + 0.5 * dt * d, half)
            g, h, _ = slopes(twist + dt * e, rate + dt * f, last)
            ended = twist + dt / 6.0 * (a + 2.0 * (c + e) + g), rate + dt / 6.0 * (b + 2.0 * (d + f) + h)
            last_slopes = slopes(*ended, last)
            # Hermite's, through both ends.
            middle = (
                0.5 * (twist + ended[0]) + dt / 8.0 * (a - last_slopes[0]),
                0.5 * (rate + ended[1]) + dt / 8.0 * (b - last_slopes[1]),
            )
            midway[row, 0], midway[row, 1] = slopes(*middle, half)[2], middle[1]
            twist, rate = ended
            ending[row, 0], ending[row, 1] = last_slopes[2], rate
    return starting, midway, ending
