"""Texts from anybody: refused at the door if no file could hold them, or made fit for where they are going."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from twinloop.errors import InvalidInput


def text(what: str, value: object) -> str:
    """A text that every file and page can hold.

    Args:
        what: how to call it in an error, such as "Trajectory.reason".
        value: the text.

    Returns:
        The text as it is.

    Raises:
        InvalidInput: it is no text, or has halves of characters, such as from a file name in another encoding.
    """
    if not isinstance(value, str):
        raise InvalidInput(f"{what}: expected a text, found {value!r}; write it in quotes.")
    try:
        value.encode()
    except UnicodeEncodeError as reason:
        around = value[max(0, reason.start - 20) : reason.end + 20]
        raise InvalidInput(
            f"{what}: expected a text of whole characters, found half of one in {around!r}; remove it, or decode the"
            " text in the encoding that it was written in."
        ) from reason
    return value


def whole_characters(words: str) -> str:
    r"""A text that UTF-8 can hold: half a character becomes its number, such as \udcff.

    Args:
        words: from anybody, such as those of a command.
    """
    return words.encode("utf-8", "backslashreplace").decode("utf-8")


def to_type(*words: object) -> str:
    """A command of twinloop as a shell takes it: names with blanks are quoted.

    Args:
        words: verb and arguments.
    """
    return shlex.join(["twinloop", *map(str, words)])


def one_line(text: str) -> str:
    """A text on one line without control characters, as a comment or an attribute may hold it.

    Args:
        text: from anybody, such as a unit.
    """
    return " ".join("".join(each if each.isprintable() else " " for each in text).split())


def enumerated(names: Sequence[str]) -> str:
    """Names in a sentence, such as "roll, pitch and yaw".

    Args:
        names: at least one.
    """
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


def in_unit(text: str, unit: str) -> str:
    """A number, or a range of them, in its unit; alone where that is none.

    Args:
        text: of the number.
        unit: of it; "" and "1" are none.
    """
    return text if unit in ("", "1") else f"{text} {one_line(unit)}"


def two_digits(value: float) -> str:
    """A number of which two digits count, such as "0.012", or "120" and not "1.2e+02"."""
    return f"{float(f'{value:.2g}'):g}"
