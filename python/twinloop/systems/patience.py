"""A run that must end in time: what hangs is left behind and said, and is not run again while it hangs."""

from __future__ import annotations

import threading
import time

from twinloop._ground.arrays import number
from twinloop.errors import NoAnswer
from twinloop.systems.base import System
from twinloop.test import Test
from twinloop.trajectory import Trajectory

LOOK = 0.2
"""Seconds between two moments at which Ctrl-C is heard."""
_hanging: dict[int, threading.Thread] = {}
"""By the identity of the system, which its thread keeps alive."""


def run_within(system: System, test: Test, seconds: float | None, landed: list[Trajectory]) -> None:
    """Runs a test, for a while at most.

    The run is on a thread of its own where there is a limit. What hangs cannot be ended from outside: its thread goes
    on until it returns or the process ends, and what it answers then is dropped.

    Args:
        system: that is to run it.
        test: what to fly.
        seconds: after which it is given up; None: never.
        landed: gets what the system answered, also where Ctrl-C comes right behind the flight; nothing where it is
            given up.

    Raises:
        NoAnswer: it did not answer in time, or still hangs from the time before.
        InvalidInput: no number of seconds above 0.
    """
    if seconds is None:
        _run(system, test, landed)
        return
    limit = number("Timeout (s)", seconds, above=0.0)
    before = _hanging.get(id(system))
    if before is not None and before.is_alive():
        raise NoAnswer(
            "The system has not come back from the test before, which it did not answer in time; correct it, and take"
            " a new process."
        )
    answer: list[Trajectory] = []
    failure: list[BaseException] = []

    def work() -> None:
        try:
            _run(system, test, answer)
        except BaseException as reason:
            failure.append(reason)

    thread = threading.Thread(target=work, name=f"test {test.number}", daemon=True)
    thread.start()
    end = time.monotonic() + limit
    try:
        while thread.is_alive() and time.monotonic() < end:
            thread.join(min(LOOK, limit))
        if not thread.is_alive():
            landed.extend(answer)
            answer.clear()
    except BaseException:
        landed.extend(answer)
        raise
    if thread.is_alive():
        _hanging[id(system)] = thread
        raise NoAnswer(f"The system did not answer test {test.number} within {limit:g} s; check it.")
    if failure:
        raise failure[0]


def _run(system: System, test: Test, landed: list[Trajectory]) -> None:
    """One run, in a single step for all that Python does between two signals: what has returned is in the list."""
    landed.extend(map(system.run, [test]))
