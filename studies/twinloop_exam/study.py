"""Works the jobs off, in this process or in several; what is measured is kept at once."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from twinloop.campaign import available_threads
from twinloop.errors import RemarkWarning, TwinloopError
from twinloop.law.twin import Twin
from twinloop_exam import campaigns
from twinloop_exam.campaigns import Measured
from twinloop_exam.held_out import HeldOut
from twinloop_exam.kinds import Campaigner, Fitter, Flyer, Optimum, Tuner
from twinloop_exam.plan import Job
from twinloop_exam.store import MissingFlights, Row, Store
from twinloop_exam.systems import Subject, subject

LINE_SECONDS = 30.0
"""Between two plain lines, where there is no terminal."""


def work_off(path: Path, jobs: Sequence[Job], processes: int) -> int:
    """Does the jobs; fits wait until those who fly are done.

    Args:
        path: of the store.
        jobs: to be done.
        processes: how many at once.

    Returns:
        How many of them failed.

    Raises:
        KeyboardInterrupt: Ctrl-C; what was measured is kept.
    """
    failed = 0
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[last]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    done, spoke = 0, time.monotonic()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("exam", total=len(jobs), last="")
        for stage in (False, True):
            ready = [job for job in jobs if isinstance(job.who, Fitter) is stage]
            for job, failure in _finished(path, ready, processes):
                failed += failure is not None
                name = f"{job.address.learner} on {job.address.system}, seed {job.address.seed}"
                if failure is not None:
                    bar.console.print(f"Failed: {name}: {failure}", highlight=False, markup=False)
                done += 1
                bar.update(task, advance=1, last=name)
                if not console.is_terminal and time.monotonic() - spoke > LINE_SECONDS:
                    spoke = time.monotonic()
                    console.print(f"{done} of {len(jobs)} jobs: {name}", highlight=False, markup=False)
    return failed


def _finished(path: Path, jobs: Sequence[Job], processes: int) -> Iterator[tuple[Job, str | None]]:
    if processes == 1 or len(jobs) < 2:
        for job in jobs:
            yield job, work(path, job, available_threads())
        return
    # Several processes that each use all cores for their linear algebra only wait for each other.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context, initializer=_as_a_worker) as pool:
        try:
            threads = max(1, available_threads() // processes)
            futures = {pool.submit(work, path, job, threads): job for job in jobs}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _as_a_worker() -> None:
    """Ctrl-C ends a worker without a word: what it measured is kept, and the main process speaks.

    Nor does a worker outlive the main process, however that ends: it would go on writing into the store.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    warnings.simplefilter("ignore", RemarkWarning)  # what is remarked of twins by the hundred is no news here
    threading.Thread(target=_end_with_the_main_process, daemon=True).start()


def _end_with_the_main_process() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def work(path: Path, job: Job, threads: int = 1) -> str | None:
    """Does one job and keeps each row as soon as it is measured.

    Args:
        path: of the store.
        job: to be done.
        threads: of the engine.

    Returns:
        Why it failed; None if it did not.
    """
    store = Store(path)
    missing = list(job.ks)
    try:
        judged = subject(job.address.system)
        for k, measures, flight, seconds in _measured(job, judged, store, threads):
            if k in missing:
                store.write(Row(job.address, k, measures, seconds), flight)
                missing.remove(k)
    except MissingFlights as lacking:  # not this learner's failure: it is measured once they are flown
        return str(lacking)
    except Exception as failure:  # whatever a learner by others raises is a result: it is counted
        reason = (
            str(failure) if isinstance(failure, TwinloopError) else f"{type(failure).__name__}: {failure}"
        )
        for k in missing:
            store.write(Row(job.address, k, {}, 0.0, reason))
        return reason
    finally:
        store.close()
    return None


def _measured(job: Job, judged: Subject, store: Store, threads: int) -> Iterator[Measured]:
    seed = job.address.seed
    match job.who:
        case Campaigner():
            judge = _held_out(store, judged)
            yield from campaigns.campaign(job.who, judged, judge, seed, job.last, threads)
        case Flyer():
            yield from campaigns.random_gains(judged, seed, job.last)
        case Fitter():
            yield from _fits(job, judged, store)
        case Tuner() | Optimum():
            from twinloop_exam import tuners

            if isinstance(job.who, Optimum):
                yield from tuners.optimum(job.who, judged)
            else:
                yield from tuners.tune(job.who, judged, seed, job.who.flights)


def _fits(job: Job, judged: Subject, store: Store) -> Iterator[Measured]:
    assert isinstance(job.who, Fitter) and job.flights is not None
    for k in job.ks:
        flights = store.flights(job.flights, k)
        clock = time.monotonic()
        model = job.who.fit(flights, judged.signals, job.address.seed)
        seconds = time.monotonic() - clock
        twin = Twin(model, judged.signals)
        measures = campaigns.of_twin(twin, _held_out(store, judged))
        yield k, {**measures, "learn_seconds": seconds}, None, time.monotonic() - clock


def _held_out(store: Store, judged: Subject) -> HeldOut:
    """Read once a process: it is the same for all jobs on a system."""
    if (store.path, judged.name) not in _KEPT:
        _KEPT[store.path, judged.name] = store.held_out(judged)
    return _KEPT[store.path, judged.name]


_KEPT: dict[tuple[Path, str], HeldOut] = {}
