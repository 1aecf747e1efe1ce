"""Works the jobs off where a sweep's are, here or on a cluster; what is measured is kept at once."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from twinloop.errors import RemarkWarning, TwinloopError
from twinloop.law.twin import Twin
from twinloop.sweep.progress import JobBar
from twinloop.sweep.workers import HERE, finished, threads_on
from twinloop.trajectory import Trajectory
from twinloop_exam import campaigns, held_out
from twinloop_exam.campaigns import Measured
from twinloop_exam.kinds import Campaigner, Fitter, Flyer, Optimum, Tuner
from twinloop_exam.plan import Job
from twinloop_exam.store import MissingFlights, Row, Store
from twinloop_exam.systems import Subject, subject

if TYPE_CHECKING:
    from distributed import Client

Rows = Iterable[tuple[Row, Trajectory | None]]
"""What was measured, with the flight."""
LINE_SECONDS = 30.0
"""Between two plain lines, where there is no terminal."""


@dataclass(frozen=True)
class Task:
    """A job with all that it needs of the store: whoever does it sees no file.

    Args:
        job: to be done.
        judge: true runs under the held-out controllers, packed; None where no twin is judged.
        flights: that fits are made on, from Υ0 on.
        threads: of the engine; None: all that there are.
    """

    job: Job
    judge: bytes | None
    flights: tuple[Trajectory, ...]
    threads: int | None


def work_off(path: Path, jobs: Sequence[Job], cluster: str | Client = HERE) -> int:
    """Does the jobs; fits wait until those who fly are done.

    Args:
        path: of the store.
        jobs: to be done.
        cluster: where, as `twinloop.sweep.workers.finished` takes it.

    Returns:
        How many of them failed.

    Raises:
        KeyboardInterrupt: Ctrl-C; what was measured is kept.
    """
    failed, threads = 0, threads_on(cluster)
    store = Store(path)
    try:
        with JobBar("exam", len(jobs), LINE_SECONDS) as bar:
            for stage in (False, True):
                tasks: list[Task] = []
                for job in (job for job in jobs if isinstance(job.who, Fitter) is stage):
                    try:
                        tasks.append(task_of(job, store, threads))
                    except MissingFlights as lacking:  # no failure of this learner's
                        bar.advance(_name(job), str(lacking))
                        failed += 1
                for task, rows in _done(tasks, cluster):
                    failure = _kept(rows, store)
                    failed += failure is not None
                    bar.advance(_name(task.job), failure)
    finally:
        store.close()
    return failed


def work(path: Path, job: Job, threads: int | None = 1) -> str | None:
    """Does one job here and keeps each row as soon as it is measured.

    Args:
        path: of the store.
        job: to be done.
        threads: of the engine; None: all that there are.

    Returns:
        Why it failed; None if it did not.
    """
    store = Store(path)
    try:
        return _kept(measured(task_of(job, store, threads)), store)
    except MissingFlights as lacking:  # it is measured once they are flown
        return str(lacking)
    finally:
        store.close()


def task_of(job: Job, store: Store, threads: int | None) -> Task:
    """A job with what it needs of the store.

    Args:
        job: to be done.
        store: with what was measured before.
        threads: of the engine; None: all that there are.

    Raises:
        MissingFlights: those that a fit needs were not flown.
    """
    judged = isinstance(job.who, Campaigner | Fitter)
    judge = store.held_out(subject(job.address.system)).packed() if judged else None
    flights = () if job.flights is None else tuple(store.flights(job.flights, max(job.ks)))
    return Task(job, judge, flights, threads)


def measured(task: Task) -> Iterator[tuple[Row, Trajectory | None]]:
    """What is measured of a job, row by row; a failure is a row of each number that is missing then.

    Args:
        task: to be done.
    """
    job, missing = task.job, list(task.job.ks)
    try:
        with warnings.catch_warnings():
            # What is remarked of twins by the hundred is no news here.
            warnings.simplefilter("ignore", RemarkWarning)
            for k, measures, flight, seconds in _measured(task):
                if k in missing:
                    missing.remove(k)
                    yield Row(job.address, k, measures, seconds), flight
    except Exception as failure:  # whatever a learner by others raises is a result: it is counted
        reason = (
            str(failure) if isinstance(failure, TwinloopError) else f"{type(failure).__name__}: {failure}"
        )
        for k in missing:
            yield Row(job.address, k, {}, 0.0, reason), None


def _all_measured(task: Task) -> list[tuple[Row, Trajectory | None]]:
    return list(measured(task))


def _done(tasks: Sequence[Task], cluster: str | Client) -> Iterator[tuple[Task, Rows | BaseException]]:
    """Here row by row as they are measured; from elsewhere a job at a time."""
    if cluster == HERE:
        for task in tasks:
            yield task, measured(task)
    else:
        yield from finished(_all_measured, tasks, cluster)


def _kept(rows: Rows | BaseException, store: Store) -> str | None:
    """Why there was a failure, once all rows are in the store."""
    if isinstance(rows, BaseException):
        return f"{type(rows).__name__}: {rows}"
    failure = None
    for row, flight in rows:
        store.write(row, flight)
        failure = row.failure if failure is None else failure
    return failure


def _name(job: Job) -> str:
    return f"{job.address.learner} on {job.address.system}, seed {job.address.seed}"


def _measured(task: Task) -> Iterator[Measured]:
    job, judged = task.job, subject(task.job.address.system)
    seed = job.address.seed
    match job.who:
        case Campaigner():
            assert task.judge is not None
            judge = held_out.unpacked(judged, task.judge)
            yield from campaigns.campaign(job.who, judged, judge, seed, job.last, task.threads)
        case Flyer():
            yield from campaigns.random_gains(judged, seed, job.last)
        case Fitter():
            yield from _fits(task, job.who, judged)
        case Tuner() | Optimum():
            from twinloop_exam import tuners

            if isinstance(job.who, Optimum):
                yield from tuners.optimum(job.who, judged)
            else:
                yield from tuners.tune(job.who, judged, seed, job.who.flights)


def _fits(task: Task, who: Fitter, judged: Subject) -> Iterator[Measured]:
    assert task.judge is not None
    judge = held_out.unpacked(judged, task.judge)
    for k in task.job.ks:
        clock, started = time.monotonic(), time.process_time()
        model = who.fit(list(task.flights[: k + 1]), judged.signals, task.job.address.seed)
        seconds = time.process_time() - started
        measures = campaigns.of_twin(Twin(model, judged.signals), judge)
        yield k, {**measures, "learn_seconds": seconds}, None, time.monotonic() - clock
