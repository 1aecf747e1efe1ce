"""Track record: predictions that came true, that missed, that promised too much, and what is risked before any did."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from conftest import pendulum_step
from lives import CONTROLLER, SIGNALS, SMALL
from twinloop.campaign.identify_and_plan.track_record import (
    UNEXPLAINED,
    UNPROVEN,
    WEIGHT,
    confirmed,
    nearly_confirmed_in_a_row,
    over_promised,
    unproven_risk,
)
from twinloop.planning.proposal import Fared


def experiment(predicted=None, quality=1.0, spread=0.01):
    test = SimpleNamespace(predicted=predicted, spread=spread)
    return SimpleNamespace(test=test, quality=quality, off_start=())


def flight(predicted, spread, quality, gain, ended="completed"):
    test = SimpleNamespace(predicted=predicted, spread=spread, genes=np.array([gain]))
    return SimpleNamespace(
        test=test,
        quality=quality,
        trajectory=SimpleNamespace(ended=ended),
        off_start=(),
        left_envelope=False,
        kept_envelope=ended == "completed",
    )


@pytest.mark.parametrize(
    ("ratios", "answer"),
    [
        ([], 1.0),
        ([1.3], 1.0),
        ([1.3, 0.9], 1.0),
        ([0.9, 1.3], 1.0),
        ([1.1, 1.3], 1.1),
        ([0.5, 1.3, 1.05], 1.05),
    ],
)
def test_two_flights_in_a_row_that_were_worse_than_promised_count(ratios, answer):
    runs = [experiment(0.8, 0.8 * ratio) for ratio in ratios]
    assert over_promised([experiment(None), *runs, experiment(None), experiment(np.nan)]) == pytest.approx(
        answer
    )
    # A flight that was cut has no quality.
    assert over_promised([*runs, experiment(0.8, None)]) == pytest.approx(answer)


@pytest.mark.parametrize(
    ("runs", "answer"),
    [
        ([], True),
        ([experiment(None)], True),
        ([experiment(np.nan)], True),
        ([experiment(0.981, 1.0, 0.01)], True),
        ([experiment(0.979, 1.0, 0.01)], False),
        ([experiment(0.98, None, 0.01)], False),
        ([experiment(np.inf, 1.0, np.inf)], False),
        ([experiment(0.98, 1.0, None)], False),
        ([experiment(0.5), experiment(1.0)], True),
        ([experiment(1.0), experiment(0.5), experiment(None)], False),
    ],
)
def test_the_last_flight_that_was_predicted_confirms_within_two_spreads(runs, answer):
    assert confirmed(runs) is answer


@pytest.mark.parametrize(
    ("predicted", "spread", "quality", "true"),
    [
        (1.0, 0.1, 1.19, True),
        (1.0, 0.1, 1.3, False),
        (1.0, 0.0, 1.05, True),
        # Within two spreads of 2 is nearly everything.
        (1.0, 2.0, 1.29, True),
        (1.0, 2.0, 1.5, False),
        (None, None, 1.0, False),
        (np.inf, np.inf, 1.0, False),
    ],
)
def test_a_prediction_comes_true_within_two_spreads_or_a_tenth(predicted, spread, quality, true):
    run = flight(predicted, spread, quality, 1.0)
    unasked = SimpleNamespace(test=None, quality=5.0)
    assert nearly_confirmed_in_a_row([run]) == nearly_confirmed_in_a_row([unasked, run]) == true
    # One that missed ends the row; of what was not predicted nothing is said.
    came_true = flight(1.0, 0.1, 1.0, 2.0)
    in_a_row = 2 if true else int(predicted is None)
    assert nearly_confirmed_in_a_row([came_true, run, unasked]) == in_a_row
    assert nearly_confirmed_in_a_row([run, came_true]) == 1 + true
    # Of gains that flew before the twin knows how they fly: that they do so again says nothing of others.
    again, missed = flight(1.0, 0.1, 1.0, 1.0), flight(1.0, 0.1, 2.0, 1.0)
    assert nearly_confirmed_in_a_row([run, again]) == true
    assert nearly_confirmed_in_a_row([run, came_true, missed]) == 0


def test_a_flight_that_was_better_than_predicted_shows_no_delay_though_the_prediction_missed():
    better, true, worse = flight(1.0, 0.1, 0.5, 1.0), flight(1.0, 0.1, 1.0, 2.0), flight(1.0, 0.1, 1.5, 3.0)
    for runs, strict, lenient in (
        ([better], 0, 1), ([true, better], 0, 2), ([worse], 0, 0), ([better, worse], 0, 0), ([worse, better], 0, 1),
    ):  # fmt: skip
        assert nearly_confirmed_in_a_row(runs) == strict
        assert nearly_confirmed_in_a_row(runs, or_better=True) == lenient
    # One that was cut has no quality.
    assert nearly_confirmed_in_a_row([flight(1.0, 0.1, None, 1.0)], or_better=True) == 0


def with_envelope(width):
    """The pendulum's signals, with an envelope of so many scales about 0 of each state, or with none."""
    envelopes = [
        None if width is None else (-width * state.scale, width * state.scale) for state in SIGNALS.states
    ]
    states = [
        replace(state, envelope=envelope) for state, envelope in zip(SIGNALS.states, envelopes, strict=True)
    ]
    return replace(SIGNALS, states=states)


