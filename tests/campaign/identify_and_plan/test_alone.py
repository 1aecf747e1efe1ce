"""What flown gains are worth without the excitation of their flight, and without its luck."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from conftest import PENDULUM_GAINS
from lives import CONTROLLER, SIGNALS, THOROUGH
from twinloop.campaign import standing
from twinloop.campaign.identify_and_plan.alone import OWN, best_alone, share_of, weighed
from twinloop.planning.gusts import UNMOVED, Moved


@pytest.fixture
def learnt(pendulum):
    """A campaign that has learnt the pendulum from two flights, with two more of one excitation and of none."""
    campaign = tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options=THOROUGH,
    )  # fmt: skip
    campaign.run(pendulum, 2)
    steps = campaign.experiments[0].test.steps
    push = np.full((steps, 1), 1.5)
    genes = [np.array(CONTROLLER.bind(SIGNALS).genes(PENDULUM_GAINS)), np.array([4.0, 1.0, 0.5])]
    for gains, excitation in zip(genes, (push, None), strict=True):
        test = campaign.test(
            dict(zip(CONTROLLER.bind(SIGNALS).names, gains.tolist(), strict=True)), excitation=excitation
        )
        campaign.tell(test, pendulum.run(test))
    _ = campaign.twin
    return campaign


def test_the_share_is_that_of_the_system(learnt, pendulum):
    excited = next(run.test for run in reversed(learnt.experiments) if run.test.excitation is not None)
    quiet = learnt.test(excited.parameters, excitation=None)
    within, without = (pendulum.run(test).states for test in (excited, quiet))
    qualities = [np.abs(states[1:, 0] - 1.0).sum() for states in (without, within)]
    method = learnt._method

    found = share_of(method.planner, method._committee(learnt._book), excited, 1)

    assert found == pytest.approx(qualities[0] / qualities[1], rel=0.02)
    assert abs(found - 1.0) > 0.05  # or it shows nothing
    assert share_of(method.planner, method._committee(learnt._book), quiet, 1) == 1.0
    method.planner.options = replace(method.planner.options, alone=False)
    assert share_of(method.planner, method._committee(learnt._book), excited, 1) == 1.0


def test_gains_are_not_the_best_for_what_their_excitation_did(learnt):
    method, book = learnt._method, learnt._book
    committee = method._committee(learnt._book)
    worth = {
        run.number: run.quality * share_of(method.planner, committee, run.test, 1)
        for run in learnt.experiments
    }

    assert best_alone(method.planner, committee, book, 1).number == min(worth, key=worth.get)
    distrusted = type(committee)(committee.members, committee.sds, trusted=False)
    assert best_alone(method.planner, distrusted, book, 1) is standing.best_flown(book)


def flights(truth, noise, wrong, seed, members=8, draws=32, common=1.3):
    """What a committee predicts of gains, with an error that is common to all and one of each member and gains."""
    random = np.random.default_rng(seed)
    own = common * (1.0 + wrong * random.normal(size=(members, 1, len(truth))))
    return truth * own * (1.0 + noise * random.normal(size=(members, draws, 1)))


def test_of_gains_as_good_as_measured_the_luckiest_are_not_the_best():
    truth, noise, count = np.array([1.0, 0.97, 0.94, 1.02]), 0.08, 400
    found, by_luck = [], []
    for seed in range(count):
        measured = truth * (1.0 + noise * np.random.default_rng([seed, 1]).normal(size=4))
        worth = weighed(measured, flights(truth, noise, 0.01, seed), [UNMOVED] * 4, 0.02)
        found.append(truth[np.argmin(worth)])
        by_luck.append(truth[np.argmin(measured)])
    assert np.mean(found) < 0.95 < 0.965 < np.mean(by_luck)


def test_what_was_measured_and_what_is_predicted_count_by_the_inverse_of_their_variances():
    truth = np.array([2.0, 3.0])
    predicted, gusts = flights(truth, 0.05, 0.03, 4), [Moved(0.1, 0.2), Moved(-0.1, 0.1)]
    measured, off = np.array([2.2, 2.9]), 0.04
    means = predicted.mean(axis=1)
    expected = means.mean(axis=0) + np.array([0.1, -0.1])
    luck = np.mean(
        [(predicted[:, :, k].var(axis=1).mean() + gusts[k].spread ** 2) / expected[k] ** 2 for k in (0, 1)]
    )
    relative = [means[:, k] / means.mean(axis=1) for k in (0, 1)]
    wrong = np.mean([each.var() for each in relative]) + (OWN * off) ** 2
    logs = (np.log(measured) / luck + np.log(expected) / wrong) / (1.0 / luck + 1.0 / wrong)
    np.testing.assert_allclose(weighed(measured, predicted, gusts, off), np.exp(logs), rtol=1e-12)


@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3), st.permutations(range(4)))
def test_neither_units_nor_order_nor_what_all_predictions_miss_change_the_choice(seed, unit, order):
    random = np.random.default_rng(seed)
    truth = random.uniform(0.5, 2.0, 4)
    measured, predicted = truth * random.uniform(0.8, 1.2, 4), flights(truth, 0.1, 0.05, seed)
    gusts = [Moved(0.0, size) for size in random.uniform(0.0, 0.1, 4)]
    best = int(np.argmin(weighed(measured, predicted, gusts, 0.05)))
    at = list(order)
    moved = [Moved(0.0, unit * gusts[i].spread) for i in at]
    again = weighed(unit * measured[at], unit * predicted[:, :, at], moved, 0.05)
    assert at[int(np.argmin(again))] == best
    twice = weighed(measured, 2.0 * predicted, [Moved(0.0, 2.0 * each.spread) for each in gusts], 0.05)
    assert int(np.argmin(twice)) == best


def test_measurements_decide_where_nothing_was_luck_and_where_the_twin_cannot_say():
    measured, truth = np.array([1.1, 1.0]), np.array([1.0, 1.2])
    assert weighed(measured, flights(truth, 0.0, 0.05, 0), [UNMOVED] * 2, 0.05) is not measured
    np.testing.assert_allclose(weighed(measured, flights(truth, 0.0, 0.05, 0), [UNMOVED] * 2, 0.05), measured)
    lost = flights(truth, 0.1, 0.05, 0)
    lost[3, 2, 1] = np.inf
    assert weighed(measured, lost, [UNMOVED] * 2, 0.05) is measured
