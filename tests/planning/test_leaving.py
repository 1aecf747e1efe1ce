"""The risk of leaving the envelope in words: where no predicted flight leaves it, no estimate is claimed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinloop.planning.judging import risk
from twinloop.planning.leaving import none_leaves, risk_words, short_risk


def of(leaving, flights):
    return risk(np.where(np.arange(flights) < leaving, 2.0, 0.5))


def test_where_none_leaves_the_words_say_so():
    assert risk_words(of(0, 128), 128) == "less than 0.4 % (none of 128 predicted flights leaves it)"
    assert short_risk(of(0, 128), 128) == "< 0.4 %"
    assert risk_words(of(3, 128), 128) == "2.7 %" == short_risk(of(3, 128), 128)
    assert risk_words(of(128, 128), 128) == "100 %" == short_risk(of(128, 128), 128)
    assert short_risk(None, 128) is None and risk_words(of(0, 128), None) == "0.39 %"


@given(st.integers(1, 600), st.integers(0, 600), st.floats(0.5, 1.0))
def test_none_is_said_of_none_alone_whatever_became_of_the_committee(flights, leaving, left):
    some = max(1, round(left * flights))
    assert none_leaves(of(min(leaving, some), some), flights) == (leaving == 0)


@pytest.mark.parametrize("flights", [1, 2, 3, 4, 8, 16, 24, 128, 1000])
def test_the_bound_that_is_said_is_no_smaller_than_the_risk(flights):
    said = float(risk_words(of(0, flights), flights).split()[2])
    assert 100 * of(0, flights) <= said * (1 + 1e-9)
