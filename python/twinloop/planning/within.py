"""Within: the best gains of those that may be flown next, where those tuned on the committee lead too far.

What is promised of gains that may not be flown is of no use, and candidates beside them that may be flown are there by
chance, far from the best ones. So the gains are tuned once more, under the limits of the next flight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.planning.gains import scores_of, tune_gains
from twinloop.planning.halfway import beyond_halfway
from twinloop.planning.judging import Committee, Judge
from twinloop.planning.settings import PlanningOptions

SPREAD = 0.1
"""Standard deviation of the first steps of a search, in ranges of the gains."""


def tune_within(
    judge: Judge,
    options: PlanningOptions,
    committee: Committee,
    members: Sequence[_core.Model],
    bounds: Floats,
    starts: Sequence[Floats],
    number: int,
    watch: Callable[[], None],
    disproved: Sequence[Floats] = (),
) -> Floats:
    """Genes (size,) of the best mean quality of those whose quiet flights stay within bounds, with the margin.

    Args:
        judge: of the campaign.
        options: of the planning.
        committee: whose models with more delay have to keep the envelope.
        members: of it that judge, and may not leave the bounds.
        bounds: of the states (2, n_x).
        starts: genes to start from, the best flown first: gains that cannot be tuned stay as there.
        number: of the test, for its streams.
        watch: called after every generation.
        disproved: gains of flights that the committee is wrong about: the answer leads at most halfway to them.

    Returns:
        Those of the least excess where none stays within.
    """
    most = 1.0 - options.margin
    unit = float(judge.judge_within(bounds, members, starts[0][np.newaxis]).mean_of_finite[0])

    def score(asked: Floats) -> Floats:
        genes = committee.as_flown(asked, starts[0])
        near = judge.judge_within(bounds, members, genes)
        lost, excess = near.lost, np.maximum(0.0, near.finite.worst_usage - most)
        excess = excess + beyond_halfway(judge.family, genes, starts[0], disproved)
        if committee.delayed:
            late = judge.quiet(committee.delayed, genes)
            lost = lost + late.lost
            excess = excess + np.maximum(0.0, late.finite.worst_usage - most)
        return scores_of(lost, near.mean_of_finite, excess, unit)

    found = tune_gains(
        judge.family, score, starts, evaluations=options.evaluations // 2, spread=SPREAD,
        unit=judge.unit.part(number, 0, 1), purpose="gains", watch=watch,
    )  # fmt: skip
    return committee.as_flown(found, starts[0])
