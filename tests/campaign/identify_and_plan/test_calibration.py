"""Calibration: the spread of a predicted quality comes true as often as it says."""

from types import SimpleNamespace

import numpy as np
import pytest

from twinloop.campaign.identify_and_plan.calibration import beside_misses, calibrated, held_to
from twinloop.planning.judging import expected


def flight(predicted, quality):
    test = None if predicted is None else SimpleNamespace(predicted=predicted)
    return SimpleNamespace(test=test, quality=quality, off_start=())


def test_what_is_expected_spreads_over_members_and_noise_alike():
    stream = np.random.default_rng(0)
    members, noise = stream.normal(0.0, 3.0, (400, 1)), stream.normal(0.0, 4.0, (400, 400))
    mean, spread = expected(100.0 + members + noise)
    assert mean == pytest.approx(100.0, abs=0.5)
    assert spread == pytest.approx(5.0, rel=0.05)


def test_where_one_member_diverges_nothing_is_known():
    assert expected(np.array([[1.0, np.inf]])) == (np.inf, np.inf)
    assert calibrated(np.inf, np.inf, []) == np.inf


def test_a_spread_is_no_smaller_than_what_predictions_missed_by():
    missed = [flight(1.1, 1.0), flight(2.2, 2.0), flight(0.55, 0.5)]
    assert calibrated(1e-6, 3.0, missed) == pytest.approx(2.0 * 0.1 * 3.0)
    assert calibrated(9.0, 3.0, missed) == 9.0


def test_before_any_prediction_was_flown_a_spread_is_what_second_flights_miss_by_and_confirms_no_more_for_it():
    assert calibrated(1e-6, 3.0, []) == pytest.approx(0.15 * 3.0)
    assert calibrated(9.0, 3.0, []) == 9.0
    assert held_to(3.0, calibrated(1e-6, 3.0, [])) == pytest.approx(0.04 * 3.0)
    assert held_to(3.0, calibrated(9.0, 3.0, [])) == 9.0
    # A twin that misses the flight that it was learnt from misses the next one by more, and that is no merit either.
    missing = calibrated(1e-6, 3.0, [], misses_own=True)
    assert missing == pytest.approx(0.35 * 3.0) and held_to(3.0, missing) == pytest.approx(0.04 * 3.0)
    missed = [flight(1.1, 1.0)]
    assert calibrated(1e-6, 3.0, missed, misses_own=True) == calibrated(1e-6, 3.0, missed)
    assert held_to(3.0, calibrated(1e-6, 3.0, missed)) == calibrated(1e-6, 3.0, missed)


def asked(quality):
    """A flight of the user's own controller: nothing was predicted of it."""
    return SimpleNamespace(test=SimpleNamespace(predicted=None), quality=quality, off_start=())


def test_a_promise_is_as_uncertain_as_earlier_promises_were_though_what_had_flown_flew_again_as_predicted():
    again = [flight(8.02, 8.0), flight(7.99, 8.0)]
    # One of 5 missed by 1, one of 3 by 0.5; the next is one of 1.
    found = calibrated(1e-6, 2.5, [asked(10.0), flight(5.0, 6.0), flight(3.0, 3.5), flight(3.51, 3.5)])
    assert found == pytest.approx(2.0 * (1.0 / 5.0 * 0.5 / 3.0) ** 0.5 * 1.0)
    # Most of one did not come: the next one may not come at all.
    broken = [asked(10.0), flight(2.0, 8.0), *again]
    assert 2.0 * calibrated(1e-6, 5.0, broken) == pytest.approx(8.0 - 5.0)
    assert beside_misses(1e-6, 5.0, broken) < 0.02 * 5.0
    # That gains fly as they have flown is no promise.
    assert calibrated(1e-6, 8.0, broken) < 0.01 * 8.0


def test_where_only_what_had_flown_was_foretold_a_promise_has_the_spread_of_a_first_prediction():
    known = [asked(10.0), flight(10.01, 10.0), flight(9.99, 10.0)]
    assert calibrated(1e-6, 5.0, known) == calibrated(1e-6, 5.0, [])
    assert calibrated(1e-6, 5.0, known, misses_own=True) == calibrated(1e-6, 5.0, [], misses_own=True)
    assert calibrated(1e-6, 9.95, known) < 0.005 * 10.0


def test_flights_without_a_prediction_or_a_quality_tell_nothing_of_it():
    nothing = [flight(None, 1.0), flight(np.nan, 1.0), flight(np.inf, 1.0), flight(5.0, None)]
    assert calibrated(1e-6, 1.0, nothing) == calibrated(1e-6, 1.0, [])


def test_of_normal_misses_nine_to_ten_of_ten_are_within_two_spreads():
    stream = np.random.default_rng(1)
    inside = []
    for _ in range(4000):
        flown = 1.0 + 0.01 * stream.standard_normal(4)
        spread = calibrated(0.0, 1.0, [flight(1.0, quality) for quality in flown[:3]])
        inside.append(abs(flown[3] - 1.0) < 2.0 * spread)
    assert 0.85 < np.mean(inside) < 0.98
