"""Where flights do the same an error of the law is the same, and a gust is another one."""

import numpy as np
import pytest

from twinloop.campaign.identify_and_plan.causes import SURE, comes_at_moments, foreign
from twinloop.campaign.identify_and_plan.neighbours import alike_nearby

STEPS = 200


def gust(stream, periods):
    share, series = np.exp(-1.0 / periods), [stream.normal()]
    for _ in range(STEPS - 1):
        series.append(share * series[-1] + np.sqrt(1.0 - share * share) * stream.normal())
    return np.array(series)


def flights(disturbing, seed, count=3, apart=0.0):
    """What each does, a decay of its own pace from its own place, and what disturbs it."""
    stream = np.random.default_rng(seed)
    found = []
    for number in range(count):
        times, pace = np.linspace(0.0, 3.0, STEPS), stream.uniform(0.7, 1.4)
        doing = np.stack([np.exp(-pace * times) * np.cos(4.0 * times), -np.exp(-pace * times)], axis=1)
        doing[:, 1] += apart * number
        found.append((doing, disturbing(doing, stream)))
    return found


ERRORS = {
    "drag": lambda doing, _: doing[:, 1] * np.abs(doing[:, 1]) + 0.3,
    "dry friction": lambda doing, _: np.sign(doing[:, 0]),
}


@pytest.mark.parametrize("error", ERRORS.values(), ids=ERRORS)
def test_an_error_of_the_law_is_alike_nearby(error):
    for seed in range(10):
        alike = alike_nearby(flights(error, seed))
        assert alike.product > 0.6 * alike.size and not foreign(alike)


@pytest.mark.parametrize("periods", [2.0, 8.0, 20.0])
def test_a_gust_is_not(periods):
    several = [
        alike_nearby(flights(lambda doing, stream: gust(stream, periods), seed, 4)) for seed in range(40)
    ]
    assert sum(alike.certain(SURE) for alike in several) <= 1
    assert sum(foreign(alike) for alike in several) >= (36 if periods < 10.0 else 28)


def test_flights_that_are_far_apart_tell_nothing():
    alike = alike_nearby(flights(lambda doing, stream: gust(stream, 3.0), 0, apart=50.0))
    assert alike.size == 0.0 and not foreign(alike)
    assert not foreign(alike_nearby([])) and not foreign(alike_nearby(flights(ERRORS["drag"], 0, 1)))


def test_their_units_do_not_matter():
    told = flights(lambda doing, stream: gust(stream, 3.0), 1)
    scaled = [(doing * [1e6, 1e-3], disturbed) for doing, disturbed in told]
    one, other = alike_nearby(told), alike_nearby(scaled)
    np.testing.assert_allclose([other.product, other.size], [one.product, one.size])


def test_impacts_come_at_moments_and_gusts_do_not():
    stream = np.random.default_rng(5)
    calm = [[gust(stream, 5.0) for _ in range(3)] for _ in range(40)]
    assert sum(comes_at_moments(each) for each in calm) <= 2
    impacts = np.zeros(STEPS)
    impacts[[20, 90, 91, 150]] = [3.0, -4.0, -2.0, 3.0]
    assert comes_at_moments([impacts, np.roll(impacts, 13)])
