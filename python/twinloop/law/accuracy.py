"""How well a twin follows what was flown: errors test by test, and its fit state by state."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.records import Recorded
from twinloop.signals import Signals

WRONG = 0.5
"""Share of the error of the model that never moves above which a flight is not followed."""


@dataclass(frozen=True)
class TestErrors(Recorded, kind="test_errors"):
    """How well a twin follows one selected test.

    Args:
        test: number of the test, None for an attached run; a replicate has its own row.
        open_loop: mean squared error one step ahead, over steps and states, each in units of its scale (the preset
            "paper": SI units squared).
        closed_loop: mean squared error of the free run under the test's own controller, or, for an attached run,
            under its recorded commands; the same units; infinite if it diverges.
        normalised: closed_loop over that of the model that never moves; 1 means useless.
        before: closed-loop error of the twin at the last `ask` before the run; None if there was no `ask` yet.
        after: closed-loop error now.
        attached: of an attached run, its number among these, from 1; None for a run of a test.
    """

    __test__ = False
    VERSION = 2

    test: int | None
    open_loop: float
    closed_loop: float
    normalised: float
    before: float | None
    after: float
    attached: int | None = None

    @property
    def run(self) -> str:
        """What the run is called: the number of its test, or attached-1, attached-2 …, as `withdraw` calls it."""
        if self.test is not None:
            return str(self.test)
        return "-" if self.attached is None else f"attached-{self.attached}"


class ErrorTable(tuple[TestErrors, ...]):
    """Errors of a twin, one row for each selected test in the order of `tell`; printable."""

    def follow(self, noise: float = 0.0) -> bool:
        """Whether free runs follow at least half of the tests.

        Args:
            noise: mean square of the sensors' noise, in the units of the errors.
        """
        lost = 0
        for row in self:
            frozen = row.closed_loop / row.normalised if row.normalised > 0.0 else math.inf
            lost += left(row.closed_loop, frozen, noise)
        return 2 * lost <= len(self)

    def __str__(self) -> str:
        """A table as text."""
        names = [row.run for row in self]
        width = max(map(len, ["test", *names]))
        head = (
            f"{'test':>{width}}  {'open loop':>10}  {'closed loop':>11}  {'normalised':>10}  {'before':>10} "
            f" {'after':>10}"
        )
        lines = [head]
        for name, row in zip(names, self, strict=True):
            before = "-" if row.before is None else f"{row.before:.4g}"
            lines.append(
                f"{name:>{width}}  {row.open_loop:>10.4g}  {row.closed_loop:>11.4g}  {row.normalised:>10.4g}  "
                f"{before:>10}  {row.after:>10.4g}"
            )
        return "\n".join(lines)


@dataclass(frozen=True)
class StateFit:
    """How well a twin's free run follows a record in one state.

    Args:
        name: of the state.
        unit: of the state.
        rmse: root mean square of recorded minus simulated, in its unit; infinite if the free run diverged.
        fit: 100 (1 − ‖y − ŷ‖ / ‖y − ȳ‖), %: 100 is perfect, 0 is as good as the mean; None if the state never moved.
        r2: 1 − ‖y − ŷ‖² / ‖y − ȳ‖²; None if the state never moved.
    """

    name: str
    unit: str
    rmse: float
    fit: float | None
    r2: float | None


class FitTable(tuple[StateFit, ...]):
    """How well a twin's free run follows a record, one row per state; printable."""

    def __str__(self) -> str:
        """A table as text."""
        lines = [f"{'state':<16} {'unit':<8} {'RMSE':>10}  {'FIT %':>8}  {'R²':>8}"]
        for row in self:
            fit, r2 = ("-" if value is None else f"{value:.4g}" for value in (row.fit, row.r2))
            lines.append(f"{row.name:<16} {row.unit or '1':<8} {row.rmse:>10.4g}  {fit:>8}  {r2:>8}")
        return "\n".join(lines)


def squares(states: Floats, others: Floats, signals: Signals) -> Floats:
    """Squares of differences between states (…, n_x), each in units of its scale: so units decide nothing.

    Args:
        states: (…, n_x).
        others: the same shape, or one that goes with it.
        signals: of the system.
    """
    scales = np.array([state.scale for state in signals.states])
    return np.asarray(np.square(signals.difference(states, others) / scales))


def left(free: float, frozen: float, noise: float) -> bool:
    """Whether a free run does not follow its flight. One in which no reading ever moves is followed by nothing.

    Where commands moved, that is no merit of a model: the system was off, or its sensors were.

    Args:
        free: its mean square error; infinite where it diverges.
        frozen: that of the model that never moves.
        noise: of the sensors, in the same unit.
    """
    return frozen == 0.0 or not free - noise <= WRONG * max(frozen - noise, 2.0 * noise)


def fit_table(signals: Signals, read: Floats, free: Floats | None) -> FitTable:
    """How well a free run follows what was read.

    Args:
        signals: of the system.
        read: states (n, n_x).
        free: those of the free run (n, n_x); None where it diverges before the end.

    Returns:
        RMSE, FIT % and R² of each state.
    """
    rows = []
    for i, state in enumerate(signals.states):
        around = float(np.square(read[:, i] - read[:, i].mean()).sum())
        squares = np.inf if free is None else float(np.square(signals.difference(read, free)[:, i]).sum())
        share = squares / around if around > 0.0 else None
        rows.append(
            StateFit(
                name=state.name,
                unit=state.unit,
                rmse=float(np.sqrt(squares / len(read))),
                fit=None if share is None else 100.0 * (1.0 - float(np.sqrt(share))),
                r2=None if share is None else 1.0 - share,
            )
        )
    return FitTable(rows)
