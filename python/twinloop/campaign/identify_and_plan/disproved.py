"""Disproved: flights that came out clearly worse than the best one, which the twin still takes for as good."""

from __future__ import annotations

import math
from collections.abc import Sequence

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
        runs = standing.complete(book, number)
        quality = standing.measured(book, number)
        # What nobody has predicted, of the flight as it was flown, disproves nothing.
        flown = [run.test for run in runs if run.test is not None]
        if quality is None or not quality > most or any(test.predicted is None for test in flown):
            continue
        if not all(standing.on_task(book, test) for test in flown):
            continue
        predicted, spread = _expected(planner, committee, flown)
        if predicted <= most and quality > predicted + CLEARLY * spread:
            found.append(flown[0].genes)
    return found


def _expected(planner: Planner, committee: Committee, flown: Sequence[Test]) -> tuple[float, float]:
    """Mean quality that the committee of now expects of flights as they were flown, and its standard deviation."""
    each = [_expected_of(planner, committee, test) for test in flown]
    return (
        math.fsum(mean for mean, _ in each) / len(each),
        math.fsum(spread for _, spread in each) / len(each),
    )


def _expected_of(planner: Planner, committee: Committee, test: Test) -> tuple[float, float]:
    _, judged = planner.as_flown(committee.members, test, committee.sds, planner.options.draws)
    return committee.moved_by_gusts(test).added_to(*expected(judged.qualities[:, :, 0]))
