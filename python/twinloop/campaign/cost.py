"""What a campaign has cost on the system: runs, time in the air, envelope, and quality given away to learn."""

from __future__ import annotations

import math
from dataclasses import dataclass

from twinloop.campaign import standing
from twinloop.campaign.logbook import Logbook


@dataclass(frozen=True)
class Cost:
    """What was spent on the system.

    Args:
        runs: of tests on the system, those that failed too.
        cut: of these, that ended early with a record.
        failed: of these, that failed on the system.
        attached: runs that nobody asked for, which are no runs of tests.
        abandoned: tests that were asked for and not flown.
        seconds: of flight that were recorded, those of attached runs too, s.
        left: recorded runs that left the envelope, as far as their readings tell.
        usage: the most that any used of the envelope, 1 at a bound; 0 where none is declared.
        best: the best quality of a complete run of the campaign's own task; None where there was none.
        given_away: by how much all other complete runs of it were worse than that, together, in the same unit.
    """

    runs: int
    cut: int
    failed: int
    attached: int
    abandoned: int
    seconds: float
    left: int
    usage: float
    best: float | None
    given_away: float | None


def cost(book: Logbook) -> Cost:
    """What a campaign has cost so far.

    Args:
        book: of the campaign.
    """
    asked = [run for run in book.experiments if run.test is not None]
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
        abandoned=len(set(book.abandoned) - book.flown),
        seconds=math.fsum(float(run.trajectory.t[-1] - run.trajectory.t[0]) for run in book.experiments),
        left=sum(run.left_envelope for run in book.experiments),
        usage=max((run.usage for run in book.experiments), default=0.0),
        best=best,
        given_away=None if best is None else math.fsum(quality - best for quality in qualities),
    )
