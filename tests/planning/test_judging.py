"""Judging in turn: each draw of noise and of disturbances on one of the members."""

import numpy as np
import pytest

from committees import STEPS, TUNED, committee_of, planner_of, signals
from oracles import same_bits

GENES = np.stack([TUNED, [3.0, 0.0, 1.0]])


@pytest.mark.parametrize("draws", [3, 7, 16])
@pytest.mark.parametrize("disturbed", [False, True])
def test_each_draw_is_met_by_one_member_and_each_member_meets_its_share_of_them(draws, disturbed):
    planner, committee = planner_of(signals()), committee_of(signals())
    pushes = 0.02 * np.random.default_rng(3).standard_normal((draws, STEPS, 2)) if disturbed else None
    sds = 20.0 * committee.sds
    every = planner.judge(committee.members, GENES, sds, draws, disturbances=pushes)
    judged = planner.judge_in_turn(committee.members, GENES, sds, draws, pushes)
    numbers = [(member, draw) for member in range(3) for draw in range(member, draws, 3)]
    assert sorted(draw for _, draw in numbers) == list(range(draws))
    assert len(np.unique(every.qualities)) == every.qualities.size
    for found, whole in ((judged.qualities, every.qualities), (judged.usages, every.usages)):
        assert same_bits(found[0], np.stack([whole[place] for place in numbers]))


def test_in_calm_and_where_there_are_fewer_draws_than_members_each_member_meets_all_of_them():
    planner, committee = planner_of(signals()), committee_of(signals())
    for draws in (1, 2):
        every = planner.judge(committee.members, GENES, committee.sds, draws)
        judged = planner.judge_in_turn(committee.members, GENES, committee.sds, draws, None)
        assert same_bits(judged.qualities, every.qualities) and same_bits(judged.usages, every.usages)
    alone = committee.members[:1]
    every = planner.judge(alone, GENES, committee.sds, 5)
    assert same_bits(planner.judge_in_turn(alone, GENES, committee.sds, 5, None).qualities, every.qualities)
