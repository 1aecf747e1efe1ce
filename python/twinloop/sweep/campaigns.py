"""The sweep itself: what the store lacks is flown, and kept as soon as it is there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from twinloop.campaign import Campaign
from twinloop.campaign.keeping import check_setup
from twinloop.errors import InvalidInput
from twinloop.store import listed, opened, shown_name
from twinloop.sweep.flying import Flown, begun, fly, landed, reason
from twinloop.sweep.jobs import Job, system_of
from twinloop.sweep.workers import HERE, finished, threads_on

if TYPE_CHECKING:
    from distributed import Client


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of one job.

    Args:
        job: that was done.
        campaign: that was flown; None if it failed.
        failure: why; None if it did not.
        seconds: that it took; None where it had been kept before.
    """

    job: Job
    campaign: Campaign | None
    failure: str | None
    seconds: float | None


def sweep(jobs: Sequence[Job], store: str | Path, cluster: str | Client = HERE) -> Iterator[Outcome]:
    """Flies all campaigns of a sweep that its store does not hold yet.

    What is finished is kept at once, under the name of its job; a sweep that was interrupted goes on from there. The
    same jobs give the same campaigns to the bit, on any cluster, whatever died meanwhile.

    Args:
        jobs: such as `crossed` gives.
        store: a file of SQLite, or the address of a database.
        cluster: where the work is done, as `twinloop.sweep.workers.finished` takes it.

    Yields:
        The outcomes of what is kept already, in the order of the jobs, then the others as they are finished.

    Raises:
        InvalidInput: the store holds a campaign of another setup under the name of a job, or no such cluster.
        NotAvailable: the packages of the extra `store` or `cluster` are missing.
        StoreFailure: the store cannot be written.
    """
    threads = threads_on(cluster)
    done = _finished(store)
    todo = []
    for job in jobs:
        if job.name not in done:
            todo.append(job)
            continue
        try:
            asked = begun(job, system_of(job.system, job.seed), threads=1)
        except Exception as failure:  # as of a campaign that is flown
            yield Outcome(job, None, reason(failure), 0.0)
        else:
            yield Outcome(job, _stored(job, asked, store), None, None)
    for job, flown in finished(partial(fly, threads=threads), todo, cluster):
        if not isinstance(flown, Flown):
            yield Outcome(job, None, reason(flown), 0.0)
        elif flown.record is None:
            yield Outcome(job, None, flown.failure, flown.seconds)
        else:
            campaign = landed(job, flown.record, flown.runs)
            campaign.save(store, job.name)
            yield Outcome(job, campaign, None, flown.seconds)


def _finished(store: str | Path) -> set[str]:
    base = opened(store, create=True)
    try:
        return {row["name"] for row in listed(base)}
    finally:
        base.close()


def _stored(job: Job, asked: Campaign, store: str | Path) -> Campaign:
    """The campaign that the store holds, if it is finished; one that is not makes room for nothing and is refused."""
    campaign = Campaign.load(store, job.name, read_only=True, threads=1, progress=None)
    where = f"Sweep, store {shown_name(store)}"
    check_setup(campaign.setup, asked.setup, f"{where}: expected the campaign {job.name!r} of this sweep")
    if campaign.runs != job.experiments:
        raise InvalidInput(
            f"{where}: expected the campaign {job.name!r} with {job.experiments} experiments, found"
            f" {campaign.runs}; choose another store."
        )
    return campaign
