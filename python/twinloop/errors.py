"""Misuse and failure, each said in one sentence: what was expected, what was found, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class TwinloopError(Exception):
    """Everything that Twinloop raises on purpose.

    Args:
        sentence: what was expected, what was found, what to do; it is told in one line.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(" ".join(sentence.split()))


class InvalidInput(TwinloopError, ValueError):
    """Something that was passed in cannot be used; nothing was changed by the call."""


class SystemFailure(TwinloopError, RuntimeError):
    """The system under test raised, or answered with something that is no next state."""


class NoAnswer(SystemFailure):
    """The system has not answered a test that still waits for it: what hangs, or a log that is not there yet."""


class TooRisky(TwinloopError, RuntimeError):
    """A test that was asked for is riskier than what was allowed; it waits and was not flown."""


class StoreFailure(TwinloopError, RuntimeError):
    """A store cannot be read or written now; what it held before it holds still."""


class NotAvailable(TwinloopError, RuntimeError):
    """What was asked for does not exist yet, or not in this installation."""


class RemarkWarning(UserWarning):
    """A serious remark on data or a twin: look into it before you use the result. `twin.remarks` has it as a value."""


@contextmanager
def at(where: str) -> Iterator[None]:
    """Refusals of what stands somewhere, told with its place.

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


@contextmanager
def engine_input() -> Iterator[None]:
    """Turns the engine's refusals into `InvalidInput`, with the engine's own sentence.

    Raises:
        InvalidInput: where the engine raised a ValueError, or an OverflowError for a count below 0.
    """
    try:
        yield
    except TwinloopError:
        raise
    except (ValueError, OverflowError) as refusal:
        sentence = str(refusal)
        raise InvalidInput(sentence if sentence.endswith((".", "?")) else f"{sentence}.") from refusal
