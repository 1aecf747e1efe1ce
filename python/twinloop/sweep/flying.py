"""One campaign of a sweep, from its description to its plain record, on whatever machine it runs."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from typing import Any

from twinloop.campaign import Campaign, controller_to_fly
from twinloop.errors import RemarkWarning, TwinloopError
from twinloop.records import Record
from twinloop.sweep.jobs import Job, system_of
from twinloop.systems import BUILT_IN


@dataclass(frozen=True)
class Flown:
    """What became of a job.

    Args:
        record: of the campaign; None if it failed.
        failure: why it did; None if it did not.
        seconds: that it took.
        runs: of the system when it was over, which the noise of its next run depends on; None where it counts none.
    """

    record: Record | None
    failure: str | None
    seconds: float
    runs: int | None = None


def fly(job: Job, threads: int | None = None) -> Flown:
    """Makes a campaign, flies it to its end and learns its last flight.

    It depends on nothing but the job, so that it may be repeated after its worker died, with the same bits.

    Args:
        job: to be done.
        threads: of the engine, by default all that there are; no result depends on it.
    """
    clock = time.monotonic()
    with warnings.catch_warnings():
        # What is remarked of twins by the hundred stands in each campaign.
        warnings.simplefilter("ignore", RemarkWarning)
        try:
            campaign = begun(job, system_of(job.system, job.seed), threads)
            system = system_of(job.system, job.seed)
            campaign.run(system, job.experiments)
            controller_to_fly(campaign)
        except Exception as failure:  # a system by others may raise anything: the other campaigns go on
            return Flown(None, reason(failure), time.monotonic() - clock)
    return Flown(campaign.to_record(), None, time.monotonic() - clock, getattr(system, "runs", None))


def landed(job: Job, record: Record, runs: int | None) -> Campaign:
    """The campaign that a worker flew. One of a built-in system knows it, as if it had been flown here.

    Args:
        job: that was done.
        record: of the campaign.
        runs: of the system when it was over.
    """
    campaign = Campaign.from_record(record, threads=1, progress=None)
    if job.system.partition(":")[0] in BUILT_IN:
        system = system_of(job.system, job.seed)
        system.runs = runs
        campaign.run(system, job.experiments)  # all of them are flown: it takes the system up, and no more
    return campaign


def reason(failure: BaseException) -> str:
    """Why a job failed, as it is reported; the same on any cluster.

    Args:
        failure: what was raised. Messages of Twinloop are sentences; others need the name of their kind.
    """
    if isinstance(failure, TwinloopError):
        return str(failure)
    return f"{type(failure).__name__}: {failure}".removesuffix(": ")


def begun(job: Job, system: Any, threads: int | None = None) -> Campaign:
    """The campaign of a job, before its first experiment.

    Args:
        job: to be done.
        system: that it flies.
        threads: of the engine.
    """
    return Campaign(
        system.signals,
        controller=system.controller,
        initial_state=system.initial_state,
        target_state=system.target_state,
        duration=system.duration,
        preset=job.preset,
        seed=job.seed,
        options=job.values(),
        threads=threads,
        progress=None,  # the sweep shows its own
    )
