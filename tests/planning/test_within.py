"""Gains tuned within the limits of the next flight, beside a dense sample of all gains and the rules in words."""

from dataclasses import replace

import numpy as np
import pytest

from committees import TASK, committee_of, member, planner_of, signals
from oracles import same_bits
from twinloop._ground.streams import Unit
from twinloop.planning import within as tuning
from twinloop.planning.proposal import Flown, Wanted
from twinloop.planning.reach import bounds_of, reach_of
from twinloop.planning.seen import Seen
from twinloop.planning.within import tune_within

KNOWN = signals(envelope=(-0.9, 0.9), rate=(-1.5, 1.5))
PLANNER = planner_of(KNOWN, candidates=64, evaluations=4096)
COMMITTEE = committee_of(KNOWN)
WANTED = Wanted("both", 3, exploit=False)
GENTLE = np.array([0.3, 0.0, 1.5])
SLOW = np.array([[-0.9, -0.4], [0.9, 0.4]])
"""Bounds in which the motor may turn at 0.4 rad/s at most."""


def within(bounds=SLOW, committee=COMMITTEE, planner=PLANNER):
    return tune_within(
        planner, planner.options, committee, committee.members, bounds, [GENTLE], 3, lambda: None
    )


def quality_and_usage(genes, bounds=SLOW, members=COMMITTEE.members):
    judged = PLANNER.judge_within(bounds, members, genes)
    return judged.mean, judged.worst_usage


def test_they_are_as_good_as_the_best_of_all_gains_that_stay_within():
    genes = PLANNER.family.from_unit(Unit(1).part(1).stream("candidates").uniforms(20_000, 3))
    quality, usage = quality_and_usage(genes)
    most = 1.0 - PLANNER.options.margin
    best = quality[usage <= most].min()
    (found,), (used,) = quality_and_usage(within()[np.newaxis])
    assert used <= 1.001 * most and found <= 1.01 * best
    # The bounds are what holds them back.
    assert quality.min() < 0.8 * best


def test_a_bound_that_is_infinite_holds_nothing_back():
    anywhere = np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
    genes = within(anywhere)
    assert quality_and_usage(genes[np.newaxis])[1][0] > 1.0
    assert quality_and_usage(genes[np.newaxis], anywhere)[1][0] == 0.0


def test_they_keep_the_envelope_on_a_model_with_more_delay():
    slow = [member(KNOWN, 40.0, 0.0)]
    free, held = within(), within(committee=replace(COMMITTEE, delayed=slow))

    def usage(genes):
        return PLANNER.judge(slow, genes[np.newaxis], np.zeros(2), 1).worst_usage[0]

    assert usage(held) <= 1.0 < usage(free)


def test_where_a_flight_diverges_the_mean_is_that_of_those_that_last_and_an_excess_is_in_its_units(
    monkeypatch,
):
    backwards = [*COMMITTEE.members, member(KNOWN, -40.0)]
    wild = np.array([9.0, 0.0, 0.05])
    scores = []

    def only_scored(family, score, starts, **how):
        scores.append(score(np.stack([GENTLE, wild])))
        return starts[0]

    monkeypatch.setattr(tuning, "tune_gains", only_scored)
    within(committee=replace(COMMITTEE, members=backwards))
    judged = PLANNER.judge_within(SLOW, backwards, np.stack([GENTLE, wild]))
    assert np.isinf(judged.qualities[-1]).all() and np.isfinite(judged.qualities[:-1]).all()
    mean, excess = judged.qualities[:-1, 0].mean(axis=0), judged.usages[:-1, 0].max(axis=0) - 0.9
    assert excess[0] < 0.0 < excess[1]
    expected = [mean[0], mean[1] + excess[1] * (10.0 * mean[1] + mean[0])]
    np.testing.assert_allclose(scores[0], np.stack([[0.25, 0.25], expected], axis=1), rtol=1e-12)


@pytest.mark.parametrize("exploit", [False, True])
def test_where_the_tuned_gains_lead_too_far_the_best_within_the_limits_fly(exploit):
    quick = np.array([9.0, 0.0, 1.0])
    seen = Seen(np.array([[0.4, -0.05], [0.5, 0.02]]), np.array([[0.4, 0.0], [0.5, 0.0]]))
    flown = Flown(best=GENTLE, flies=True, usages=[0.56], good=1.0, seen=seen)
    bounds = bounds_of(flown, WANTED, KNOWN, PLANNER.options)
    promised = {}
    for switched in (True, False):
        planner = planner_of(KNOWN, candidates=64, evaluations=4096, within=switched)
        found = planner.propose(COMMITTEE, quick, flown, "both", 3, exploit)
        promised[switched] = found.predicted
        assert not same_bits(found.genes, quick)
        assert exploit == (found.excitation is None) or not switched
    genes = np.stack([quick, found.genes])
    assert quality_and_usage(genes, bounds)[1][0] > 1.0
    assert promised[True] < 0.95 * promised[False]


def test_the_next_flight_keeps_both_the_reach_in_the_envelope_and_the_states_near_those_seen():
    seen = Seen(np.array([[0.0, -0.1], [0.5, 0.1]]), np.zeros((2, 2)))
    flown = Flown(best=GENTLE, flies=True, usages=[0.6], good=1.0, seen=seen)
    options = replace(PLANNER.options, reach_seen=1.0)
    reach, near = reach_of(flown, WANTED, options), seen.around(1.0, KNOWN)
    low, high = bounds_of(flown, WANTED, KNOWN, options)
    assert reach == pytest.approx(0.75)
    np.testing.assert_allclose(low, [max(-0.9 * reach, near[0, 0]), max(-1.5 * reach, near[0, 1])])
    np.testing.assert_allclose(high, [min(0.9 * reach, near[1, 0]), min(1.5 * reach, near[1, 1])])
    # Each flight may go half as far again as is left to the margin, and as far as those before it.
    for most, further in ((0.2, 0.7), (0.5, 0.7), (0.7, 0.8), (0.8, 0.85), (0.88, 0.89), (0.95, 0.9)):
        farther = replace(flown, usages=[0.5, most])
        assert reach_of(farther, WANTED, options) == pytest.approx(further)
        # The last one goes hardly further than others have.
        last = reach_of(farther, replace(WANTED, last=True), options)
        assert last == pytest.approx(min(0.9, max(0.7, most + 0.01)))
    # Once a prediction has come true the envelope alone counts.
    low, high = bounds_of(replace(flown, seen=None), WANTED, KNOWN, options)
    np.testing.assert_allclose(high, [0.9 * reach, 1.5 * reach])
    np.testing.assert_allclose(low, -high)
    assert TASK.initial_state[0] <= high[0]


def test_on_a_twin_that_explains_no_flight_nothing_is_tuned_under_limits():
    quick, seen = (
        np.array([9.0, 0.0, 1.0]),
        Seen(np.array([[0.4, -0.05], [0.5, 0.02]]), np.array([[0.4, 0.0], [0.5, 0.0]])),
    )
    flown = Flown(best=GENTLE, flies=True, usages=[0.56], good=1.0, seen=seen)
    unexplained = replace(COMMITTEE, explains=False)
    without = planner_of(KNOWN, candidates=64, evaluations=4096, within=False)
    expected = without.propose(COMMITTEE, quick, flown, "both", 3, False)
    assert same_bits(PLANNER.propose(unexplained, quick, flown, "both", 3, False).genes, expected.genes)
    assert not same_bits(PLANNER.propose(COMMITTEE, quick, flown, "both", 3, False).genes, expected.genes)
