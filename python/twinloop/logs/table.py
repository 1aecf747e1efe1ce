"""Tables of CSV, row by row: where one ends too early or goes on too long, and which number a cell holds."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from twinloop.errors import InvalidInput

TIME = "t"
"""Name of the column of times, s."""
DELIMITERS = ",;\t"
LONGEST = 1_000_000
"""Characters of a line at most: some thousand columns."""


class Row(NamedTuple):
    """One of a table.

    Args:
        line: of the file in which it ends.
        cells: as text.
        last: whether it is the last one.
        cut: whether the file ends within its last line.
    """

    line: int
    cells: Sequence[str]
    last: bool
    cut: bool


def rows_of(path: Path, called: str) -> Iterator[Row]:
    """Rows of a table that are not empty, its header first.

    Only one of them is held at a time: as text a long log takes many times the room of its numbers.

    Args:
        path: of the file.
        called: what messages call the log.

    Raises:
        InvalidInput: no text in UTF-8, a line far too long, or no CSV.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            delimiter = max(DELIMITERS, key=file.readline(LONGEST).count)
            file.seek(0)
            # Not `splitlines`, which ends a row at any form feed or vertical tab in a note.
            lines = _Lines(file, called)
            # Strict: a quote that nobody closes would take all that follows into its cell.
            reader = csv.reader(lines, delimiter=delimiter, strict=True)
            before: tuple[int, list[str]] | None = None
            for row in reader:
                if not any(cell.strip() for cell in row):
                    continue
                if before is not None:
                    yield Row(*before, last=False, cut=False)
                before = reader.line_num, row
            if before is not None:
                yield Row(*before, last=True, cut=lines.goes_on)
    except UnicodeDecodeError as reason:
        raise InvalidInput(
            f"Log {called}: expected text in UTF-8, found other bytes; save it as CSV."
        ) from reason
    except csv.Error as reason:
        raise InvalidInput(
            f"Log {called}: expected columns of numbers, found: {reason}; save it as CSV."
        ) from reason


class _Lines:
    """Lines of a file with their ends, none longer than a table's may be."""

    def __init__(self, file: TextIO, called: str) -> None:
        self._file, self._called = file, called
        self.goes_on = False
        """Whether the last line so far has no end."""

    def __iter__(self) -> Iterator[str]:
        number = 0
        while line := self._file.readline(LONGEST + 1):
            number += 1
            if len(line) > LONGEST:
                raise InvalidInput(
                    f"Log {self._called}, line {number}: expected at most {LONGEST} characters, found more; save it as"
                    " CSV with a line for each reading."
                )
            self.goes_on = not line.endswith(("\n", "\r")) and bool(line.strip())
            yield line


def refuse_longer(row: Row, columns: int, called: str) -> None:
    """Refuses a row of more cells than there are columns: decimal commas between commas move every number after them.

    Args:
        row: of a table.
        columns: how many there are.
        called: what messages call the log.

    Raises:
        InvalidInput: such a row.
    """
    if any(cell.strip() for cell in row.cells[columns:]):
        raise InvalidInput(
            f"Log {called}, line {row.line}: expected {columns} cells, one for each column, found"
            f" {len(row.cells)}; write decimals with a point, and one number in a cell."
        )


def refuse_cut(row: Row, names: Sequence[str], needed: Sequence[str], called: str) -> None:
    """Refuses a row that may end within a number that is needed: behind a whole one stands a comma or a line end.

    In a row of all cells nothing tells a cut number from a whole one, and many programs write no last line end.

    Args:
        row: of a table.
        names: of the columns.
        needed: of them, those that the row must have.
        called: what messages call the log.

    Raises:
        InvalidInput: such a row.
    """
    place = len(row.cells) - 1
    if not row.cut or place + 1 >= len(names) or names[place] not in needed:
        return
    if row.cells[place].strip():
        raise InvalidInput(
            f"Log {called}, line {row.line}: expected {len(names)} cells or the end of the line, found that the file"
            f" ends at {row.cells[place].strip()!r}, which may be a part of {names[place]}; remove this row, or end the"
            " line if the number is whole."
        )


def number_in(row: Row, place: int, name: str, called: str, empty: bool) -> float:
    """The number of a cell; NaN where it is empty, as a historian leaves a reading that it does not have.

    Args:
        row: its row.
        place: of the cell.
        name: of its column.
        called: what messages call the log.
        empty: whether a single cell may be empty.

    Raises:
        InvalidInput: no such cell, or something else in it.
    """
    if place >= len(row.cells):
        raise InvalidInput(
            f"Log {called}, line {row.line}: expected a number for {name}, found a row of {len(row.cells)}"
            f" cell{'s' * (len(row.cells) > 1)} that ends before it; complete the row, or cut the log before it."
        )
    text = row.cells[place].strip()
    try:
        return _read(text) if text else np.nan
    except ValueError as reason:
        raise InvalidInput(
            f"Log {called}, line {row.line}: expected a number for {name}, found {text!r};"
            f" {_advice(text, name, empty)}."
        ) from reason


def _read(text: str) -> float:
    """A number as instruments write it: Python would take 1_000 and digits of other scripts as well."""
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


def _advice(text: str, name: str, empty: bool) -> str:
    """What to do about a cell that is no number."""
    whole, comma, rest = text.partition(",")
    if comma and whole.lstrip("+-").isdigit() and rest.isdigit():
        return "write decimals with a point"
    if name == TIME and any(mark in text for mark in ":-/"):
        return "write times in s from any start, such as that of the first row, not as dates"
    return "correct it" + (", or leave the cell empty where a single reading is missing" if empty else "")
