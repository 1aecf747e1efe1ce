"""A block that Ctrl-C does not cut in two: a signal that comes meanwhile is handled at its end."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Holds back every signal that Python handles, for a handler may raise anywhere, as that of Ctrl-C does.

    The second one of a kind is handled at once: a database that does not answer must not be the end of Ctrl-C. Python
    runs handlers in the main thread alone, so that nothing is held back in others.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {each: found for each in signal.valid_signals() if callable(found := signal.getsignal(each))}
    came: list[int] = []
    over = False

    def note(number: int, frame: FrameType | None) -> None:
        if over or number in came:
            handlers[signal.Signals(number)](number, frame)
        else:
            came.append(number)

    try:
        for number in handlers:
            signal.signal(number, note)
        yield
    finally:
        over = True
        try:
            for number, handler in handlers.items():
                signal.signal(number, handler)
        finally:
            _handle_all(came)


def _handle_all(numbers: Sequence[int]) -> None:
    """Handles signals one after another, also those behind one whose handler raises."""
    if numbers:
        try:
            signal.raise_signal(numbers[0])
        finally:
            _handle_all(numbers[1:])
