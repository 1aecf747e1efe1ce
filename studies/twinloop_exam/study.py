"""Works the jobs off, in this process or in several; what is measured is kept at once."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from twinloop.campaign import available_threads
from twinloop.errors import RemarkWarning, TwinloopError
from twinloop.law.twin import Twin
from twinloop.sweep.progress import JobBar
from twinloop.sweep.workers import HERE, finished
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
    with JobBar("exam", len(jobs), LINE_SECONDS) as bar:
        for stage in (False, True):
            ready = [job for job in jobs if isinstance(job.who, Fitter) is stage]
            for job, failure in _finished(path, ready, processes):
                failed += failure is not None
                address = job.address
                bar.advance(f"{address.learner} on {address.system}, seed {address.seed}", failure)
    return failed


def _finished(path: Path, jobs: Sequence[Job], processes: int) -> Iterator[tuple[Job, str | None]]:
    alone = processes == 1 or len(jobs) < 2
    threads = available_threads() if alone else max(1, available_threads() // processes)
    done = finished(partial(_worked, path, threads), jobs, HERE if alone else f"local:{processes}")
    for job, answer in done:
        yield job, str(answer) if isinstance(answer, BaseException) else answer


def _worked(path: Path, threads: int, job: Job) -> str | None:
    with warnings.catch_warnings():
        # What is remarked of twins by the hundred is no news here.
        warnings.simplefilter("ignore", RemarkWarning)
        return work(path, job, threads)


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
