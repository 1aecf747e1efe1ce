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


def run_within(system: System, test: Test, seconds: float | None) -> Trajectory:
    """Runs a test, for a while at most.

    The run is on a thread of its own where there is a limit. What hangs cannot be ended from outside: its thread goes
    on until it returns or the process ends, and what it answers then is dropped.

    Args:
        system: that is to run it.
        test: what to fly.
        seconds: after which it is given up; None: never.

    Returns:
        What the system answered.

    Raises:
        NoAnswer: it did not answer in time, or still hangs from the time before.
        InvalidInput: no number of seconds above 0.
    """
    if seconds is None:
        return system.run(test)
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
            answer.append(system.run(test))
        except BaseException as reason:
            failure.append(reason)

    thread = threading.Thread(target=work, name=f"test {test.number}", daemon=True)
    thread.start()
    end = time.monotonic() + limit
    while thread.is_alive() and time.monotonic() < end:
        thread.join(min(LOOK, limit))
    if thread.is_alive():
        _hanging[id(system)] = thread
        raise NoAnswer(f"The system did not answer test {test.number} within {limit:g} s; check it.")
    if failure:
        raise failure[0]
    return answer[0]
