"""What is found in a row of a store: a database holds any text in a column, so that each is checked as it is read."""

from __future__ import annotations

import math
from datetime import datetime

from twinloop.errors import InvalidInput
from twinloop.records import Record, from_text
from twinloop.records.reading import shown


def record_in(column: str, text: object, what: str) -> Record:
    """A dict that a column holds as JSON.

    Args:
        column: its table and name, for an error.
        text: that stands there.
        what: the store and the campaign, likewise.

    Raises:
        InvalidInput: no text, no JSON, or something else than a dict.
    """
    found = from_text(_text(column, text, what), f"{what}, {column}")
    if not isinstance(found, dict):
        raise _changed(column, "a dict as JSON", found, what)
    return found


def provenance_in(column: str, text: object, what: str) -> Record:
    """The provenance of a session: a dict in which `command` is a list and `versions` a dict, where they are.

    Args:
        column: its table and name, for an error.
        text: that stands there.
        what: the store and the campaign, likewise.

    Raises:
        InvalidInput: anything else.
    """
    found = record_in(column, text, what)
    for key, kind, name in (("command", list, "a list"), ("versions", dict, "a dict")):
        if found.get(key) is not None and not isinstance(found[key], kind):
            raise _changed(f"{column}, {key}", name, found[key], what)
    return found


def progress_in(column: str, text: object, what: str) -> Record:
    """What a writer says that it does: the fields of `Doing` without `silent`.

    Args:
        column: its table and name, for an error.
        text: that stands there.
        what: the store and the campaign, likewise.

    Raises:
        InvalidInput: a field that is missing, or that is of another type.
    """
    found = record_in(column, text, what)
    phase, left = found.get("phase"), found.get("left")
    timed = left is None or isinstance(left, int) or (isinstance(left, float) and math.isfinite(left))
    counts = ("generation", "generations", "told", "experiments")
    fields = [
        ("phase", "a text", isinstance(phase, str)),
        *((key, "a whole number", isinstance(found.get(key), int)) for key in counts),
        ("left", "a number or null", timed),
    ]
    for key, expected, fits in fields:
        if not fits:
            raise _changed(column, f"{expected} as {key!r}", found.get(key), what)
    return {key: found.get(key) for key, _, _ in fields}


def moment_in(column: str, text: object, what: str) -> str:
    """A moment, such as "2026-11-28T10:00:00+00:00": with its zone, so that two of them have a difference.

    Args:
        column: its table and name, for an error.
        text: that stands there.
        what: the store and the campaign, likewise.

    Returns:
        The text.

    Raises:
        InvalidInput: no moment, or one without a zone.
    """
    said = _text(column, text, what)
    try:
        zone = datetime.fromisoformat(said).tzinfo
    except ValueError:
        zone = None
    if zone is None:
        raise _changed(column, "a date and time with its zone", said, what)
    return said


def count_in(column: str, number: object, what: str) -> int | None:
    """A number of runs; None where there is none.

    Args:
        column: its table and name, for an error.
        number: that stands there.
        what: the store and the campaign, likewise.

    Raises:
        InvalidInput: anything else; SQLite keeps a text in a column of numbers.
    """
    if number is None or isinstance(number, int):
        return number
    raise _changed(column, "a whole number", number, what)


def _text(column: str, value: object, what: str) -> str:
    if not isinstance(value, str):
        raise _changed(column, "a text", value, what)
    return value


def _changed(column: str, expected: str, found: object, what: str) -> InvalidInput:
    return InvalidInput(
        f"{what}: expected {expected} in {column}, found {shown(found)}; it was changed: use an earlier copy."
    )
