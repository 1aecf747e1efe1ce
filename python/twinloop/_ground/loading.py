"""Ctrl-C while the command loads: one sentence and 130, no traceback. The first thing that the package imports.

Loading takes most of a second, in which the command line cannot catch anything yet. Only the command is quiet: a script
that imports the package gets its `KeyboardInterrupt` as ever.
"""

import os
import signal
import sys
from types import FrameType

NO_RESULT = "Interrupted before there was a result."
INTERRUPTED = 130
"""Exit code after Ctrl-C."""


def heard() -> None:
    """From here on the command line hears Ctrl-C."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _is_command() -> bool:
    """Whether this process was started as `twinloop`, or as `python -m twinloop`, which says "-m" in `sys.argv` yet."""
    called = "".join(sys.orig_argv[-len(sys.argv) :][:1])
    return os.path.splitext(os.path.basename(called))[0].removeprefix("-m") == "twinloop"


def _end(signal_number: int, frame: FrameType | None) -> None:
    try:
        os.write(2, f"twinloop: {NO_RESULT}\n".encode())
    finally:
        os._exit(INTERRUPTED)


# Where whoever started it has it ignore Ctrl-C, it goes on ignoring it.
if _is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _end)
