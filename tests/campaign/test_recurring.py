"""What comes again in flight after flight is an error of the law; what gusts do is none."""

import numpy as np
import pytest

from twinloop.campaign.identify_and_plan.recurring import recurs

STEPS = 300


def gusts(seed, correlation_time, steps=STEPS):
    """A Gauss-Markov process of variance 1."""
    random, kept = np.random.default_rng(seed), np.exp(-1.0 / correlation_time)
    series = [random.standard_normal()]
    for _ in range(steps - 1):
        series.append(kept * series[-1] + np.sqrt(1.0 - kept * kept) * random.standard_normal())
    return np.array(series)


def rubbing(stroke=40):
    """Friction of a motor that moves to and fro, then rests."""
    times = np.arange(STEPS)
    return np.where(times < 200, np.where(times // stroke % 2 == 0, 1.0, -1.0), 0.0)


@pytest.mark.parametrize("correlation_time", [3.0, 20.0, 75.0])
def test_gusts_do_not_know_when_a_flight_begins(correlation_time):
    falsely = sum(
        recurs([[gusts(100 * trial + flight, correlation_time) for flight in range(4)]])
        for trial in range(60)
    )
    assert falsely <= 1


def test_an_error_of_the_law_comes_again_in_every_flight():
    noisy = [rubbing() + 0.5 * gusts(flight, 5.0) for flight in range(3)]
    assert recurs([noisy])
    assert recurs([[3.0 * rubbing(), 5.0 * rubbing(41)[: STEPS // 2], rubbing(39)]])


def test_flights_of_different_tasks_are_not_compared():
    one, other = rubbing(), -rubbing()
    assert not recurs([[one], [one]])
    assert recurs([[one, one, one], [other, other, other]]) and not recurs([[one, one, other, other]])


def test_a_trace_of_it_is_not_enough():
    """With many flights a share of a tenth is certain, and still a small part of what disturbs."""
    flights = [0.3 * rubbing() + gusts(flight, 3.0) for flight in range(12)]
    assert not recurs([flights])


def test_many_readings_are_taken_in_pieces():
    long = np.repeat(rubbing(), 40)
    assert recurs([[long, 2.0 * long, long]]) and not recurs(
        [[gusts(1, 900.0, 12000), gusts(2, 900.0, 12000)]]
    )
