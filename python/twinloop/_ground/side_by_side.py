"""Side by side: pieces of work that share nothing on several threads, for the engine leaves the interpreter to others.

How many threads there are shows in nothing but the time: what comes out stands in the order of what was asked for.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Asked = TypeVar("Asked")
Found = TypeVar("Found")
_within = threading.local()


def side_by_side(work: Callable[[Asked], Found], several: Iterable[Asked], threads: int) -> list[Found]:
    """What some work makes of each of several things, in their order.

    Args:
        work: that changes nothing which another piece of it reads.
        several: what it is done with.
        threads: at most. Work within such work is done on its own thread alone.

    Raises:
        Whatever the work raises, of the first one that does; what has not begun by then is left.
    """
    every = list(several)
    if threads < 2 or len(every) < 2 or getattr(_within, "one", False):
        return [work(each) for each in every]
    pool = ThreadPoolExecutor(min(threads, len(every)), initializer=_enter)
    try:
        begun = [pool.submit(work, each) for each in every]
        return [one.result() for one in begun]
    finally:
        pool.shutdown(cancel_futures=True)


def _enter() -> None:
    _within.one = True
