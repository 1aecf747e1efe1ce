"""Headers of logs: which column is probably meant by the name of a signal."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import SequenceMatcher

from twinloop.errors import InvalidInput, unknown
from twinloop.remarks import Remark, note

ALIKE = 0.75
"""Similarity from which a name is taken for a mistyped other one: "torqe" for "torque", but not "t" for "tz"."""
LONGEST, MOST = 80, 500
"""Characters of a column's name, and columns, up to which they are compared."""
UNIT = re.compile(r"(.*?)[\s_]*[\[(]([^\])]*)[\])]")
"""A name with a unit in brackets: "roll [rad]", "Roll (rad)"."""
ALIASES = {"t": ("time", "timestamp")}
SHOWN = 20


def listed(names: Sequence[str]) -> str:
    """Names of columns, of many the first.

    Args:
        names: of all.
    """
    return ", ".join([*names[:SHOWN], *(["…"] if len(names) > SHOWN else [])]) or "none"


def refuse_others(columns: Mapping[str, str], wanted: Sequence[str], where: str) -> None:
    """Refuses columns of something that is no signal.

    Args:
        columns: what some signals are called in logs.
        wanted: the signals' own names.
        where: what messages call the place where that is said.

    Raises:
        InvalidInput: a name that is none of theirs.
    """
    for name in columns:
        if name not in wanted:
            raise unknown(f"signal {where}", name, wanted)


def renamed(head: Sequence[str], columns: Mapping[str, str], wanted: Sequence[str], called: str) -> list[str]:
    """The header of a log with the names that signals have.

    Args:
        head: names of its columns.
        columns: of some that are wanted, what they are called in logs. One that this log does not have is left: the
            log may have been written with the signals' own names.
        wanted: the signals' own names.
        called: what messages call the log.

    Returns:
        A name for each column; an empty one where its own name is that of a signal which another column has.

    Raises:
        InvalidInput: of something that is no signal, no name, or one for two signals.
    """
    if not isinstance(columns, Mapping):
        raise InvalidInput(
            f"Log {called}, columns: expected a column's name for each signal's, found {columns!r}; write a dict."
        )
    refuse_others(columns, wanted, f"in the columns of the log {called}")
    own: dict[str, str] = {}
    for name, column in columns.items():
        if isinstance(column, str):
            column = column.strip()
        if not isinstance(column, str) or column in own:
            raise InvalidInput(
                f"Log {called}, columns: expected a column of its own for {name!r}, found {column!r}"
                + (f" for {own[column]!r}, too; name another." if isinstance(column, str) else "; name one.")
            )
        own[column] = name
    found = {column: name for column, name in own.items() if column in head}
    return [found.get(column, "" if column in found.values() else column) for column in head]


def remarks_on(columns: Mapping[str, str], head: Sequence[str], units: Mapping[str, str]) -> Iterator[Remark]:
    """What is said of columns of other names: those that are not there, and those in another unit.

    Args:
        columns: what some signals are called in a log.
        head: names of its columns.
        units: of the signals that are read, by name.
    """
    absent = {name: column for name, column in columns.items() if column.strip() not in head}
    if own := [name for name in absent if name in units]:
        yield note(
            "column",
            f"No column is called {listed([repr(absent[name]) for name in own])}: {listed(own)}"
            f" {'is' if len(own) == 1 else 'are'} read from the column{'s' * (len(own) > 1)} of that name.",
        )
    for name, column in columns.items():
        if name in units and name not in absent and _in_another_unit(units[name], column):
            yield note(
                "unit",
                f"The column {column!r} is read as {name}, which is in {units[name]}: convert it if it is in another"
                " unit.",
            )


def as_called(names: Sequence[str], columns: Mapping[str, str]) -> list[str]:
    """Names of signals whose columns are missing, with what was said that these are called: there it may be mistyped.

    Args:
        names: of the signals.
        columns: what some signals are called in a log.
    """
    return [
        f"{name} ({columns[name].strip()!r} under [log], or by `columns`)" if name in columns else name
        for name in names
    ]


def advice(missing: Mapping[str, str], unused: Sequence[str], columns: Mapping[str, str]) -> str:
    """What to do about columns that are missing.

    Args:
        missing: unit of each name that is wanted.
        unused: columns that no signal has.
        columns: what some signals are called in a log; one that is nearly called so is probably meant, too.

    Returns:
        For each name the column that is probably meant, no column twice; without any, how columns are named.
    """
    compared = [column for column in unused if len(column) <= LONGEST][:MOST]
    pairs = sorted(
        (
            (max(_likeness(name, unit, column), _mistyped(columns.get(name, ""), column)), name, column)
            for name, unit in missing.items()
            for column in compared
        ),
        key=lambda pair: -pair[0],
    )
    meant: dict[str, str] = {}
    for likeness, name, column in pairs:
        if likeness >= ALIKE and name not in meant and column not in meant.values():
            meant[name] = column
    if not meant:
        return "name columns as the signals are named."
    said = [
        f"{meant[name]!r} for {name}{_unit(missing[name], meant[name])}" for name in missing if name in meant
    ]
    return f"did you mean {', '.join(said)}?"


def _likeness(name: str, unit: str, column: str) -> float:
    """How probable it is that a column is meant by a name: 1 where they differ in case and a unit alone."""
    name, found = name.casefold(), column.casefold()
    bare = UNIT.fullmatch(found)
    found = bare[1] if bare else found
    if found == name or found in ALIASES.get(name, ()):
        return 1.0
    if found.startswith(f"{name}_") and found[len(name) + 1 :] in _written(unit):
        return 1.0
    return SequenceMatcher(None, name, found).ratio()


def _mistyped(called: str, column: str) -> float:
    """How probable it is that a column's name was written so by mistake, unit and all."""
    return SequenceMatcher(None, called.strip().casefold(), column.casefold()).ratio()


def _written(unit: str) -> set[str]:
    """How a unit stands behind a name, and the other one of angles: "rad_s", "rads", "radps"."""
    units = {unit.casefold(), unit.casefold().replace("rad", "deg"), unit.casefold().replace("deg", "rad")}
    return {each.replace("/", by).replace(" ", "_") for each in units for by in ("_", "", "p")}


def _unit(wanted: str, column: str) -> str:
    """The unit that is wanted, in words, where the header of a column has another one."""
    return f" (which is in {wanted})" if _in_another_unit(wanted, column) else ""


def _in_another_unit(wanted: str, column: str) -> bool:
    """Whether the header of a column has another unit in brackets than the one that is wanted."""
    bare = UNIT.fullmatch(column)
    return bare is not None and bare[2].strip() not in (wanted, "")
