"""What a system does foretells an error of its law in a flight left out, and no gust."""

import numpy as np
import pytest

from twinloop import Command, Signals, State
from twinloop.campaign.identify_and_plan.foretold import features_of, foretold

SIGNALS = Signals(
    [State("angle", "rad", 2.0, periodic=True), State("rate", "rad/s", 4.0)],
    [Command("torque", "N m", (-2.0, 2.0))],
    0.02,
)
STEPS = 300


def flight(stream):
    """A swing of its own: states (STEPS + 1, 2) and commands (STEPS, 1)."""
    times = 0.02 * np.arange(STEPS + 1)
    faster, wider = stream.uniform(0.8, 1.3), stream.uniform(0.5, 1.0)
    angle = wider * np.sin(faster * times) * np.exp(-0.2 * times)
    return np.stack([angle, np.gradient(angle, times)], axis=1), np.cos(2.0 * faster * times[:-1, np.newaxis])


def gust(stream, periods=15.0):
    share, series = np.exp(-1.0 / periods), [stream.normal()]
    for _ in range(STEPS - 1):
        series.append(share * series[-1] + np.sqrt(1.0 - share * share) * stream.normal())
    return np.array(series)


def held_against(disturbing, seed, flights=4):
    stream = np.random.default_rng(seed)
    flown = [flight(stream) for _ in range(flights)]
    return foretold([(features_of(*each, SIGNALS), disturbing(*each, stream)) for each in flown])


ERRORS = {
    "a drag that is missing": lambda x, u, _: -x[:-1, 1] * np.abs(x[:-1, 1]),
    "a gravity that is missing": lambda x, u, _: np.sin(x[:-1, 0]),
    "a command that arrives late": lambda x, u, _: (
        np.concatenate([np.full((5, 1), u[0]), u[:-5]])[:, 0] - u[:, 0]
    ),
}


@pytest.mark.parametrize("error", ERRORS.values(), ids=ERRORS)
def test_an_error_of_the_law_is_foretold_beside_noise(error):
    def disturbed(x, u, stream):
        wrong = error(x, u, stream)
        return wrong / wrong.std() + stream.normal(size=STEPS)

    assert all(held_against(disturbed, seed).certain(3.0) for seed in range(5))


@pytest.mark.parametrize("periods", [0.01, 15.0, 60.0])
def test_a_gust_is_not(periods):
    found = [held_against(lambda x, u, stream: gust(stream, periods), seed) for seed in range(40)]
    assert sum(each.beyond_luck(3.0) for each in found) <= 1
    assert not any(each.certain(3.0) for each in found)


def test_one_flight_foretells_nothing():
    assert not held_against(ERRORS["a gravity that is missing"], 0, flights=1).beyond_luck(0.0)


def test_features_are_of_states_that_wrap_as_of_others_and_of_what_was():
    states, commands = flight(np.random.default_rng(0))
    features = features_of(states, commands, SIGNALS)
    turned = features_of(states + np.array([2.0 * np.pi, 0.0]), commands, SIGNALS)
    np.testing.assert_allclose(turned, features, atol=1e-12)
    expected = [np.ones(STEPS), np.sin(states[:-1, 0]), np.cos(states[:-1, 0]), states[:-1, 1] / 4.0]
    np.testing.assert_allclose(features[:, :4], np.stack(expected, axis=1), atol=1e-12)
    # The last is the command through a lag of three tenths of the flight, from its first value on.
    now, share = commands[0, 0] / 2.0, np.exp(-1.0 / 90.0)
    for k in range(STEPS):
        now = share * now + (1.0 - share) * commands[k, 0] / 2.0
        assert features[k, -1] == pytest.approx(now, abs=1e-12)
