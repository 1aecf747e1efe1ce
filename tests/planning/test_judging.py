"""Judging: each draw on every member or on one of them in turn, without noise, and a test as it was flown."""

import numpy as np
import pytest

import twinloop as tl
from committees import STEPS, TUNED, committee_of, member, planner_of, signals
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


def test_a_quiet_flight_knows_no_noise():
    planner, committee = planner_of(signals()), committee_of(signals())
    quiet = planner.quiet(committee.members, GENES)
    assert quiet.qualities.shape == (3, 1, 2)
    drawn = planner.judge(committee.members, GENES, 1e-9 * committee.sds, 5)
    assert np.allclose(drawn.qualities, quiet.qualities, rtol=1e-6)
    noisy = planner.judge(committee.members, GENES, 20.0 * committee.sds, 5)
    assert not np.allclose(noisy.qualities, quiet.qualities, rtol=1e-3)


def test_a_test_as_it_was_flown_has_its_excitation_and_the_members_that_last():
    planner, committee = planner_of(signals()), committee_of(signals())
    excitation = 0.05 * np.sin(np.arange(STEPS))[:, np.newaxis]
    plain = tl.Test(planner.family, TUNED, planner.task.initial_state, planner.task.target_state, STEPS)
    excited = tl.Test(
        planner.family, TUNED, planner.task.initial_state, planner.task.target_state, STEPS, excitation
    )
    for test, added in ((plain, None), (excited, excitation[np.newaxis])):
        members, judged = planner.as_flown(committee.members, test, committee.sds, 4)
        alone = planner.judge(members, TUNED[np.newaxis], committee.sds, 4, added, measured=True)
        assert members == list(committee.members) and same_bits(judged.qualities, alone.qualities)
    runaway = [*committee.members, member(signals(), 1.0, damping=-60.0)]
    members, judged = planner.as_flown(runaway, excited, committee.sds, 4)
    assert members == list(committee.members) and same_bits(judged.qualities, alone.qualities)
