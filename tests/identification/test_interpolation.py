"""States between readings, what integrating through them leaves, and the noise that is looked for beside that."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import twinloop as tl
from twinloop import _core
from twinloop.campaign.presets import options_of
from twinloop.identification.identify import identify_runs
from twinloop.identification.interpolation import integration_error, middles, points, segments
from twinloop.identification.records import Run, guessed_noise, rounding


def through(states, number):
    return middles(states, [slice(0, len(states))], [number] * states.shape[1])


@given(st.sampled_from([4, 6, 8]), st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=4), st.integers(9, 30))
def test_a_polynomial_is_met_in_the_middle_of_every_period(number, coefficients, rows):
    t = np.linspace(-1.0, 1.0, rows)
    states = np.polyval(coefficients, t)[:, None]
    expected = np.polyval(coefficients, 0.5 * (t[1:] + t[:-1]))[:, None]
    np.testing.assert_allclose(through(states, number), expected, atol=1e-12)


def test_more_neighbours_come_nearer_to_what_is_smooth_and_noise_takes_few():
    t = 0.1 * np.arange(100)
    wave = np.sin(t)[:, None]
    middle = np.sin(t[:-1] + 0.05)[:, None]
    errors = [np.abs(through(wave, number) - middle).max() for number in (4, 6, 8)]
    assert errors[1] < 0.1 * errors[0] and errors[2] < 0.1 * errors[1]
    noisy = wave + 1e-3 * np.random.default_rng(0).standard_normal(wave.shape)
    assert points([np.hstack([wave, noisy])]) == [8, 4]


def test_nothing_is_read_across_a_corner():
    commands = np.repeat([[1.0], [-1.0]], 5, axis=0)
    states = np.concatenate([[0.0], np.cumsum(commands[:, 0])])[:, None]
    rows = segments(commands, commands)
    assert rows == [slice(0, 6), slice(5, 11)]
    np.testing.assert_allclose(middles(states, rows, [8]), 0.5 * (states[1:] + states[:-1]), atol=1e-14)
    ever = np.arange(10.0)[:, None]
    assert segments(ever, ever) == [slice(i, i + 2) for i in range(10)]


def test_the_error_of_simpsons_rule_is_known_before_a_law_is():
    dt, t = 0.25, 0.25 * np.arange(40)
    states = np.exp(0.3 * t)[:, None]
    slopes = [0.3 * np.exp(0.3 * (t[:-1] + share * dt)) for share in (0.0, 0.5, 1.0)]
    left = np.abs(np.diff(states[:, 0]) - dt / 6.0 * (slopes[0] + 4.0 * slopes[1] + slopes[2])).max()
    found = np.sqrt(integration_error([states], np.zeros(1)))[0]
    assert found == pytest.approx(left, rel=0.2)
    # Where noise hides it, it is nothing.
    assert integration_error([states], np.ones(1)).tolist() == [0.0]


def test_what_is_smooth_is_not_taken_for_noise():
    t = 0.05 * np.arange(400)[:, None]
    run = Run.of(np.sin(t * [1.0, 2.0]), t[1:])
    assert (np.sqrt(guessed_noise([run], np.ones(2))) < 1e-7).all()


@given(st.integers(-60, 60), st.integers(0, 2**32 - 1))
def test_rounding_is_measured_in_any_unit(power, seed):
    states = np.random.default_rng(seed).standard_normal((50, 2))
    unit = 2.0**power
    one, other = (rounding([Run.of(x, x[1:])], np.ones(2)) for x in (states, unit * states))
    assert (other == unit * unit * one).all()


def test_a_sensor_far_better_than_the_root_of_rounding_is_believed():
    # Of a level that stays, the second reading differs from the first by two errors.
    error, apart, size = 1e-11, 2e-11, 3.0
    record = ([[size], [size + apart]], np.ones((2, 1)), *(np.zeros((1, 1)) for _ in range(3)))
    regression = _core.Regression(1, 0.1, "increment", [record])
    found = regression.likelihood([0.0], [error**2], (1e-40, 0.0, 1.0))
    spread = (size + apart) ** 2
    expected = np.log(spread) + size**2 / spread + np.log(2.0 * error**2) + apart**2 / (2.0 * error**2)
    assert found == pytest.approx(expected, abs=1e-3)


def test_exact_readings_of_prey_and_hunters_give_their_law_and_nothing_else():
    def slope(_, x):
        return [1.2 * x[0] - 0.4 * x[0] * x[1], 0.1 * x[0] * x[1] - 0.8 * x[1]]

    t = np.linspace(0.0, 10.0, 150)
    states = solve_ivp(slope, (0.0, 10.0), [5.0, 2.0], "DOP853", t, rtol=1e-13, atol=1e-13).y.T
    signals = tl.Signals(
        [tl.State("x", "1", 14.0), tl.State("y", "1", 6.0)],
        [tl.Command("idle", "1", (0.0, 1.0))],
        float(t[1]),
    )
    options = {"form": "acceleration", "moves": 2000, "starts": 2, "generations": 0, "committee_size": 3}
    found = identify_runs(
        [Run.of(states, np.zeros((149, 1)))],
        signals,
        options_of("default", options),
        workers=_core.Workers(1),
    )
    both = found.pool.product(0, 1)
    assert [set(sums.weights) for sums in found.sums] == [{0, both}, {1, both}]
    weights = [found.sums[0].weights[0], found.sums[0].weights[both], found.sums[1].weights[1]]
    np.testing.assert_allclose(weights, [1.2, -0.4, -0.8], rtol=1e-5)
