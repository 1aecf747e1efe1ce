"""Standard streams that can take every text, closed or not, and SIGTERM as Ctrl-C: what a command needs around it."""

from __future__ import annotations

import codecs
import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from twinloop._ground.loading import heard
from twinloop.errors import RemarkWarning

DASHES = "─–—−"
"""What a stream that cannot print them shows as hyphens; of all else that it cannot print it shows a question mark.

A stream in ASCII never comes to it: click writes UTF-8 there.
"""
NEAREST = "twinloop.nearest"
"""Name of that rule, for `codecs`."""


@contextmanager
def prepared() -> Iterator[None]:
    """A command's surroundings: no text is too much for standard output and error, Ctrl-C is heard, SIGTERM as well.

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
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)


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
