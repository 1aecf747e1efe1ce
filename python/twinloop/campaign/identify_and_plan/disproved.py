"""Disproved: flights that came out worse than the best one, or left, and that the twin does not explain even now."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from twinloop._experiment.envelope import outside
from twinloop._ground.arrays import Floats
from twinloop.campaign import standing
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.track_record import nearly_confirmed_in_a_row
from twinloop.campaign.logbook import Logbook
from twinloop.planning.judging import Committee, expected
from twinloop.planning.planner import Planner
from twinloop.test import Test

CLEARLY = 2.0
"""Standard deviations by which a flight is worse than the committee makes it."""


def disproved(planner: Planner, committee: Committee, book: Logbook, good: float) -> list[Floats]:
    """Genes of flights that were proposed for what the twin promised, and disproved it.

    Args:
        planner: of the campaign.
        committee: that judges.
        book: of the campaign.
        good: quality of the best flight; infinite where none has kept the envelope.
    """
    return [*_worse(planner, committee, book, good), *_left(planner, committee, book)]


def _worse(planner: Planner, committee: Committee, book: Logbook, good: float) -> list[Floats]:
    """Genes of flights that were clearly worse than the best one, and that the committee still takes for as good.

    What they have cost is no luck of noise or of known disturbances, and the twin that has learnt them does not explain
    it.
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


def _left(planner: Planner, committee: Committee, book: Logbook) -> list[Floats]:
    """Genes of flights that were to keep the envelope, and left it or diverged.

    A twin that has learnt why foresees it; but what it says of gains as bold is not believed before a flight of new
    ones has come out as predicted.
    """
    proven = nearly_confirmed_in_a_row(book.experiments) > 0
    left = [run.test for run in book.experiments if run.test is not None and _left_against_promise(run)]
    return [
        test.genes
        for test in left
        if standing.on_task(book, test) and not (proven and _foresees(planner, committee, test))
    ]


def _left_against_promise(run: Experiment) -> bool:
    """Whether a flight left or diverged that was predicted to come to its end, and began where that was predicted."""
    predicted = None if run.test is None else run.test.predicted
    promised = predicted is not None and math.isfinite(predicted) and not run.off_start
    return promised and standing.was_lost(run)


def _foresees(planner: Planner, committee: Committee, test: Test) -> bool:
    """Whether a committee sees the flight of a test leave its envelope more often than not."""
    excitation = None if test.excitation is None else test.excitation[np.newaxis]
    judged = planner.judge(
        committee.members, test.genes[np.newaxis], committee.sds, planner.options.draws, excitation,
        hold_back=test.hold_back,
    )  # fmt: skip
    return bool(2 * outside(judged.usages).sum() > judged.usages.size)


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
