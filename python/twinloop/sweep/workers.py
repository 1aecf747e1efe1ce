"""Where jobs are done: in this process, in several on this machine, or on a cluster of Dask."""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any, TypeVar

from twinloop.campaign import available_threads
from twinloop.errors import InvalidInput, NotAvailable

if TYPE_CHECKING:
    from distributed import Client

Task = TypeVar("Task")
Answer = TypeVar("Answer")
HERE = "here"
"""The cluster that is this process."""
CONNECT_SECONDS = 20.0
MOST_PROCESSES = 1024
LOST = 3
"""Workers that may die under a task before it counts as failed."""


def finished(
    work: Callable[[Task], Answer], tasks: Sequence[Task], cluster: str | Client = HERE
) -> Iterator[tuple[Task, Answer | BaseException]]:
    """Does tasks side by side; one whose worker dies is done again by another.

    Args:
        work: a function of a task that can be imported where it is done.
        tasks: plain values.
        cluster: "here", "local:4" for four processes on this machine, the address of a Dask scheduler such as
            "tcp://10.0.0.1:8786", or a `distributed.Client`.

    Yields:
        Each task with its answer, as it is finished, or with what it raised.

    Raises:
        InvalidInput: no such cluster, or nothing answers there.
        NotAvailable: the package of the extra `cluster` is missing.
    """
    if cluster == HERE:
        for task in tasks:
            yield task, _answer(work, task)
        return
    with _client(cluster) as client:
        from distributed import as_completed

        futures = {client.submit(work, task, pure=False, retries=0): task for task in tasks}
        try:
            for future in as_completed(list(futures)):
                failure = future.exception()
                task = futures.pop(future)
                yield task, future.result() if failure is None else failure
                future.release()
        finally:
            client.cancel(list(futures), force=True)


def _answer(work: Callable[[Task], Answer], task: Task) -> Answer | Exception:
    """What a worker of a cluster gives back: also there one task that fails does not end the others."""
    try:
        return work(task)
    except Exception as failure:
        return failure


def processes(cluster: object) -> int | None:
    """How many processes "local:N" means; None for another cluster.

    Args:
        cluster: as `finished` takes it.

    Raises:
        InvalidInput: N is no number from 1 on.
    """
    if not isinstance(cluster, str) or not cluster.startswith("local"):
        return None
    _, _, count = cluster.partition(":")
    if not count.isdecimal() or not 0 < int(count) <= MOST_PROCESSES:
        raise InvalidInput(
            f"Cluster: expected local:N with 1 to {MOST_PROCESSES} processes, found {cluster!r}; such as local:4."
        )
    return int(count)


def threads_on(cluster: object) -> int | None:
    """Threads of the engine that a task may use there; None: all that there are.

    Args:
        cluster: as `finished` takes it.

    Raises:
        InvalidInput: "local:N" whose N is no number from 1 on.
    """
    if cluster == HERE:
        return None
    count = processes(cluster)
    return max(1, available_threads() // count) if count else 1


@contextmanager
def _client(cluster: Any) -> Iterator[Client]:
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise NotAvailable(
            f"Cluster {cluster!r}: expected the package `distributed`, found none; pip install 'twinloop[cluster]',"
            " or do the work here."
        ) from None
    if isinstance(cluster, Client):
        yield cluster
        return
    count = processes(cluster)
    with dask.config.set({"distributed.scheduler.allowed-failures": LOST}):
        if count is not None:
            with _deaf_to_ctrl_c():
                local = LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    # Dask's own page on any free port: of its usual one a second sweep is warned on standard error.
                    dashboard_address="127.0.0.1:0",
                    memory_limit=None,
                    silence_logs=logging.CRITICAL,
                )
            with local, Client(local) as client:
                yield client
            return
        try:
            client = Client(cluster, timeout=CONNECT_SECONDS)
        except (OSError, ValueError, TimeoutError) as failure:
            raise InvalidInput(
                f"Cluster {cluster!r}: expected here, local:N or the address of a Dask scheduler, such as"
                f" tcp://10.0.0.1:8786, found: {failure}; start one with `dask scheduler` and `dask worker`."
            ) from failure
        with client:
            yield client


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """Processes that are begun meanwhile, and theirs in turn, never see Ctrl-C, which a terminal sends to all.

    This process alone is interrupted, and ends them. It sees a Ctrl-C of meanwhile afterwards.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    # It unblocks SIGINT where it is started, and so has to be there before.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
