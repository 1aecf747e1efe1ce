"""A run that must end in time: what hangs is stopped as far as it lets itself, and is not run again while it hangs."""

from __future__ import annotations

import ctypes
import threading
import time

from twinloop._ground.arrays import number
from twinloop.errors import NoAnswer
from twinloop.guard.guarded import Guarded
from twinloop.systems.base import System
from twinloop.systems.raised import came_through
from twinloop.test import Test
from twinloop.trajectory import Trajectory

LOOK = 0.2
"""Seconds between two moments at which Ctrl-C is heard."""
STOPPING = 5.0
"""Seconds that a system has to end a run that was interrupted or given up."""
_ends: dict[int, threading.Event] = {}
"""Of the last run of each system on a thread, by the identity of the system, which that thread keeps alive."""


def run_within(system: System, test: Test, seconds: float | None, landed: list[Trajectory]) -> None:
    """Runs a test, for a while at most.

    The run is on a thread of its own where there is a limit. Where it is given up or interrupted, the system's `stop()`
    is called; one without `stop` gets a KeyboardInterrupt in its thread, as if Ctrl-C had come there. A call that does
    not return cannot be ended from outside: its thread goes on until it returns or the process ends.

    Args:
        system: that is to run it.
        test: what to fly.
        seconds: after which it is given up; None: never.
        landed: gets what the system answered, also where Ctrl-C comes right behind the flight or the system answers
            while it is stopped by it; nothing where it is given up.

    Raises:
        NoAnswer: it did not answer in time, or still hangs from the time before.
        InvalidInput: no number of seconds above 0.
    """
    before = _ends.get(id(_itself(system)))
    if before is not None and not before.is_set():
        raise NoAnswer(
            "The system has not come back from the test before, which was interrupted or not answered in time; correct"
            " it, and take a new process."
        )
    if seconds is None:
        _run(system, test, landed)
        return
    limit = number("Timeout (s)", seconds, above=0.0)
    answer: list[Trajectory] = []
    failure: list[BaseException] = []
    # Not the thread itself: a `join` that Ctrl-C interrupts takes a thread that is alive for one that has ended.
    ended = _ends[id(_itself(system))] = threading.Event()

    def work() -> None:
        try:
            _run(system, test, answer)
        except BaseException as reason:
            failure.append(reason)
        finally:
            ended.set()

    thread = threading.Thread(target=work, name=f"test {test.number}", daemon=True)
    try:
        _start(thread, ended)
        if _within(limit, ended):
            landed.extend(answer)
    except BaseException as reason:
        _stop(system, thread, ended)
        landed.extend(answer[len(landed) :])
        raise reason from next(iter(failure), None)
    if not ended.is_set():
        _stop(system, thread, ended)
        late = NoAnswer(f"The system did not answer test {test.number} within {limit:g} s; check it.")
        raise late from next(iter(failure), None)
    if failure:
        raise failure[0]


def raised_in_a_run(reason: BaseException) -> bool:
    """Whether it was the system's own `run` that raised, or something it called.

    Args:
        reason: that came out of `run_within`.
    """
    return came_through(reason, _run.__code__)


def _run(system: System, test: Test, landed: list[Trajectory]) -> None:
    """One run, in a single step for all that Python does between two signals: what has returned is in the list."""
    landed.extend(map(system.run, [test]))


def _start(thread: threading.Thread, ended: threading.Event) -> None:
    try:
        thread.start()
    except RuntimeError:  # there is no room for another one
        ended.set()
        raise


def _within(seconds: float, ended: threading.Event) -> bool:
    """Waits for the end of a run, and says whether it came; Ctrl-C is heard meanwhile."""
    end = time.monotonic() + seconds
    while not ended.wait(min(LOOK, seconds)) and time.monotonic() < end:
        pass
    return ended.is_set()


def _stop(system: System, thread: threading.Thread, ended: threading.Event) -> None:
    """Has the system end its run, and waits a while for it; a second Ctrl-C waits no more."""
    if thread.ident is None:  # Ctrl-C came while it was started
        ended.wait(LOOK)
    if ended.is_set():
        return
    stop = getattr(_itself(system), "stop", None)
    try:
        if callable(stop):
            stop()
        else:
            # Python's only way into another thread; it is heard once the run is back in Python, so that `finally` runs.
            ctypes.pythonapi.PyThreadState_SetAsyncExc(
                ctypes.c_ulong(thread.ident or 0), ctypes.py_object(KeyboardInterrupt)
            )
    finally:
        _within(STOPPING, ended)


def _itself(system: System) -> System:
    """The system that a guard is around: another guard is no other rig."""
    while isinstance(system, Guarded):
        system = system.system
    return system
