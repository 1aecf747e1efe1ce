"""Leaving the envelope: one true state is enough, of readings it takes two in a row."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinloop._experiment.envelope import gone_from, outside, readings_leave
from twinloop.planning.judging import risk


@given(st.lists(st.floats(0.0, 3.0), max_size=30))
def test_readings_leave_where_two_that_follow_each_other_are_outside(usages):
    expected = any(a > 1.0 and b > 1.0 for a, b in pairwise(usages))
    assert readings_leave(np.array(usages)) == expected


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
