"""Leaving the envelope: one true state is enough, of readings it takes two of five in a row."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from twinloop._experiment.envelope import band_outside, gone_from, outside, readings_leave
from twinloop.planning.judging import risk


@given(st.lists(st.floats(0.0, 3.0), max_size=30))
def test_readings_leave_where_two_of_five_in_a_row_are_outside(usages):
    expected = any(sum(usage > 1.0 for usage in usages[k : k + 5]) > 1 for k in range(len(usages)))
    assert readings_leave(np.array(usages)) == expected


def test_a_swing_leaves_though_no_two_readings_in_a_row_are_outside():
    swing = 1.15 * np.abs(np.cos(2.0 * math.pi * np.arange(60) / 4.5))
    assert not any(a > 1.0 and b > 1.0 for a, b in pairwise(swing))
    assert readings_leave(swing) and not readings_leave(np.where(np.arange(60) == 9, swing, 0.5))


def test_a_single_true_state_is_outside_a_bound_is_not():
    assert outside(np.array([[1.0, 1.0 + 1e-12], [np.inf, 0.0]])).tolist() == [[False, True], [True, False]]
    assert risk(np.array([1.0, 1.0, 2.0])) == pytest.approx(1.5 / 4.0)


@given(st.lists(st.sampled_from([0.2, 1.0, 1.1, math.inf]), max_size=12))
def test_a_flight_is_gone_from_where_two_and_most_of_what_is_left_are_outside(usages):
    places = [
        k
        for k in range(len(usages) - 1)
        if min(usages[k : k + 2]) > 1.0 and 2 * sum(u > 1.0 for u in usages[k:]) > len(usages) - k
    ]
    assert gone_from(np.array(usages)) == (places[0] if places else None)


def test_an_overshoot_comes_back():
    overshoot = np.array([0.2, 1.2, 1.3, 0.9, 0.3, 0.2, 0.1])
    assert readings_leave(overshoot) and gone_from(overshoot) is None


TURN = 2.0 * math.pi
YAW = tl.State("yaw", "rad", scale=3.14, periodic=True, envelope=(-1.0, 2.0))


@given(st.floats(-3.0, 4.0), st.floats(0.0, 4.0), st.integers(-3, 3))
def test_a_band_of_an_angle_is_outside_where_some_angle_between_its_ends_is(low, width, turns):
    values = low + np.linspace(0.0, width, 400)
    beyond = np.abs((values - 0.5 + math.pi) % TURN - math.pi) - 1.5
    if np.abs(beyond[[0, -1]]).min() > 0.02:  # nearer a bound, the samples do not decide
        found = band_outside(YAW, np.array([low + turns * TURN]), np.array([low + width + turns * TURN]))
        assert found.tolist() == [bool((beyond > 0.0).any())]


def test_a_band_that_leads_from_turn_to_turn_through_what_is_outside_is_outside():
    wide = tl.State("yaw", "rad", scale=3.14, periodic=True, envelope=(-3.0, 3.0))
    low, high = np.array([2.9, 2.9, np.nan, -3.0]), np.array([3.4, 2.95, 0.0, 3.0])
    assert band_outside(wide, low, high).tolist() == [True, False, True, False]
    straight = tl.State("height", "m", scale=1.0, envelope=(-3.0, 3.0))
    assert band_outside(straight, low + TURN, high + TURN).all()
