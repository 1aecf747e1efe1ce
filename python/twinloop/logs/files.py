"""Logs of flights: files of CSV, NumPy and PX4 with the time and the values of each state and command."""

from __future__ import annotations

import csv
import io
import warnings
import zipfile
from array import array
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.times import moment
from twinloop._ground.writing import write_whole
from twinloop.errors import AtRow, InvalidInput, RemarkWarning, at
from twinloop.logs.even_times import part_of
from twinloop.logs.headers import advice, as_called, listed, remarks_on, renamed
from twinloop.logs.missing import filled
from twinloop.logs.samples import Window
from twinloop.logs.table import TIME, Row, number_in, refuse_cut, refuse_longer, rows_of
from twinloop.logs.ulog import read_ulog
from twinloop.remarks import Remark
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory
from twinloop.unmeasured import columns_of, logged, names_of

WHOLE = Window()
ELSEWHERE = " What they are called may also be said by `columns`, or under [log] of the campaign file."
MOST_BYTES = 200_000_000
"""Of a log, unpacked: an hour of twenty signals at a kilohertz, as text."""


@dataclass(frozen=True, eq=False)
class Log:
    """The columns of a log as they stand there, whatever is wrong with them; of a `.ulg` on the period of the signals.

    Only single readings that are missing are filled in, which a remark says.

    Args:
        called: what messages call it.
        signals: names of the columns, and the order of states and commands.
        t: times (n + 1,), s.
        states: (n + 1, n_x).
        commands: (n, n_u); like the others, those of an `.npz` file have the shape that they have there.
        lines: of each row in the file (n + 1,); None: it has no lines.
        remarks: on the file.
    """

    called: str
    signals: Signals
    t: Floats
    states: Floats
    commands: Floats
    lines: Sequence[int] | None
    remarks: tuple[Remark, ...] = ()

    def warn(self) -> None:
        """Says its remarks as Python does, as a `RemarkWarning` each at the line of the caller's caller."""
        for remark in self.remarks:
            warnings.warn(
                f"Log {self.called}: {remark.sentence} ({remark.code})", RemarkWarning, stacklevel=3
            )

    def trajectory(self, ended: str = "completed", reason: str = "") -> Trajectory:
        """The flight.

        Args:
            ended: "completed", "aborted" or "diverged".
            reason: why it did not complete.

        Raises:
            InvalidInput: a value that is no number, or columns that are no flight.
        """
        with self.errors():
            names = (*names_of(self.states, self.signals), *self.signals.command_names)
            _refuse_no_number(self.t, names, (self.states, self.commands), self.signals.dt)
            return Trajectory(self.t, self.states, self.commands, ended=ended, reason=reason)

    def errors(self) -> AbstractContextManager[None]:
        """Within it, errors name the log, and rows by their lines."""
        return at(f"Log {self.called}", self.lines)


def load(
    path: str | Path,
    signals: Signals,
    *,
    ended: str = "completed",
    reason: str = "",
    name: str | None = None,
    columns: Mapping[str, str] | None = None,
    start: float | None = None,
    stop: float | None = None,
) -> Trajectory:
    """A recorded flight from a file.

    A CSV file has a header with `t` (s), the names of the states and those of the commands, in any order, or what
    `columns` says that they are called there; other columns are ignored, states that are not measured may be missing,
    and the commands of the last row may be empty. If the file ends within a row, at a number that may be a part of
    one, it is refused. A file of NumPy (`.npz`) has arrays `t` (n + 1,), `states` (n + 1, n_x) and `commands` (n, n_u)
    or (n + 1, n_u), whose last row is ignored. Single readings may be missing (an empty cell, or NaN), up to a
    twentieth of a state's: each is taken half-way between those before and after, and a `RemarkWarning` says how many.

    A log of PX4 (`.ulg`, extra `ulog`) has topics with fields, each with its own times. They are resampled to the
    period of the signals: states are interpolated between two samples, and each command is the last one sent. If two
    samples are more than two periods apart, the log is refused. A topic with a quaternion `q` also has the angles
    "roll", "pitch" and "yaw". Of a log that was cut, as when power is lost, the part before is read, and a
    `RemarkWarning` says until when.

    Args:
        path: of the file.
        signals: names of the columns, and the order of states and commands.
        ended: "completed", "aborted" or "diverged".
        reason: why it did not complete.
        name: of the log in messages; None: its path.
        columns: of a `.ulg` the field of each state and command, such as {"roll": "vehicle_attitude.roll", "motor":
            "actuator_outputs/1.output[0]"}; of a CSV file the column of `t`, a state or a command that has another
            name there, such as {"t": "Time", "roll": "Roll (rad)"}. All are in the units of the signals.
        start: of the part that is meant, s after the first row, or after the beginning of a `.ulg`; None: as soon as
            all that is wanted is there.
        stop: of it, likewise; None: as long as all that is wanted is there.

    Returns:
        The flight.

    Raises:
        InvalidInput: no such file, a missing column or field, a value that is no number, or samples of a `.ulg` that
            are too far apart.
        NotAvailable: a `.ulg` without the package pyulog.
    """
    log = read_log(path, signals, name, columns, Window(start, stop))
    log.warn()
    return log.trajectory(ended, reason)


