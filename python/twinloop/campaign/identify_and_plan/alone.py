"""What flown gains are worth alone: a measured quality without what excitation and luck have done to it.

An excitation costs some flights and helps others, so that a measured quality says less of the gains than of both. The
twin flies the same test with and without it, and the ratio of the two is taken out of what was measured. Noise and
disturbances, too, help one flight and cost another. Where the twin explains the flights, it says how much they do, and
what it predicts of the gains counts beside the one measurement, each by the inverse of its variance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import exp, log
from twinloop.campaign import standing
from twinloop.campaign.identify_and_plan.calibration import missed
from twinloop.campaign.logbook import Logbook
from twinloop.planning.gusts import Moved
from twinloop.planning.judging import Committee
from twinloop.planning.planner import Planner
from twinloop.test import Test

OWN = 0.5
"""Share of what predictions miss that is of these gains alone."""
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
    numbers = [number for _, number in first]
    alone = np.array(
        [quality * share_of(planner, committee, known[number], draws) for quality, number in first]
    )
    if len(numbers) > 1 and committee.explains and planner.options.alone:
        tests = [book.of_task(known[number].genes, number) for number in numbers]
        genes = np.stack([test.genes for test in tests])
        quiet = planner.judge(committee.members, genes, committee.sds, draws, measured=True).qualities
        gusts = [committee.moved_by_gusts(test) for test in tests]
        alone = weighed(alone, quiet, gusts, missed(book.experiments))
    return known[min(zip(alone.tolist(), numbers, strict=True))[1]]


def weighed(measured: Floats, predicted: Floats, gusts: Sequence[Moved], off: float) -> Floats:
    """Qualities to be expected of flown gains: what was measured of each once, and what is predicted, by variance.

    What is common to all predictions does not tell gains apart, and adds nothing to their variance.

    Args:
        measured: without excitation (K,).
        predicted: of members under draws of the sensors' noise (members, draws, K), infinite where one diverges.
        gusts: what disturbances do to each flight.
        off: share of a quality by which predictions have missed of late.

    Returns:
        As many, in the unit of the qualities; what was measured where the twin cannot say.
    """
    if not np.isfinite(predicted).all():
        return measured
    of_members = predicted.mean(axis=1)
    expected = of_members.mean(axis=0) + np.array([moved.bias for moved in gusts])
    if min(expected.min(), measured.min(), of_members.min()) <= 0.0:
        return measured
    spread = np.array([moved.spread for moved in gusts])
    luck = float(((predicted.var(axis=1).mean(axis=0) + spread * spread) / (expected * expected)).mean())
    relative = of_members / of_members.mean(axis=1, keepdims=True)
    wrong = float(relative.var(axis=0).mean()) + OWN * OWN * off * off
    share = luck / (luck + wrong) if luck > 0.0 else 0.0
    return exp((1.0 - share) * log(measured) + share * log(expected))


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
    members, excited = planner.as_flown(committee.members, test, committee.sds, draws)
    alone = planner.judge(members, test.genes[np.newaxis], committee.sds, draws, measured=True)
    without, within = float(alone.mean[0]), float(excited.mean[0])
    usable = math.isfinite(without) and math.isfinite(within) and min(without, within) > 0.0
    return without / within if usable else 1.0
