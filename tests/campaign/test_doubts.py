"""What is said against data: units and signs that contradict what was declared, copies, runs that were cut."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from twinloop.campaign.identify_and_plan.diagnostics import distinct, doubts

DT, STEPS = 0.02, 200
SIGNALS = tl.Signals(
    [
        tl.State("height", "m", scale=2.0),
        tl.State("angle", "rad", scale=1.0),
        tl.State("rate", "rad/s", scale=5.0, derivative_of="angle"),
    ],
    [tl.Command("torque", "N m", bounds=(-1.0, 1.0))],
    dt=DT,
)


def flown(seed=0, size=0.5, noise=0.003, change=lambda x: x, cut=False):
    """A record of an angle that swings, with its rate, both read with noise."""
    stream, t = np.random.default_rng(seed), DT * np.arange(STEPS + 1)
    angle = size * np.sin(3.0 * t + 0.3 * seed) + 0.2 * size * np.cos(7.0 * t)
    rate = size * 3.0 * np.cos(3.0 * t + 0.3 * seed) - 1.4 * size * np.sin(7.0 * t)
    states = np.column_stack([0.1 * t, angle, rate]) + noise * stream.normal(size=(STEPS + 1, 3))
    trajectory = tl.Trajectory(t, change(states), np.zeros((STEPS, 1)))
    return SimpleNamespace(trajectory=trajectory, complete=not cut)


def said(*runs, follows=True):
    return [remark.sentence for remark in doubts(runs, SIGNALS, follows, STEPS)]


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.1])
def test_nothing_is_said_of_states_that_do_as_declared(noise):
    assert said(flown(noise=noise), flown(1, noise=noise)) == []


def test_nothing_is_said_of_a_state_that_does_not_move():
    assert said(flown(size=0.0), flown(1, size=0.0)) == []


def test_a_biased_rate_is_no_other_unit():
    assert said(flown(change=lambda x: x + np.array([0.0, 0.0, 0.1]))) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x: x * [1.0, 180.0 / np.pi, 1.0], r"angle changes 57\.\d times as fast as rate"),
        (lambda x: x * [1.0, 1.0, 180.0 / np.pi], r"angle changes 0\.017\d times as fast as rate"),
        (lambda x: x * [1.0, -1.0, 1.0], r"angle changes -(1|1\.0\d|0\.9\d*) times as fast as rate"),
        (lambda x: x[:, [0, 2, 1]], "angle does not change as rate|angle changes"),
        (lambda x: x[:, [1, 0, 2]], "angle does not change as rate|angle changes"),
    ],
    ids=["angle in degrees", "rate in degrees", "sign", "exchanged", "another column"],
)
def test_a_state_that_contradicts_its_declared_derivative_is_named(change, words):
    (sentence,) = said(flown(change=change), flown(1, change=change))
    assert re.search(words, sentence) and "check their units" in sentence


def test_copies_of_a_record_count_once_and_are_told():
    first, second = flown(), flown(1)
    assert distinct([first, second, flown(), second]) == [first, second]
    (sentence,) = said(first, second, flown(), second)
    assert sentence.startswith("2 of 4 records equal an earlier one")


def test_runs_that_were_all_cut_and_a_twin_that_does_not_follow_are_told():
    assert "No run was complete" in said(flown(cut=True))[0]
    assert said(flown(cut=True), flown(1)) == []
    assert "does not follow" in said(flown(), follows=False)[0]
