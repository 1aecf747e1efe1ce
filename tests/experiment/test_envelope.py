"""Leaving the envelope: one true state is enough, of readings it takes two in a row."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinloop._experiment.envelope import outside, readings_leave
from twinloop.planning.judging import risk


@given(st.lists(st.floats(0.0, 3.0), max_size=30))
def test_readings_leave_where_two_that_follow_each_other_are_outside(usages):
    expected = any(a > 1.0 and b > 1.0 for a, b in pairwise(usages))
    assert readings_leave(np.array(usages)) == expected


def test_a_single_true_state_is_outside_a_bound_is_not():
    assert outside(np.array([[1.0, 1.0 + 1e-12], [np.inf, 0.0]])).tolist() == [[False, True], [True, False]]
    assert risk(np.array([1.0, 1.0, 2.0])) == pytest.approx(1.5 / 4.0)