BOUNDED, FREE = with_envelope(9.0), with_envelope(None)
NEW, KEPT = Fared(0, 0), Fared(1, 0)


def test_gains_that_have_not_flown_are_a_risk_until_a_prediction_has_come_true():
    true, missed = flight(1.0, 0.1, 1.0, 1.0), flight(1.0, 0.1, 2.0, 2.0)
    assert unproven_risk([], NEW, BOUNDED) == unproven_risk([missed], NEW, BOUNDED) == UNPROVEN
    assert unproven_risk([true, missed], NEW, BOUNDED) == UNPROVEN
    assert unproven_risk([true], NEW, BOUNDED) == unproven_risk([missed, true], NEW, BOUNDED) == 0.0
    # Gains that flew show it themselves, and without an envelope none is left.
    # A twin that does not explain its own flights foretells others less well.
    assert unproven_risk([missed], NEW, BOUNDED, explains=False) == UNEXPLAINED > UNPROVEN
    assert unproven_risk([true], NEW, BOUNDED, explains=False) == 0.0
    assert unproven_risk([], KEPT, BOUNDED) == unproven_risk([], NEW, FREE) == 0.0


def test_flights_that_left_against_what_was_predicted_are_a_risk_of_the_next_one():
    true, left = flight(1.0, 0.1, 1.0, 1.0), flight(1.0, 0.1, None, 2.0, ended="diverged")
    risks = [unproven_risk([true] + n * [left], NEW, BOUNDED) for n in (1, 2, 4, 100)]
    assert risks == sorted(risks) and 0.1 < risks[0] < 0.3 and 0.9 < risks[-1] < 1.0
    assert risks[1] == pytest.approx((WEIGHT * UNPROVEN + 2) / (WEIGHT + 2))
    assert unproven_risk([left, left, true], NEW, BOUNDED) == 0.0
    # One that misses what was predicted inside the envelope refutes nothing of this.
    missed = flight(1.0, 0.1, 2.0, 3.0)
    assert (
        UNPROVEN == unproven_risk(20 * [missed], NEW, BOUNDED) < unproven_risk([left, missed], NEW, BOUNDED)
    )


def test_a_campaign_says_so_of_its_first_prediction():
    plant = tl.systems.Simulated(BOUNDED, pendulum_step, noise=0.001, seed=1)
    campaign = tl.Campaign(
        BOUNDED, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options=SMALL,
    )  # fmt: skip
    test = campaign.test({"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3})
    campaign.tell(test, plant.run(test))
    assert campaign.ask().risk >= UNPROVEN
