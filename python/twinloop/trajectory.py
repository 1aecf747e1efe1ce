"""What one run of a system leaves behind: times, states, commands, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats, floats
from twinloop._ground.showing import Shown
from twinloop._ground.texts import in_unit, text
from twinloop._ground.times import moment
from twinloop._ground.values import Value
from twinloop.errors import AtRow, InvalidInput, unknown
from twinloop.records import Recorded
from twinloop.records.reading import MOST_ITEMS
from twinloop.signals import Signals
from twinloop.unmeasured import completed_readings, lacks, or_measured

Run = TypeVar("Run")
ENDINGS = ("completed", "aborted", "diverged")
JITTER = 0.01
"""Share of the period by which a recorded interval may differ from it."""


@dataclass(frozen=True, eq=False)
class Trajectory(Shown, Value, Recorded, kind="trajectory"):
    """A recorded or simulated run of n steps; `commands[k]` is held from `t[k]` to `t[k + 1]`.

    Args:
        t: times (n + 1,), s.
        states: states as measured (n + 1, n_x), SI units, radians.
        commands: commands as sent (n, n_u), in their units.
        ended: "completed", "aborted" or "diverged".
        reason: why it did not complete, in a few words.
        true_states: states without sensor noise (n + 1, n_x), if a simulator has them; learning never uses them.
        band: lower and upper limit, between which nine of ten readings are expected (2, n + 1, n_x), if a committee
            predicted the run.

    Raises:
        InvalidInput: shapes that do not fit each other, numbers that are not finite, times that do not grow, a reason
            that is no text.
    """

    t: Floats
    states: Floats
    commands: Floats
    ended: str = "completed"
    reason: str = ""
    true_states: Floats | None = None
    band: Floats | None = None

    def __post_init__(self) -> None:
        t = floats("Trajectory.t", self.t, (None,))
        if len(t) == 0:
            raise InvalidInput(
                "Trajectory.t: expected at least the first time, found nothing; record the run."
            )
        states = floats("Trajectory.states (one row per time)", self.states, (len(t), None))
        commands = floats("Trajectory.commands (one row less than states)", self.commands, (len(t) - 1, None))
        if len(t) > 1 and float(np.diff(t).min()) <= 0.0:
            k = int(np.argmin(np.diff(t)))
            before, after = (moment(each, float(t[k] - t[k + 1])) for each in (t[k], t[k + 1]))
            raise AtRow(
                f"Trajectory.t: expected times that grow, found {before} s and then {after} s at",
                k + 1,
                "; sort the record or remove repeated rows.",
            )
        if text("Trajectory.ended", self.ended) not in ENDINGS:
            raise unknown("end of a trajectory", self.ended, ENDINGS)
        text("Trajectory.reason", self.reason)
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "states", states)
        object.__setattr__(self, "commands", commands)
        if self.true_states is not None:
            true_states = floats("Trajectory.true_states", self.true_states, (len(t), states.shape[1]))
            object.__setattr__(self, "true_states", true_states)
        if self.band is not None:
            band = floats("Trajectory.band", self.band, (2, len(t), states.shape[1]))
            object.__setattr__(self, "band", band)

    @property
    def steps(self) -> int:
        """Number of commands, n."""
        return len(self.commands)


def check_recorded(trajectory: object, limits: Limits, steps: int | None, least: int = 2) -> None:
    """Refuses what cannot be learnt from.

    Args:
        trajectory: what a system answered.
        limits: of a run, with the signals that it should consist of.
        steps: number of steps of the test; None for an attached run.
        least: steps that it must have.

    Raises:
        InvalidInput: no trajectory, another width or period, too short, too long, far out of scale, or with commands
            beyond their bounds by more than those are apart.
    """
    signals = limits.signals
    if not isinstance(trajectory, Trajectory):
        raise InvalidInput(
            f"Expected a twinloop.Trajectory, found {type(trajectory).__name__}; wrap the record in one."
        )
    for what, found, expected in (
        ("states", trajectory.states.shape[1], signals.n_x),
        ("commands", trajectory.commands.shape[1], signals.n_u),
    ):
        if found != expected:
            raise InvalidInput(
                f"Trajectory: expected {expected} {what}{or_measured(signals) if what == 'states' else ''} as in the"
                f" signals, found {found}; check the columns."
            )
    if trajectory.steps < least:
        raise InvalidInput(
            f"Trajectory: expected at least {least} step{'s' if least > 1 else ''} to learn from, found"
            f" {trajectory.steps}; run the test again."
        )
    if trajectory.steps >= MOST_ITEMS:
        raise InvalidInput(
            f"Trajectory: expected less than {MOST_ITEMS} steps, which is what a record may hold, found"
            f" {trajectory.steps}; cut the record into several."
        )
    if steps is not None and trajectory.steps > steps:
        raise InvalidInput(
            f"Trajectory: expected at most the {steps} steps of the test, found {trajectory.steps}; cut the"
            " record."
        )
    check_period(trajectory, signals)
    farthest = limits.readings
    excess = np.abs(trajectory.states) / farthest
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    if excess[k, i] > 1.0:
        state = signals.states[int(i)]
        raise AtRow(
            f"Trajectory: expected {state.name} within {in_unit(f'{farthest[i]:g}', state.unit)} (twice the divergence"
            f" factor times its scale), found {trajectory.states[k, i]:g} at",
            int(k),
            "; check its unit (degrees, milli?), cut the record before it, or declare a larger scale.",
        )
    _check_commands(trajectory, signals)


def check_period(trajectory: Trajectory, signals: Signals) -> None:
    """Refuses times that are not one period apart.

    Args:
        trajectory: of at least one step.
        signals: with the period.

    Raises:
        InvalidInput: two rows that are not, with their place.
    """
    intervals = np.diff(trajectory.t)
    worst = int(np.argmax(np.abs(intervals - signals.dt)))
    if abs(intervals[worst] - signals.dt) > JITTER * signals.dt * (1.0 + 1e-9):
        raise AtRow(
            f"Trajectory: expected a period of {signals.dt:g} s within 1 %, found {intervals[worst]:g} s after",
            worst,
            f", t = {moment(trajectory.t[worst], signals.dt)} s; put in a row that was lost, give t in s, or declare"
            " the system's own period as dt. Where the loop only jitters around it, bring the log onto even times with"
            " twinloop check --even, or pass dt * np.arange(n + 1).",
        )


def completed(run: Run, signals: Signals, start: Floats | None = None) -> Run:
    """The run with columns for states that are not measured.

    Args:
        run: as recorded, with a column for each state that is measured, in their order; anything else is given back.
        signals: of the system.
        start: the state that the run was to start from (n_x,); None: nobody knows.
    """
    if isinstance(run, Trajectory) and lacks(run.states, signals):
        return replace(
            run, states=completed_readings(run.states, signals, start), true_states=None, band=None
        )
    return run


def equal_runs(one: Trajectory, other: Trajectory) -> bool:
    """Whether two runs have the same states and commands, to the last digit.

    Args:
        one: run.
        other: run.
    """
    pairs = (one.states, other.states), (one.commands, other.commands)
    return all(a.shape == b.shape and np.array_equal(a, b) for a, b in pairs)


def recorded_as(run: Trajectory, other: Trajectory, signals: Signals) -> bool:
    """Whether a record is that of another run, to the last digit; it may lack what is not measured.

    Args:
        run: as recorded.
        other: run, with columns for all states.
        signals: of the system.
    """
    return equal_runs(completed(run, signals, other.states[0]), other)


def row_in(one: Trajectory, other: Trajectory) -> int | None:
    """The row from which on another run has the states and commands of a run, to the last digit; None: there is none.

    Args:
        one: run.
        other: a longer run.
    """
    rows, later = len(one.states), other.steps - one.steps
    if later < 1:
        return None
    # Most places are ruled out by three rows.
    looked_at = [0, rows // 2, rows - 1]
    alike = [(other.states[at : at + later + 1] == one.states[at]).all(axis=1) for at in looked_at]
    for row in np.flatnonzero(np.logical_and.reduce(alike)).tolist():
        pairs = (one.states, other.states), (one.commands, other.commands)
        if all(np.array_equal(a, b[row : row + len(a)]) for a, b in pairs):
            return int(row)
    return None


def continued(trajectory: Trajectory, signals: Signals, start: Floats) -> Trajectory:
    """The same run with periodic states that go on from row to row by the short way, however they were wrapped.

    Args:
        trajectory: as recorded.
        signals: of the system.
        start: the state (n_x,) that the run was to start from; the first row follows it.

    Returns:
        The run; itself where no state is periodic.
    """
    return (
        replace(trajectory, states=signals.continued(trajectory.states, start))
        if signals.periods
        else trajectory
    )


def _check_commands(trajectory: Trajectory, signals: Signals) -> None:
    """Refuses commands so far beyond their bounds that they are in another unit."""
    for command, sent in zip(signals.commands, trajectory.commands.T, strict=True):
        low, high = command.bounds
        beyond = np.maximum(low - sent, sent - high)
        k = int(np.argmax(beyond))
        if beyond[k] > high - low:
            raise AtRow(
                f"Trajectory: expected {command.name} within its bounds,"
                f" {in_unit(f'{low:g} to {high:g}', command.unit)}, found"
                f" {sent[k]:g} at",
                k,
                "; record what was sent, in that unit, or declare the bounds that it has.",
            )
