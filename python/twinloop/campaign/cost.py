"""The cost of a campaign on the system: runs, flight time, envelope, and loss of quality while learning."""

from __future__ import annotations

import math
from dataclasses import dataclass

from twinloop.campaign import standing
from twinloop.campaign.history import Experiment
from twinloop.campaign.logbook import Logbook


@dataclass(frozen=True)
class Cost:
    """The cost of a campaign on the system.

    Args:
        runs: runs of tests on the system, including failures, and withdrawn flights whose tests were not told anew.
        cut: those of them that ended early with a record.
        failed: those of them that failed.
        attached: runs without a test.
        abandoned: tests from `ask` that were not flown.
        seconds: recorded flight time, attached runs included, s; of withdrawn flights as for `runs`.
        left_envelope: recorded runs that left the envelope, as far as their readings show.
        usage: the largest usage of the envelope, 1 at a bound; 0 if no envelope is declared.
        best: the best quality of a complete run of the campaign's own task; None if there is none.
        given_away: sum of the differences of all other complete runs of this task to `best`, in the same unit.
        withdrawn: flights that were withdrawn.
    """

    runs: int
    cut: int
    failed: int
    attached: int
    abandoned: int
    seconds: float
    left_envelope: int
    usage: float
    best: float | None
    given_away: float | None
    withdrawn: int = 0


def cost(book: Logbook) -> Cost:
    """What a campaign has cost so far.

    Args:
        book: of the campaign.
    """
    asked = [run for run in book.experiments if run.number is not None]
    recorded_failures = sum(failure.recorded for failure in book.failures)
    qualities = [
        run.quality
        for run in asked
        if run.test is not None and run.quality is not None and standing.on_task(book, run.test)
    ]
    best = min(qualities, default=None)
    return Cost(
        runs=book.runs,
        cut=sum(not run.complete for run in asked) - recorded_failures,
        failed=len(book.failures),
        attached=len(book.experiments) - len(asked),
        abandoned=len(set(book.abandoned) - book.flown - book.only_withdrawn),
        seconds=math.fsum(_seconds(run) for run in [*book.experiments, *_withdrawn(book)]),
        left_envelope=sum(run.left_envelope for run in book.experiments),
        usage=max((run.usage for run in book.experiments), default=0.0),
        best=best,
        given_away=None if best is None else math.fsum(quality - best for quality in qualities),
        withdrawn=len(book.withdrawals),
    )


def _seconds(run: Experiment) -> float:
    return float(run.trajectory.t[-1] - run.trajectory.t[0])


def _withdrawn(book: Logbook) -> list[Experiment]:
    """The last run that was withdrawn of each test of which nothing else was told: one flight each."""
    flights = {
        each.test: book.recorded[each.run]
        for each in book.withdrawals
        if each.run is not None and each.test in book.only_withdrawn
    }
    return list(flights.values())
