"""Where a record without a controller begins for a model whose rates are computed of readings."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import twinloop as tl
from law_twins import SWINGING, model_of
from oracles import same_bits
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop.law.beginning import FIRST, start_of, states_read
from twinloop.law.flight import fly
from twinloop.law.reports import Computed, slopes_of, with_reports

SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 3.0), tl.State("rate", "rad/s", 8.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-2.0, 2.0))],
    0.05,
)
LIMITS = Limits(SIGNALS)
PLAIN = model_of(SWINGING, signals=SIGNALS, inputs=3)
MODEL = with_reports(PLAIN, (None, Computed(0, 0.0, 1.0 / SIGNALS.dt)))
START = np.array([0.4, -1.7])


def record(noise=0.0, steps=60, start=START):
    """What is read of a swing: the angle, and the change of its readings."""
    stream = np.random.default_rng(3)
    commands = np.repeat(stream.uniform(-2.0, 2.0, (steps // 4, 1)), 4, axis=0)
    read = fly(PLAIN, Replay(SIGNALS, start, commands), limits=LIMITS).states.copy()
    read[:, 0] += noise * stream.standard_normal(len(read))
    read[1:, 1] = np.diff(read[:, 0]) / SIGNALS.dt
    read[0, 1] = read[1, 1]
    return read, commands


def test_without_noise_it_begins_where_it_did():
    read, commands = record()
    assert abs(read[0, 1] - START[1]) > 0.05
    np.testing.assert_allclose(start_of(MODEL, read, commands, LIMITS), START, atol=1e-6)


def test_in_noise_the_first_readings_are_followed_as_closely_as_any_rate_follows_them():
    read, commands = record(noise=5e-3)

    def missed(rate):
        states = fly(
            PLAIN, Replay(SIGNALS, np.array([read[0, 0], rate[0]]), commands[:FIRST]), limits=LIMITS
        ).states
        return states[1:, 0] - read[1 : FIRST + 1, 0]

    found = start_of(MODEL, read, commands, LIMITS)
    assert found[0] == read[0, 0]
    assert found[1] == pytest.approx(least_squares(missed, [0.0]).x[0], abs=1e-6)


def read_of_all(noise, seed=0, steps=60, start=START):
    """True states of a swing, and readings of both with noise, in shares of their scales."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-2.0, 2.0, (steps // 4, 1)), 4, axis=0)
    true = fly(PLAIN, Replay(SIGNALS, start, commands), limits=LIMITS).states
    return true, true + noise * np.array([3.0, 8.0]) * stream.standard_normal(true.shape), commands


def test_within_a_record_what_is_read_is_taken_as_it_is():
    read, _ = record(noise=5e-3)
    assert same_bits(states_read(PLAIN, read, SIGNALS), read)


def test_without_noise_what_is_read_is_where_it_begins():
    _, read, commands = read_of_all(0.0)
    np.testing.assert_allclose(start_of(PLAIN, read, commands, LIMITS), START, atol=1e-9)


def test_it_begins_where_the_first_readings_are_the_likeliest():
    """Beside least squares of scipy, with the noise by third differences."""
    _, read, commands = read_of_all(0.01)
    noise = np.sqrt(np.median(np.diff(read, n=3, axis=0) ** 2, axis=0) / (0.4549 * 20.0))

    def missed(start):
        states = fly(PLAIN, Replay(SIGNALS, start, commands[:FIRST]), limits=LIMITS).states
        return ((states - read[: FIRST + 1]) / noise).ravel()

    found = start_of(PLAIN, read, commands, LIMITS)
    np.testing.assert_allclose(found, least_squares(missed, read[0], xtol=1e-12, ftol=1e-12).x, atol=1e-4)


def test_it_begins_nearer_to_the_truth_than_the_first_reading():
    off = []
    for seed in range(40):
        true, read, commands = read_of_all(0.02, seed)
        found = start_of(PLAIN, read, commands, LIMITS)
        off.append(np.abs([found - true[0], read[0] - true[0]]) / np.array([3.0, 8.0]))
    nearer = np.sqrt(np.square(off).mean(axis=0))
    assert (nearer[0] < 0.7 * nearer[1]).all()


def test_it_begins_no_further_from_the_first_reading_than_noise_explains():
    """Readings of another system, which the model would follow better from elsewhere."""
    _, read, commands = read_of_all(0.01)
    bent = read + np.array([0.3, 0.0]) * np.linspace(0.0, 1.0, len(read))[:, None] ** 0.3
    noise = np.sqrt(np.median(np.diff(bent, n=3, axis=0) ** 2, axis=0) / (0.4549 * 20.0))
    off = np.abs(start_of(PLAIN, bent, commands, LIMITS) - bent[0])
    assert (off <= 3.0 * noise * (1.0 + 1e-9)).all() and (off >= 2.9 * noise).any()


def test_where_the_model_diverges_from_its_readings_it_begins_as_it_was_read():
    far = np.full((30, 2), 1e3)
    assert same_bits(start_of(PLAIN, far, np.zeros((29, 1)), LIMITS), far[0])


def test_within_a_record_a_computed_rate_is_the_slope_of_what_it_is_computed_of():
    read, commands = record(noise=1e-3)
    true = fly(PLAIN, Replay(SIGNALS, START, commands), limits=LIMITS).states
    states = states_read(MODEL, read, SIGNALS)
    assert same_bits(states[:, 0], read[:, 0])
    off, late = (np.abs(rates[5:-5] - true[5:-5, 1]).mean() for rates in (states[:, 1], read[:, 1]))
    assert off < 0.5 * late


def test_where_no_rate_keeps_the_model_from_diverging_the_slope_stays():
    read, commands = record()
    # Twice the divergence factor times its scale.
    far = read + np.array([30.0 * SIGNALS.states[0].scale, 0.0])
    assert np.isfinite(start_of(MODEL, far, commands, LIMITS)).all()


def test_a_record_without_a_period_begins_as_it_was_read():
    read, commands = record()
    assert same_bits(start_of(MODEL, read[:1], commands[:0], LIMITS), read[0])


def test_slopes_of_an_angle_that_wraps_know_no_jumps():
    wrapping = tl.Signals(
        [tl.State("angle", "rad", 3.0, periodic=True), *SIGNALS.states[1:]], SIGNALS.commands, SIGNALS.dt
    )
    turns = np.column_stack([0.3 * np.arange(30.0), np.zeros(30)])
    jumping = turns - 2.0 * np.pi * np.round(turns / (2.0 * np.pi))
    np.testing.assert_allclose(slopes_of(jumping, (None, Computed(0, 0.0, 20.0)), wrapping)[1], 6.0)
