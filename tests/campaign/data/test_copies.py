"""Copies of a flight are found by their noise; two flights, and those of an exact simulator, are none."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from conftest import PENDULUM_SIGNALS
from logged_flights import anywhere, asked_at, flown
from twinloop.campaign.data.copies import copied

gentle = st.floats(0.1, 0.4)
NOISES = st.sampled_from([1e-3, 1e-2])


def beginning(run, steps):
    """Its first steps."""
    return tl.Trajectory(run.t[: steps + 1], run.states[: steps + 1], run.commands[:steps])


def saved_again(run, how):
    """What a spreadsheet, or a device in single precision, makes of a log."""
    return dataclasses.replace(run, states=how(run.states), commands=how(run.commands))


@given(
    place=anywhere["place"], seed=anywhere["seed"], noise=NOISES, quiet=st.booleans(), steps=st.integers(30, 40),
    how=st.sampled_from([
        lambda x: x, lambda x: np.float32(x).astype(float), lambda x: np.round(x, 6), lambda x: np.round(x, 4),
    ]),
)  # fmt: skip
def test_a_flight_that_was_saved_again_is_a_copy_and_so_is_its_beginning(
    place, seed, noise, quiet, steps, how
):
    run = flown(asked_at(place, quiet), noise, seed)
    copy = saved_again(run, how)
    for again in (copy, beginning(copy, steps)):
        assert copied(again, run, PENDULUM_SIGNALS) and copied(run, again, PENDULUM_SIGNALS)


@given(place=anywhere["place"], seed=anywhere["seed"], noise=NOISES)
def test_a_second_flight_of_the_same_test_is_no_copy(place, seed, noise):
    test = asked_at(place, quiet=True)
    assert not copied(flown(test, noise, seed), flown(test, noise, seed + 100), PENDULUM_SIGNALS)


@given(place=st.tuples(gentle, gentle, gentle), digits=st.integers(2, 6))
def test_what_an_exact_simulator_flies_again_is_no_copy_of_its_first_flight(place, digits):
    one = flown(asked_at(place, quiet=True), noise=0.0)
    assert not copied(one, one, PENDULUM_SIGNALS)
    # A log with few digits scatters by its rounding alone.
    assert not copied(saved_again(one, lambda x: np.round(x, digits)), one, PENDULUM_SIGNALS)


@given(place=anywhere["place"], seed=anywhere["seed"], column=st.sampled_from([0, 1]), noise=NOISES)
def test_a_column_that_a_historian_has_rounded_hides_no_copy_and_makes_none(place, seed, column, noise):
    def coarse(readings):
        rounded = readings.copy()
        if rounded.shape[1] > 1:
            rounded[:, column] = 2.0 * noise * np.round(rounded[:, column] / (2.0 * noise))
        return rounded

    test = asked_at(place, quiet=True)
    run = flown(test, noise, seed)
    for one, other in ((saved_again(run, coarse), run), (run, saved_again(run, coarse))):
        assert copied(one, other, PENDULUM_SIGNALS)
    assert not copied(saved_again(flown(test, noise, seed + 100), coarse), run, PENDULUM_SIGNALS)


@pytest.mark.parametrize("steps", [3, 19])
def test_of_so_few_steps_nobody_can_say(steps):
    run = flown(asked_at((0.5, 0.5, 0.5), quiet=True), 1e-2, 0)
    few = beginning(run, steps)
    assert not copied(few, few, PENDULUM_SIGNALS)
