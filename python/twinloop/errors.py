"""Misuse and failure, each said in one sentence: what was expected, what was found, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

__all__ = [
    "InvalidInput",
    "NoAnswer",
    "NotAvailable",
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


class RemarkWarning(UserWarning):
    """A serious remark on data or a twin: check it before you use the result. `twin.remarks` has it as a value."""


@contextmanager
def at(where: str) -> Iterator[None]:
    """Adds the place to the errors of a block, such as a file and its section.

    Args:
        where: such as a file and its section.

    Raises:
        InvalidInput: as inside, with the place before it.
    """
    try:
        yield
    except InvalidInput as reason:
        raise InvalidInput(f"{where}: {reason}") from reason


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
        f"did you mean {near[0]!r}?" if near else f"expected one of {', '.join(names) or '(there are none)'}."
    )
    return InvalidInput(f"Unknown {kind} {str(found)!r}: {advice}")