def read_log(
    path: str | Path,
    signals: Signals,
    name: str | None = None,
    columns: Mapping[str, str] | None = None,
    window: Window = WHOLE,
) -> Log:
    """The columns of a log as they stand there, with single missing readings filled in.

    Args:
        path: of the file.
        signals: names of the columns, and the order of states and commands.
        name: of the log in messages; None: its path.
        columns: of a `.ulg` the field of each state and command; of a CSV file the columns that have other names.
        window: the part that is meant, in s after the first row, or after the beginning of a `.ulg`.

    Raises:
        InvalidInput: no such file, a column that is missing, something that is no number, or a part with next to no
            rows.
        NotAvailable: a `.ulg` without the package pyulog.
    """
    path = Path(path)
    called = str(path) if name is None else name
    try:
        _check_size(called, path.stat().st_size)
        if path.suffix.lower() == ".ulg":
            t, states, commands, remarks = read_ulog(path, called, signals, columns, window)
            return Log(called, signals, t, states, commands, None, remarks)
        t, states, commands, lines, said = (
            (*_arrays(path, called), None, ())
            if path.suffix.lower() == ".npz"
            else _columns(path, called, signals, columns or {})
        )
    except OSError as reason:
        raise InvalidInput(
            f"Log {called}: expected a file that can be read, found: {reason.strerror}; check its name."
        ) from reason
    states, remarks = _completed(states, signals)
    sent = commands[:-1] if len(commands) == len(t) else commands
    return part_of(Log(called, signals, t, states, sent, lines, (*remarks, *said)), window)


def _completed(readings: Floats, signals: Signals) -> tuple[Floats, tuple[Remark, ...]]:
    """Readings without gaps of a single one, as far as they have the shape of some; and what was filled in."""
    if readings.ndim != 2 or readings.dtype.kind != "f" or readings.shape[1] != columns_of(readings, signals):
        return readings, ()
    names = names_of(readings, signals)
    return filled(readings, [state for state in signals.states if state.name in names])


def write_columns(path: Path, columns: Mapping[str, Floats]) -> None:
    """Writes a CSV file, whole or not at all; numbers have all their digits.

    Args:
        path: of the file; what was there is replaced.
        columns: by name; a shorter one ends with empty cells.

    Raises:
        OSError: it cannot be written; what was there is still there.
    """
    rows = max(len(values) for values in columns.values())
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(columns)
    for row in range(rows):
        writer.writerow(
            [repr(float(values[row])) if row < len(values) else "" for values in columns.values()]
        )
    write_whole(path, table.getvalue())


def _refuse_no_number(t: Floats, names: Sequence[str], parts: Sequence[Floats], dt: float) -> None:
    """Names the column and the time of a value that is not finite, as a person finds it in a log."""
    if any(values.ndim != 2 or values.dtype.kind != "f" for values in parts) or t.ndim != 1:
        return  # of another shape: Trajectory says what was expected
    columns = [column for values in parts for column in values.T]
    for name, column in zip(names, columns, strict=False):
        rows = np.flatnonzero(~np.isfinite(column))
        if len(rows) and rows[0] < len(t):
            raise AtRow(
                f"expected a finite number for {name} in each row, found {column[rows[0]]} in",
                int(rows[0]),
                f", t = {moment(t[rows[0]], dt)} s ({len(rows)} such row{'s' * (len(rows) > 1)}); fill it in, or cut"
                " the log before.",
            )


def _check_size(called: str, size: int) -> None:
    if size > MOST_BYTES:
        raise InvalidInput(
            f"Log {called}: expected at most {MOST_BYTES} bytes, found {size}; cut it to the flight, or thin it out."
        )


