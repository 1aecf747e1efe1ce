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
    # Side by side, for runs do not know each other: the shorter ones go on with what is not looked at.
    apart = [np.arange(len(rates[0]))[rows] for rows in runs]
    driving = np.zeros((3, max((len(rows) for rows in apart), default=0), len(apart), 1))
    for place, rows in enumerate(apart):
        driving[:, : len(rows), place, 0] = [each[rows] for each in rates]
    found = np.zeros((3, driving.shape[1], len(apart), 2, len(masses.turns)))
    twist = rate = np.zeros((len(apart), len(masses.turns)))

    def slopes(twist: Floats, rate: Floats, driven: Floats) -> tuple[Floats, Floats, Floats]:
        turning = driven - rate
        pressed = press(twist, turning, masses.gaps, masses.dampings)
        return turning, stiffness * pressed - fades * rate, pressed

    with np.errstate(over="ignore", invalid="ignore"):
        for row, (first, half, last) in enumerate(driving.swapaxes(0, 1)):
            if row == 0:
                rate = rate + first
            a, b, pressed = slopes(twist, rate, first)
            found[0, row, :, 0], found[0, row, :, 1] = pressed, rate
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
            found[1, row, :, 0], found[1, row, :, 1] = slopes(*middle, half)[2], middle[1]
            twist, rate = ended
            found[2, row, :, 0], found[2, row, :, 1] = last_slopes[2], rate
    starting, midway, ending = (np.zeros((len(rates[0]), 2, len(masses.turns))) for _ in range(3))
    for place, rows in enumerate(apart):
        for stage, of_all in zip((starting, midway, ending), found, strict=True):
            stage[rows] = of_all[: len(rows), place]
    return starting, midway, ending
