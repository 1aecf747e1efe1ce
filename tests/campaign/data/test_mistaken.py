"""A flight that was told as that of another test counts for no gains, whichever way it is learnt of."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import twinloop as tl
from logged_flights import GAINS, flown, new_campaign
from twinloop.campaign import standing
from twinloop.campaign.data.excited import Excited, as_excited
from twinloop.campaign.data.mistaken import flight_of
from twinloop.campaign.withdrawing import _made_by
from twinloop.errors import RemarkWarning

OTHERS = {"angle.kp": 3.0, "angle.ki": 1.0, "angle.kd": 0.4}


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 99), st.sampled_from([0.0, 1e-3, 2e-2]), st.sampled_from(Excited))
def test_a_flight_of_its_own_test_is_that_of_no_other_however_it_was_excited(seed, noise, how):
    campaign = new_campaign()
    tests = [campaign.test(gains) for gains in (GAINS, OTHERS, GAINS, {**GAINS, "angle.kp": 2.001})]
    for test in tests:
        assert flight_of(test, flown(as_excited(test, how), noise, seed), tests) is None


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 99),
    st.sampled_from([0.0, 1e-3, 2e-2]),
    st.sampled_from([Excited.HELD_BACK, Excited.WHOLE]),
)
def test_that_of_another_is_told_apart(seed, noise, how):
    campaign = new_campaign()
    tests = [campaign.test(gains) for gains in (GAINS, OTHERS, {**GAINS, "angle.kd": 0.6})]
    run = flown(as_excited(tests[1], how), noise, seed)
    assert flight_of(tests[0], run, tests) is tests[1] and flight_of(tests[2], run, tests) is tests[1]


@pytest.mark.parametrize(
    "change",
    [
        lambda test: dataclasses.replace(test, genes=0.7 * test.genes),
        lambda test: dataclasses.replace(test, target_state=np.array([0.8, 0.0])),
    ],
    ids=["other gains", "another target"],
)
def test_what_is_no_flight_of_the_campaign_is_that_of_none(change):
    campaign = new_campaign()
    tests = [campaign.test(gains) for gains in (GAINS, OTHERS)]
    assert flight_of(tests[0], flown(change(tests[0])), tests) is None


def told():
    """A campaign whose test 1 was told with a flight of test 0."""
    campaign = new_campaign()
    first, second = campaign.test(GAINS), campaign.test(OTHERS)
    campaign.tell(first, flown(first))
    with pytest.warns(
        RemarkWarning, match=r"told as test 1 is a flight of test 0, .* as test 0\. .*\(other-test\)"
    ):
        campaign.tell(second, flown(first, seed=1))
    return campaign, first, second


def test_it_counts_under_its_commands_and_for_no_gains():
    campaign, _, second = told()
    flight = campaign.experiments[1]
    assert flight.test is None and flight.number == 1 and not flight.attached and flight.quality is None
    assert campaign.status(second) == "flown" and campaign.cost.attached == 0
    assert standing.times_flown(campaign._book, second.genes) == 0
    assert {each.code: each.severity for each in campaign.twin.remarks}["other-test"] == "serious"


def test_the_record_is_read_as_it_was_told_and_later_tests_change_nothing():
    campaign, first, _ = told()
    third = campaign.test({**GAINS, "angle.kp": 4.0}, excitation=None)
    with pytest.warns(RemarkWarning, match="other-gains"):
        campaign.tell(third, flown(dataclasses.replace(third, genes=first.genes)))
    # Made later, so nobody can have meant it.
    campaign.test(GAINS, excitation=None)
    kept = tl.Campaign.from_record(campaign.to_record())
    for one, other in zip(campaign.experiments, kept.experiments, strict=True):
        assert (one.test is None) == (other.test is None) and one.number == other.number
    assert [each.replayed.flown.number for each in kept.experiments[1:]] == [0, 2]


def test_once_it_is_withdrawn_and_told_as_what_it_is_nothing_is_said():
    campaign, first, second = told()
    campaign.withdraw(second, "the log of test 0")
    campaign.tell(first, flown(first, seed=1))
    campaign.tell(second, flown(second))
    assert all(run.quality is not None for run in campaign.experiments)
    assert "other-test" not in {remark.code for remark in campaign.twin.remarks}


def test_a_test_that_waits_is_among_those_that_may_have_been_flown():
    campaign = new_campaign()
    first = campaign.test(GAINS)
    campaign.tell(first, flown(first))
    waits = campaign.ask()
    with pytest.warns(RemarkWarning, match=f"told as test {first.number} is a flight of test {waits.number}"):
        campaign.tell(first, flown(waits, seed=1))
    # What was asked for since changes nothing of it, nor does what is withdrawn.
    campaign.ask()
    campaign.withdraw(campaign.experiments[0], "another rig")
    for each in (campaign, tl.Campaign.from_record(campaign.to_record())):
        assert [run.replayed.flown.number for run in each.experiments] == [waits.number]


def test_a_test_that_was_asked_for_afterwards_is_not_among_them():
    campaign = new_campaign()
    first, second = campaign.test(GAINS), campaign.test(OTHERS)
    campaign.tell(first, flown(first))
    campaign.tell(second, flown(second))
    campaign.withdraw(second, "another rig")
    campaign.ask()
    book = campaign._book
    assert [_made_by(book.recorded[place], place, book) for place in (0, 1)] == [1, 2]


def test_the_latest_test_that_was_told_is_among_those_that_may_have_been_flown():
    campaign = new_campaign()
    tests = [campaign.test(gains) for gains in (GAINS, OTHERS)]
    campaign.tell(tests[1], flown(tests[1]))
    with pytest.warns(RemarkWarning, match="flight of test 1"):
        campaign.tell(tests[0], flown(tests[1], seed=1))
    assert campaign.experiments[1].quality is None
