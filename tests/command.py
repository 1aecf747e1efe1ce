"""The command line as a person calls it, in this process and in one of its own."""

import json
import signal
import subprocess
import sys

from click.testing import CliRunner

from twinloop.faces.cli import main


def twinloop_command(*arguments, **how):
    return subprocess.run(
        [sys.executable, "-m", "twinloop", *arguments], capture_output=True, text=True, timeout=120, **how
    )


def hearing_ctrl_c():
    """To be called in a new process: whoever started the tests in the background has them, and theirs, ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(signal, "SIGHUP"):  # as `nohup` has it
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def invoke(*arguments):
    return CliRunner().invoke(main, list(arguments))


def same_but_for_run_info(a, b):
    a, b = json.loads(a), json.loads(b)
    assert a.pop("run_info") and b.pop("run_info")
    assert a == b
    return a
