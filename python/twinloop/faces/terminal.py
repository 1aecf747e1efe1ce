"""What a command needs around it: standard streams that take every text, closed or not; signals heard as Ctrl-C."""

from __future__ import annotations

import codecs
import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from twinloop._ground.loading import heard
from twinloop.errors import RemarkWarning

DASHES = "─–—−"
"""What a stream that cannot print them shows as hyphens; of all else that it cannot print it shows a question mark.

A stream in ASCII never comes to it: click writes UTF-8 there.
"""
NEAREST = "twinloop.nearest"
"""Name of that rule, for `codecs`."""

Handler = Callable[[int, FrameType | None], object]


@contextmanager
def prepared() -> Iterator[None]:
    """A command's surroundings: no text is too much for standard output and error, Ctrl-C is heard, SIGTERM as well.

    So is SIGHUP, of a terminal that is closed or a connection that is lost, unless it was ignored, as under `nohup`.
    Remarks are in the result that is shown, and so are no warnings beside it.
    """
    warnings.simplefilter("ignore", RemarkWarning)
    codecs.register_error(NEAREST, _nearest)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # Closed (`2>&-`): the next file that is opened would take its place, and what C code prints with it.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape"):
            stream.reconfigure(errors=NEAREST)
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard()
    handlers: dict[int, Handler] = {signal.SIGTERM: signal.default_int_handler}
    # Windows has none.
    hang_up = getattr(signal, "SIGHUP", None)
    if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:
        handlers[hang_up] = _hearing_once()
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def _hearing_once() -> Handler:
    """A handler of SIGHUP: as Ctrl-C, once, with nothing more written to the terminal that is gone.

    The shell and the kernel send one each: the second must not end what a rig does to come to rest after the first. Nor
    must a line that it prints meanwhile, which would fail.
    """
    terminals = [number for number in (1, 2) if os.isatty(number)]
    heard_it = False

    def hung_up(number: int, frame: FrameType | None) -> None:
        nonlocal heard_it
        if heard_it:
            return
        heard_it = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for terminal in terminals:
            os.dup2(nowhere, terminal)
        os.close(nowhere)
        signal.default_int_handler(number, frame)

    return hung_up


def is_closed() -> bool:
    """Whether standard output goes nowhere, because it was closed."""
    return sys.stdout is None or getattr(sys.stdout, "name", None) == os.devnull


def is_utf_8() -> bool:
    """Whether standard output is UTF-8, as JSON has to be where it is more than ASCII."""
    return codecs.lookup(getattr(sys.stdout, "encoding", None) or "utf-8").name == "utf-8"


def _nearest(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    text = error.object[error.start : error.end]
    return "".join("-" if letter in DASHES else "?" for letter in text), error.end