def _arrays(path: Path, called: str) -> tuple[Floats, Floats, Floats]:
    try:
        with zipfile.ZipFile(path) as archive:
            _check_size(called, sum(member.file_size for member in archive.infolist()))
        with np.load(path, allow_pickle=False) as arrays:
            missing = [name for name in (TIME, "states", "commands") if name not in arrays]
            if missing:
                raise InvalidInput(
                    f"Log {called}: expected arrays t, states and commands, found no {', '.join(missing)}; add them."
                )
            found = arrays[TIME], arrays["states"], arrays["commands"]
    except OSError:
        raise
    except InvalidInput:
        raise
    except Exception as reason:
        raise InvalidInput(
            f"Log {called}: expected a file of NumPy with arrays of numbers, found another one: {reason}."
        ) from reason
    for name, values in zip((TIME, "states", "commands"), found, strict=True):
        if not isinstance(values, np.ndarray):
            raise InvalidInput(
                f"Log {called}: expected an array {name}, found other bytes of that name; write it with numpy.savez."
            )
        if values.ndim == 0:
            raise InvalidInput(
                f"Log {called}: expected an array {name} with a row for each reading, found a single value; write all"
                " of them."
            )
    return found


def _columns(
    path: Path, called: str, signals: Signals, columns: Mapping[str, str]
) -> tuple[Floats, Floats, Floats, Sequence[int], Sequence[Remark]]:
    """Times, states and commands, the line of each row, and what is said of columns of other names."""
    rows = rows_of(path, called)
    first = next(rows, None)
    head = [] if first is None else [name.strip() for name in first.cells]
    names = renamed(head, columns, (TIME, *signals.state_names, *signals.command_names), called)
    states_read = [state.name for state in logged(signals, names)]
    rates = [state.name for state in signals.states if not state.measured and state.name in names]
    if rates and len(states_read) < signals.n_x:
        lacking = [state.name for state in signals.states if not state.measured and state.name not in names]
        raise InvalidInput(
            f"Log {called}: expected columns of all rates that are not measured, or of none, found {', '.join(rates)}"
            f" without {', '.join(lacking)}; remove or add columns."
        )
    wanted = (TIME, *states_read, *signals.command_names)
    twice = next((name for name in wanted if names.count(name) > 1), None)
    if twice is not None:
        raise InvalidInput(
            f"Log {called}: expected one column called {twice}, found {names.count(twice)}; rename or remove"
            " the others."
        )
    units = {TIME: "s"} | {state.name: state.unit for state in signals.states}
    units |= {command.name: command.unit for command in signals.commands}
    missing = [name for name in wanted if name not in names]
    if missing:
        unused = [name for name in names if name and name not in wanted]
        meant = advice({name: units[name] for name in missing}, unused, columns)
        raise InvalidInput(
            f"Log {called}: expected columns called {', '.join(wanted)}, found {listed(head)};"
            f" {', '.join(as_called(missing, columns))} {'is' if len(missing) == 1 else 'are'} missing:"
            f" {meant}{ELSEWHERE}"
        )
    # In numbers from the first row on; the commands of a row are read once there is another one. Of several columns
    # with something else in them the first one is said.
    found = {name: array("d") for name in wanted}
    wrong = dict[str, InvalidInput]()
    places = {name: names.index(name) for name in wanted}
    lines = array("q")
    before: Row | None = None
    for row in rows:
        refuse_longer(row, len(names), called)
        refuse_cut(row, names, (TIME, *states_read), called)
        read = [(row, name) for name in (TIME, *states_read)]
        if before is not None:
            read += [(before, name) for name in signals.command_names]
        for of, name in read:
            try:
                found[name].append(number_in(of, places[name], name, called, name in states_read))
            except InvalidInput as refusal:
                wrong.setdefault(name, refusal)
        lines.append(row.line)
        before = row
    for name in wanted:
        if name in wrong:
            raise wrong[name]

    def matrix(wanted: Sequence[str], rows: int) -> Floats:
        return np.array([found[name] for name in wanted], dtype=float).reshape(len(wanted), rows).T

    t, states = np.array(found[TIME]), matrix(states_read, len(lines))
    said = list(remarks_on(columns, head, {name: units[name] for name in wanted}))
    return t, states, matrix(signals.command_names, max(0, len(lines) - 1)), lines, said
