"""The clock of a log: its period, how far its times jitter, and where rows were lost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import two_digits
from twinloop._ground.times import moment
from twinloop.errors import row_name
from twinloop.remarks import Remark, serious
from twinloop.trajectory import JITTER

LOST = 1.5
"""Periods between two rows from which rows were lost."""
FAR = 1.75
"""The same where times jitter: more than most rows come late by, less than a lost row takes."""


@dataclass(frozen=True, eq=False)
class Clock:
    """The times of a log beside the period that is declared.

    Args:
        t: times of the rows (n + 1,), s.
        dt: the declared period, s.
    """

    t: Floats
    dt: float

    @cached_property
    def steps(self) -> Floats:
        """From one row to the next, s, where both have a time (m,)."""
        steps = np.diff(self.t)
        return steps[np.isfinite(steps)]

    @cached_property
    def lost(self) -> NDArray[np.bool_]:
        """Between which rows others were lost (m,)."""
        return self.steps > (FAR if self._jitters else LOST) * self.dt

    @property
    def gaps(self) -> Floats:
        """The steps in which rows were lost, s."""
        return self.steps[self.lost]

    @property
    def period(self) -> float | None:
        """The time from one row to the next, s, without lost rows; None without a step.

        The median is that of the rows that come late, or early, where those alternate: then the mean tells.
        """
        if not len(self.steps):
            return None
        return float(self._near.mean() if self._jitters else np.median(self.steps))

    @property
    def jitter(self) -> float | None:
        """Largest deviation from the declared period without a lost row, as a share of it; None without a step."""
        near = self.steps[~self.lost]
        return float(np.abs(near / self.dt - 1.0).max()) if len(near) else None

    @cached_property
    def _jitters(self) -> bool:
        """Whether most rows come late or early, around the declared period."""
        uneven = len(self._near) > 0 and float(np.median(np.abs(self.steps / self.dt - 1.0))) > JITTER
        return uneven and not self._is_other(float(self._near.mean()))

    @cached_property
    def _near(self) -> Floats:
        """Steps in which no row was lost, however late one came."""
        return self.steps[self.steps <= FAR * self.dt]

    def _is_other(self, period: float) -> bool:
        return abs(period / self.dt - 1.0) > JITTER

    def remarks(self, lines: Sequence[int] | None) -> Iterator[Remark]:
        """What has to be corrected.

        Args:
            lines: of each row in its file, for the sentences; None: they call rows by their index.
        """
        t, steps, dt = self.t, self.steps, self.dt
        if len(t) < 3:
            yield serious(
                "short",
                f"The log has {len(t)} row{'s' * (len(t) != 1)}: at least 3 are needed to learn from.",
            )
            return
        if len(steps) < len(t) - 1:
            yield serious("times", "Some rows have no time: remove them.")
            return
        if (steps <= 0.0).any():
            yield serious("order", self._disorder(lines))
            return
        period = self.period
        if period is not None and self._is_other(period):
            yield serious(
                "period",
                f"Rows are {period:.6g} s apart ({1.0 / period:.4g} Hz), {dt:g} s are declared: downsample the log,"
                " declare its own period as dt, or look whether t is in s.",
            )
            return
        if self.lost.any():
            rows, places = int(np.rint(self.gaps / dt - 1.0).sum()), len(self.gaps)
            first = int(np.argmax(self.lost))
            yield serious(
                "gaps",
                f"Rows are missing in {places} place{'s' * (places != 1)}, about {rows} in all, the first after"
                f" {moment(t[first], dt)} s ({row_name(first, lines)}): split the log there, or fill in the rows.",
            )
        worst = self.jitter or 0.0
        if worst > JITTER:
            yield serious(
                "jitter",
                f"The time between two rows departs by up to {two_digits(100.0 * worst)} % from dt;"
                f" {100.0 * JITTER:g} % are allowed. Where the loop only jitters around its period, twinloop check"
                " --even brings times onto it.",
            )

    def _disorder(self, lines: Sequence[int] | None) -> str:
        """How time does not increase, in words."""
        t, back = self.t, self.steps < 0.0
        if back.all():
            return "The rows are in reverse order, the last time first: sort them by t."
        row = int(np.argmax(back if back.any() else self.steps == 0.0)) + 1
        before, after = (moment(each, float(t[row - 1] - t[row])) for each in (t[row - 1], t[row]))
        if back.any():
            return (
                f"Time goes back at {row_name(row, lines)}, from {before} s to {after} s: sort the rows by t, or"
                " split the log where another one begins."
            )
        count = int((self.steps == 0.0).sum())
        return (
            f"{count} row{' has' if count == 1 else 's have'} the time of the row before, the first at"
            f" {row_name(row, lines)}, {after} s: remove rows that are repeated, or write t with more digits."
        )
