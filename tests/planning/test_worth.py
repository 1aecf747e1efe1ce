"""What a flight may cost: the value of information, and no more than a share."""

from dataclasses import replace

import numpy as np
import pytest

from twinloop.planning.settings import PlanningOptions
from twinloop.planning.worth import apart, gain, in_vain, limit

OPTIONS = PlanningOptions(worse=0.05, accuracy=0.01)


def test_the_gain_is_the_expected_value_of_perfect_information():
    """A decision of two actions in two states of the world, by hand."""
    # The better action by itself costs 4 on average; who knew the state would pay 1 in one and 2 in the other.
    assert gain(np.array([[1.0, 5.0, 6.0], [7.0, 3.0, 2.0]])) == pytest.approx(4.0 - 1.5)
    assert gain(np.array([[1.0, 2.0], [3.0, 4.0]])) == 0.0  # both would do the same
    assert gain(np.empty((3, 0))) == 0.0 and gain(np.array([[1.0], [np.inf]])) == 0.0


def test_members_are_apart_by_the_share_in_the_middle():
    assert apart(np.array([[1.0, 2.0, 3.0], [1.0, 4.0, 9.0]])) == pytest.approx(1.0 / 3.0)
    # Where some members see a flight diverge all is unknown, where all do they agree.
    assert apart(np.array([[1.0, np.inf], [1.0, 3.0]])) == pytest.approx(0.5)
    assert apart(np.array([[1.0, np.inf], [1.0, np.inf]])) == 0.0
    assert apart(np.full((2, 3), np.inf)) == 0.0 and apart(np.zeros((2, 3))) == 0.0


@pytest.mark.parametrize(
    ("predicted", "spread", "vain"),
    [
        (1.99, 9.0, False),  # better is promised
        (2.0, 1.0, False),  # half as bad again within one spread
        (2.0, 1.01, True),
        (3.01, 0.0, True),  # it is far worse
        (np.inf, np.inf, True),
    ],
)
def test_a_flight_is_in_vain_that_promises_nothing_better_and_may_be_half_as_bad_again(
    predicted, spread, vain
):
    assert in_vain(predicted, spread, 2.0) == vain
    assert not in_vain(predicted, spread, np.inf)  # nothing better is known


@pytest.mark.parametrize(
    ("promised", "good", "to_task", "unknown", "scatter", "most"),
    [
        (2.0, 9.0, 0.0, 0.0, 0.0, 2.0),  # nothing to be told
        (2.0, 9.0, 0.03, 0.0, 0.0, 2.03),  # to the task
        (2.0, 9.0, 0.0, 0.02, 0.0, 2.02),  # to the twin: as far as it is not as accurate as was asked for
        (2.0, 9.0, 0.0, 0.01, 0.0, 2.0),
        (2.0, 9.0, 5.0, 1.0, 0.0, 2.1),  # never more than the share
        (2.0, 9.0, 0.0, 0.0, 0.04, 2.04),  # what is lost in the scatter
        (2.0, 1.8, 5.0, 1.0, 0.0, 1.89),  # never more than the share above what was flown
        (2.0, np.inf, 5.0, 1.0, 0.0, 2.1),
        (np.inf, 3.0, 0.0, 0.0, 0.0, 3.15),
    ],
)
def test_a_flight_may_cost_what_it_is_worth(promised, good, to_task, unknown, scatter, most):
    assert limit(promised, good, to_task, unknown, scatter, OPTIONS) == pytest.approx(most)


def test_without_a_worth_every_flight_may_cost_the_share():
    free = replace(OPTIONS, worth=False)
    assert limit(2.0, 9.0, 0.0, 0.0, 0.0, free) == pytest.approx(2.1)
    assert limit(2.0, 1.8, 0.0, 0.0, 0.0, free) == pytest.approx(1.89)
