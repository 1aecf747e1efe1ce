"""What flown gains are worth alone: a measured quality without what the excitation of its flight has done to it.

An excitation costs some flights and helps others, so that a measured quality says less of the gains than of both. The
twin flies the same test with and without it, and the ratio of the two is taken out of what was measured.
"""

from __future__ import annotations

import math

import numpy as np

from twinloop.campaign import standing
from twinloop.campaign.logbook import Logbook
from twinloop.planning.judging import Committee
from twinloop.planning.planner import Planner
from twinloop.test import Test

BEST = 8
"""Flown tests that are looked at, those of the best measured quality first."""


def best_alone(planner: Planner, committee: Committee, book: Logbook, draws: int) -> Test | None:
    """The flown test whose gains are worth the most without its excitation.

    Args:
        planner: of the campaign.
        committee: that judges.
        book: of the campaign.
        draws: of the sensors' noise.

    Returns:
        That of the best measured quality where the committee is not trusted, or no flown test of the campaign's own
        task is known to fly; None if no test was flown.
    """
    best = standing.best_flown(book)
    known = {
        run.test.number: run.test
        for run in book.experiments
        if run.test is not None and standing.flies(book, run.test.number) and standing.on_task(book, run.test)
    }
    if best is None or best.number not in known or not committee.trusted:
        return best
    measured = {number: standing.measured(book, number) for number in known}
    first = sorted((quality, number) for number, quality in measured.items() if quality is not None)[:BEST]
    worth = {
        number: quality * share_of(planner, committee, known[number], draws) for quality, number in first
    }
    return known[min(worth, key=lambda number: (worth[number], number))]


def share_of(planner: Planner, committee: Committee, test: Test, draws: int) -> float:
    """Quality of a test without its excitation, over that with it, as the committee measures both on the same noise.

    Args:
        planner: of the campaign.
        committee: that judges.
        test: of the campaign's own task.
        draws: of the sensors' noise.

    Returns:
        1 where there is no excitation, where the option `alone` is off, or where either quality is infinite or nothing.
    """
    if test.excitation is None or not planner.options.alone:
        return 1.0
    genes, excitation = test.genes[np.newaxis], test.excitation[np.newaxis]
    members = planner.stable_members(committee.members, genes, excitation)
    alone = planner.judge(members, genes, committee.sds, draws, measured=True)
    excited = planner.judge(
        members, genes, committee.sds, draws, excitation, measured=True, hold_back=test.hold_back
    )
    without, within = float(alone.mean[0]), float(excited.mean[0])
    usable = math.isfinite(without) and math.isfinite(within) and min(without, within) > 0.0
    return without / within if usable else 1.0
