"""Disproved: flights that came out clearly worse than the best one, which the twin still takes for as good."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign import standing
from twinloop.campaign.logbook import Logbook
from twinloop.planning.judging import Committee, expected
from twinloop.planning.planner import Planner
from twinloop.test import Test

CLEARLY = 2.0
"""Standard deviations by which a flight is worse than the committee makes it."""


def disproved(planner: Planner, committee: Committee, book: Logbook, good: float) -> list[Floats]:
    """Genes of flights that were proposed for what the twin promised, and disproved it.

    What they have cost is no luck of noise or of known disturbances, and the twin that has learnt them does not explain
    it.

    Args:
        planner: of the campaign.
        committee: that judges.
        book: of the campaign.
        good: quality of the best flight; infinite where none has kept the envelope.
    """
    most = (1.0 + planner.options.worse) * good
    found = []
    for number in sorted(book.flown):
        test, quality = book.tests[number], standing.measured(book, number)
        # What nobody has predicted disproves nothing.
        if (
            test.predicted is None
            or quality is None
            or not quality > most
            or not standing.on_task(book, test)
        ):
            continue
        predicted, spread = _expected(planner, committee, test)
        if predicted <= most and quality > predicted + CLEARLY * spread:
            found.append(test.genes)
    return found


def _expected(planner: Planner, committee: Committee, test: Test) -> tuple[float, float]:
    """Quality that the committee of now expects of a flight that was flown, and its standard deviation."""
    excitation = None if test.excitation is None else test.excitation[np.newaxis]
    # One that diverges in a flight that went to its end says nothing of how good it was.
    members = planner.stable_members(committee.members, test.genes[np.newaxis], excitation)
    judged = planner.judge(
        members, test.genes[np.newaxis], committee.sds, planner.options.draws, excitation,
        measured=True, hold_back=test.hold_back,
    )  # fmt: skip
    return committee.moved_by_gusts(test).added_to(*expected(judged.qualities[:, :, 0]))
