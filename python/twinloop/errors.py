"""Misuse and failure, each said in one sentence: what was expected, what was found, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

__all__ = [
    "InvalidInput",
    "NoAnswer",
    "NotAvailable",
    "NotTrusted",
    "RemarkWarning",
    "StoreFailure",
    "SystemFailure",
    "TooRisky",
    "TwinloopError",
]


class TwinloopError(Exception):
    """Base of all errors of Twinloop.

    Args:
        sentence: what was expected, what was found, what to do; in one line.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(" ".join(sentence.split()))


class InvalidInput(TwinloopError, ValueError):
    """An argument cannot be used; the call has changed nothing."""


class AtRow(InvalidInput):
    """A row of a record cannot be used; `at` names it by its line where the record stands in a file.

    Args:
        before: the sentence up to the row.
        row: its index.
        after: the rest of the sentence.
    """

    def __init__(self, before: str, row: int, after: str) -> None:
        super().__init__(f"{before} {row_name(row)}{after}")
        self.parts = before, row, after

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[str]]:
        return InvalidInput, (str(self),)


class SystemFailure(TwinloopError, RuntimeError):
    """The system under test raised an exception, or returned something that is no next state."""


class NoAnswer(SystemFailure):
    """The system has not answered a test: it hangs, or a log is not there yet; the test still waits."""


class TooRisky(TwinloopError, RuntimeError):
    """A test is riskier than allowed; it was not flown and still waits."""


class StoreFailure(TwinloopError, RuntimeError):
    """A store cannot be read or written now; its contents are unchanged."""


class NotAvailable(TwinloopError, RuntimeError):
    """The requested value does not exist yet, or not in this installation."""


class NotTrusted(NotAvailable):
    """A twin fails its checks, or no controller can be answered for: learn from more tests."""


class RemarkWarning(UserWarning):
    """A remark on data or a twin: check it before you use the result. `twin.remarks` has those on a twin as values."""


def row_name(row: int, lines: Sequence[int] | None = None) -> str:
    """What every sentence calls a row of a record.

    In a file it is its line, as an editor shows it: from 1, with the header and empty lines. In arrays it is the index
    that Python takes: from 0.

    Args:
        row: its index.
        lines: of each row in its file; None: the record stands in no file with lines.

    Returns:
        Such as "line 46" or "row 44".
    """
    return f"row {row}" if lines is None else f"line {lines[row]}"


@contextmanager
def at(where: str, lines: Sequence[int] | None = None) -> Iterator[None]:
    """Adds the place to the errors of a block, such as a file and its section.

    Args:
        where: such as a file and its section.
        lines: of each row of a record in that file; None: rows are called by their index.

    Raises:
        InvalidInput: as inside, with the place before it.
    """
    try:
        yield
    except InvalidInput as reason:
        raise InvalidInput(f"{where}: {in_file(reason, lines)}") from reason


def in_file(reason: InvalidInput, lines: Sequence[int] | None) -> str:
    """The sentence of an error, with a row by its line.

    Args:
        reason: the error.
        lines: of each row in its file; None: the record stands in no file with lines.
    """
    if not isinstance(reason, AtRow):
        return str(reason)
    before, row, after = reason.parts
    return f"{before} {row_name(row, lines)}{after}"


def comma_separated(names: Iterable[str]) -> str:
    """Names behind commas, in quotes where a name holds commas itself, as those of a sweep's campaigns do.

    Args:
        names: in their order.
    """
    every = list(names)
    return ", ".join(map(repr, every) if any("," in name for name in every) else every)


def unknown(kind: str, found: object, known: Iterable[str]) -> InvalidInput:
    """The error for a name that is not on a list.

    Args:
        kind: what the name stands for, such as "preset".
        found: the name that was given.
        known: the names that there are.

    Returns:
        An error that names the nearest known name, or all of them if none is near.
    """
    names = [str(name) for name in known]
    near = difflib.get_close_matches(str(found), names, n=1)
    advice = (
        f"did you mean {near[0]!r}?"
        if near
        else f"expected one of {comma_separated(names) or '(there are none)'}."
    )
    return InvalidInput(f"Unknown {kind} {str(found)!r}: {advice}")
