"""Logs of flights: CSV and NumPy files with a column for the time and one for each state and command."""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from twinloop.arrays import Floats
from twinloop.errors import InvalidInput, unknown
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

TIME = "t"
"""Name of the column of times, s."""
DELIMITERS = ",;\t"
MOST_BYTES = 200_000_000
"""Of a log, unpacked: an hour of twenty signals at a kilohertz, as text."""


def load(
    path: str | Path,
    signals: Signals,
    *,
    ended: str = "completed",
    reason: str = "",
    name: str | None = None,
) -> Trajectory:
    """A recorded flight from a file.

    A CSV file has a header with `t` (s), the names of the states and those of the commands, in any order; other columns
    are left out, and the commands of the last row may be empty. A file of NumPy (`.npz`) has arrays `t` (n + 1,),
    `states` (n + 1, n_x) and `commands` (n, n_u) or (n + 1, n_u), the last row of which counts for nothing.

    Args:
        path: of the file.
        signals: names of the columns, and the order of states and commands.
        ended: "completed", "aborted" or "diverged".
        reason: why it did not complete.
        name: what messages call it; None: its path.

    Returns:
        The flight.

    Raises:
        InvalidInput: no such file, a column that is missing, or something that is no number.
    """
    t, states, commands = read_log(path, signals, name)
    return Trajectory(t, states, commands, ended=ended, reason=reason)


def read_log(path: str | Path, signals: Signals, name: str | None = None) -> tuple[Floats, Floats, Floats]:
    """The columns of a log as they stand there, whatever is wrong with them.

    Args:
        path: of the file.
        signals: names of the columns, and the order of states and commands.
        name: what messages call it; None: its path.

    Returns:
        Times (n + 1,), states (n + 1, n_x) and commands (n, n_u); of an `.npz` file in the shapes that it has.

    Raises:
        InvalidInput: no such file, a column that is missing, or something that is no number.
    """
    path = Path(path)
    called = str(path) if name is None else name
    try:
        _check_size(called, path.stat().st_size)
        t, states, commands = (
            _arrays(path, called) if path.suffix == ".npz" else _columns(path, called, signals)
        )
    except OSError as reason:
        raise InvalidInput(
            f"Log {called}: expected a file, found {reason.strerror}; check its name."
        ) from reason
    return t, states, commands[:-1] if len(commands) == len(t) else commands


def write_columns(path: Path, columns: Mapping[str, Floats]) -> None:
    """Writes a CSV file; numbers have all their digits.

    Args:
        path: of the file; what was there is replaced.
        columns: by name; a shorter one ends with empty cells.

    Raises:
        OSError: the file cannot be written.
    """
    rows = max(len(values) for values in columns.values())
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in range(rows):
            writer.writerow(
                [repr(float(values[row])) if row < len(values) else "" for values in columns.values()]
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
            return arrays[TIME], arrays["states"], arrays["commands"]
    except OSError:
        raise
    except InvalidInput:
        raise
    except Exception as reason:
        raise InvalidInput(
            f"Log {called}: expected a file of NumPy with arrays of numbers, found another one: {reason}."
        ) from reason


def _columns(path: Path, called: str, signals: Signals) -> tuple[Floats, Floats, Floats]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as reason:
        raise InvalidInput(
            f"Log {called}: expected text in UTF-8, found other bytes; save it as CSV."
        ) from reason
    head = text.partition("\n")[0]
    delimiter = max(DELIMITERS, key=head.count)
    try:
        lines = list(csv.reader(text.splitlines(), delimiter=delimiter))
    except csv.Error as reason:
        raise InvalidInput(
            f"Log {called}: expected columns of numbers, found: {reason}; save it as CSV."
        ) from reason
    rows = [row for row in lines if any(cell.strip() for cell in row)]
    names = [name.strip() for name in rows[0]] if rows else []
    for name in (TIME, *signals.state_names, *signals.command_names):
        if name not in names:
            raise unknown(f"column, which the log {called} should have:", name, names)
    body = rows[1:]

    def column(name: str, count: int) -> list[float]:
        place = names.index(name)
        return [_number(row, place, name, i + 2, called) for i, row in enumerate(body[:count])]

    def matrix(wanted: Sequence[str], count: int) -> Floats:
        return np.array([column(name, count) for name in wanted]).reshape(len(wanted), -1).T

    n = len(body)
    return np.array(column(TIME, n)), matrix(signals.state_names, n), matrix(signals.command_names, n - 1)


def _number(row: Sequence[str], place: int, name: str, line: int, called: str) -> float:
    text = row[place].strip() if place < len(row) else ""
    try:
        return float(text)
    except ValueError as reason:
        raise InvalidInput(
            f"Log {called}, line {line}: expected a number for {name}, found {text!r}; mend or remove the line."
        ) from reason
