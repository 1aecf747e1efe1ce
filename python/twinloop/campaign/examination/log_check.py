"""Checks of a log before it is told or learnt: its clock, and its columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass

import numpy as np

from twinloop._experiment.envelope import outside, usages_of
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop._ground.texts import in_unit, two_digits
from twinloop._ground.times import moment
from twinloop.campaign.data.begun import ended_early, from_first_readings, from_other_starts
from twinloop.campaign.data.declared import against_derivatives
from twinloop.campaign.data.gains import FlownOtherwise, from_other_gains
from twinloop.campaign.data.lateness import late
from twinloop.campaign.data.readings import suspicious
from twinloop.campaign.data.rows import from_late_commands, in_other_rows
from twinloop.campaign.data.sent import (
    change_that_rights,
    from_another_excitation,
    from_other_controllers,
    other_commands,
)
from twinloop.campaign.data.wrapped import without_turns
from twinloop.campaign.examination.clock import Clock
from twinloop.campaign.examination.told_apart import alike
from twinloop.campaign.history import Experiment
from twinloop.errors import InvalidInput, in_file, row_name
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory, check_recorded
from twinloop.unmeasured import completed_readings, lacks

MOVED = 3.0
"""Standard deviations of its noise, as guessed from above, that a state must have moved for anything to be learnt."""
SATURATED = 0.5
"""Share of the rows at a bound above which a command says little."""
OUTSIDE = 0.5
"""Share of the rows outside the envelope above which a unit or an offset is more likely than a flight that left it."""
SMALL = 1e-3
"""Share of its scale within which a state that moved may be in another unit."""

AS_LATE = frozenset({"repeated-readings", "derived-rate"})
"""Remarks that say already why a state comes later than another."""


@dataclass(frozen=True)
class Column:
    """One column of a log.

    Args:
        name: of the state or command.
        unit: of it.
        command: whether it is a command.
        least: its smallest number; None if it has no number.
        greatest: its largest number.
        missing: rows without a finite number.
        moved: of a state, root mean square about its mean over an upper bound of its noise; None: unknown, or no sensor
            reads it.
        at_bound: of a command, share of the rows at a bound.
        beyond: share of the rows beyond its bounds or its envelope.
    """

    name: str
    unit: str
    command: bool
    least: float | None
    greatest: float | None
    missing: int
    moved: float | None
    at_bound: float | None
    beyond: float | None


@dataclass(frozen=True)
class LogCheck:
    """The result of checking a log.

    Args:
        rows: number of rows.
        seconds: from the first to the last time.
        period: the median time between two rows, s; the mean where times jitter around the declared period; None with
            fewer than two rows.
        jitter: largest deviation from the declared period without a lost row, as a share of the period.
        gaps: number of pairs of rows with lost rows between them.
        longest_gap: s; None without a gap.
        columns: states, then commands.
        remarks: diagnostics; a serious one must be corrected first.
    """

    rows: int
    seconds: float
    period: float | None
    jitter: float | None
    gaps: int
    longest_gap: float | None
    columns: tuple[Column, ...]
    remarks: tuple[Remark, ...]

    @property
    def fit(self) -> bool:
        """Whether the log has no serious remark."""
        return not any(remark.serious for remark in self.remarks)


def check_log(
    t: Floats, states: Floats, commands: Floats, signals: Signals, lines: Sequence[int] | None = None
) -> LogCheck:
    """Checks a log as it was recorded.

    Args:
        t: times of the rows (n + 1,), s.
        states: readings (n + 1, n_x), in the units of the signals; or of those states alone that are measured.
        commands: as sent (n, n_u).
        signals: declared signals.
        lines: of each row in its file, for the sentences; None: they call rows by their index.
    """
    return _checked(t, states, commands, signals, lines, compared=True)


def _checked(
    t: Floats,
    states: Floats,
    commands: Floats,
    signals: Signals,
    lines: Sequence[int] | None,
    compared: bool,
) -> LogCheck:
    """A log as it was checked; with columns compared with each other, which takes most of the time and gives notes."""
    of_others: Set[str] = frozenset()
    if lacks(states, signals):
        states = completed_readings(states, signals)
        of_others = {signals.state_names[i] for i in signals.unmeasured}
    clock = Clock(t, signals.dt)
    remarks = [*clock.remarks(lines)]
    columns = (*_states(states, signals), *_commands(commands, signals))
    for column in columns:
        remarks += _of_envelope(column) if column.name in of_others else _of_column(column, len(t))
    remarks += _of_scales(states, signals)
    if (
        np.isfinite(t).all()
        and np.isfinite(states).all()
        and np.isfinite(commands).all()
        and len(commands) > 1
    ):
        remarks += _of_run(t, states, commands, signals, remarks, lines, compared)
    return LogCheck(
        rows=len(t),
        seconds=float(t[-1] - t[0]) if len(t) else 0.0,
        period=clock.period,
        jitter=clock.jitter,
        gaps=len(clock.gaps),
        longest_gap=float(clock.gaps.max()) if len(clock.gaps) else None,
        columns=columns,
        remarks=tuple(remarks),
    )


def against(
    flight: Experiment, asked: Test | None, signals: Signals, lines: Sequence[int] | None = None
) -> list[Remark]:
    """What speaks against a flight by itself, without a twin.

    Args:
        flight: that was recorded.
        asked: its test as it was asked for; None for an attached flight.
        signals: declared signals.
        lines: of each row in its file, for the sentences; None: they call rows by their index.

    Returns:
        Serious remarks, and a note where an excitation was not flown; none where nothing does.
    """
    run = flight.trajectory
    found = _checked(run.t, run.states, run.commands, signals, lines, compared=False).remarks
    others = other_commands([flight])
    change = change_that_rights(flight) if others else ""
    late = in_other_rows([flight])
    if isinstance(flight.replayed, FlownOtherwise):
        asked = flight.replayed.flown
    # In other rows than its own no excitation is what it seems to be.
    excitations = () if asked is None or late else from_another_excitation(asked, run)
    return [
        *(each for each in found if each.serious),
        *from_late_commands(late),
        *from_other_controllers(others, change),
        *from_other_gains([flight]),
        *from_other_starts([flight], serious),
        *from_first_readings(flight),
        *ended_early(flight),
        *excitations,
    ]


def _finite(values: Floats) -> tuple[Floats, int]:
    kept = values[np.isfinite(values)]
    return kept, len(values) - len(kept)


def _ends(values: Floats) -> tuple[float | None, float | None]:
    return (float(values.min()), float(values.max())) if len(values) else (None, None)


def _states(states: Floats, signals: Signals) -> Iterator[Column]:
    moved: list[float | None] = [None] * signals.n_x
    if len(states) > 3 and np.isfinite(states).all():
        run = Run.of(states, np.zeros((len(states) - 1, signals.n_u))).continued(signals)
        noise = np.sqrt(guessed_noise([run], np.array([state.scale for state in signals.states])))
        shares = (run.states.std(axis=0) / noise).tolist()
        moved = [
            share if state.measured else None for share, state in zip(shares, signals.states, strict=True)
        ]
    for i, state in enumerate(signals.states):
        kept, missing = _finite(states[:, i])
        beyond = None
        if state.envelope is not None and len(kept):
            usages = usages_of(signals, states, only=state)
            beyond = float(outside(usages[np.isfinite(states[:, i])]).mean())
        least, greatest = _ends(kept)
        yield Column(state.name, state.unit, False, least, greatest, missing, moved[i], None, beyond)


def _commands(commands: Floats, signals: Signals) -> Iterator[Column]:
    for j, command in enumerate(signals.commands):
        kept, missing = _finite(commands[:, j])
        low, high = command.bounds
        near = 1e-9 * (high - low)
        at_bound = beyond = None
        if len(kept):
            at_bound = float(((kept <= low + near) | (kept >= high - near)).mean())
            beyond = float(((kept < low - near) | (kept > high + near)).mean())
        least, greatest = _ends(kept)
        yield Column(command.name, command.unit, True, least, greatest, missing, None, at_bound, beyond)


def _of_column(column: Column, rows: int) -> Iterator[Remark]:
    name = column.name
    if column.missing:
        yield serious(
            "not-a-number",
            f"{name} has no finite number in {column.missing} of {rows} rows: fill in single ones from their"
            " neighbours, or cut the log there.",
        )
        return
    if column.command:
        if column.beyond:
            yield serious(
                "beyond-bounds",
                f"{name} is beyond its bounds in {100.0 * column.beyond:.3g} % of the rows ("
                f"{in_unit(f'{column.least:g} to {column.greatest:g}', column.unit)}): check its"
                " unit, and that the sent command was logged, not the requested one.",
            )
        elif (column.at_bound or 0.0) > SATURATED and column.least != column.greatest:
            yield note(
                "saturated",
                f"{name} is at a bound in {100.0 * (column.at_bound or 0.0):.3g} % of the rows: its effect in"
                " between can hardly be learnt.",
            )
        return
    if column.least is None:
        return  # a log without rows: that it is too short is said already
    if rows == 1:
        return  # of a single reading nothing can be said
    if column.least == column.greatest:
        yield serious(
            "still",
            f"{name} is {in_unit(f'{column.least:g}', column.unit)} in every row: its sensor was off, or not logged.",
        )
    elif column.moved is not None and column.moved < MOVED:
        yield note(
            "little-moved",
            f"{name} moved only {two_digits(column.moved)} times its noise: below {MOVED:g} little can be learnt about"
            " it; excite it more.",
        )
    yield from _of_envelope(column)


def _of_envelope(column: Column) -> Iterator[Remark]:
    """That a state was outside its envelope: of one that is computed from others' readings, all that is said of it."""
    if column.beyond:
        said = f"{column.name} was outside its envelope in {100.0 * column.beyond:.3g} % of the rows"
        if column.beyond <= OUTSIDE:
            yield note("envelope", f"{said}.")
        else:
            yield serious(
                "envelope",
                f"{said} ({in_unit(f'{column.least:g} to {column.greatest:g}', column.unit)}): check its unit and its"
                " offset. If it truly was there, cut the log where it left the envelope, or declare a wider one.",
            )


def _of_scales(states: Floats, signals: Signals) -> Iterator[Remark]:
    """Readings that are far from what was declared as usual: most often a unit."""
    for i, state in enumerate(signals.states):
        kept, _ = _finite(states[:, i])
        if not len(kept) or state.periodic:
            continue
        most = float(np.abs(kept).max())
        if most > 2.0 * Limits(signals).states[i]:
            yield serious(
                "scale",
                f"{state.name} reaches {in_unit(f'{most:.4g}', state.unit)}, {most / state.scale:.3g} times its"
                " scale: check its unit (degrees, milli?), or declare a larger scale.",
            )
        elif 0.0 < most < SMALL * state.scale:
            yield note(
                "scale",
                f"{state.name} stays within {in_unit(f'{most:.3g}', state.unit)}, {two_digits(most / state.scale)} of"
                " its scale: check its unit.",
            )


def _of_run(
    t: Floats,
    states: Floats,
    commands: Floats,
    signals: Signals,
    before: Sequence[Remark],
    lines: Sequence[int] | None,
    compared: bool,
) -> Sequence[Remark]:
    """What is said of a run when it is learnt, and what would refuse it that was not said yet."""
    known = any(remark.serious for remark in before)
    try:
        run = Trajectory(t, states, commands)
    except InvalidInput as reason:
        return [] if known else [serious("refused", str(reason))]
    if any(remark.code == "period" for remark in before):
        # What is integrated or counted in periods would only repeat that these are wrong.
        return [remark for remark in suspicious([run], signals) if remark.serious]
    runs, found = without_turns(
        [run], signals, lambda _, row: f"at {row_name(row, lines)}, {moment(run.t[row], signals.dt)} s"
    )
    found += [*against_derivatives(runs, signals), *suspicious(runs, signals)]
    if compared and not known and not any(remark.serious for remark in found):
        found += _of_columns(run, signals, {remark.code for remark in found})
    if not known:
        try:
            check_recorded(run, Limits(signals), None)
        except InvalidInput as reason:
            found.append(serious("refused", in_file(reason, lines)))
    return found


def _of_columns(run: Trajectory, signals: Signals, codes: Set[str]) -> Iterator[Remark]:
    """What columns that are right by themselves say beside each other."""
    states = signals.continued(run.states, run.states[0])
    if not codes & AS_LATE:
        yield from late(states, signals)
    yield from alike(states[:-1], run.commands, signals)
