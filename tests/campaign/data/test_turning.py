"""A declared rigid body, held against records: SciPy's rotations turn it under gusts."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import twinloop as tl
from twinloop.campaign.data.declared import against_derivatives
from twinloop.campaign.examination.log_check import check_log

ANGLES, RATES = ("roll", "pitch", "yaw"), ("p", "q", "r")
WITHIN = 3


def signals(dt, unit="rad"):
    states = [tl.State(name, unit, 1.0) for name in ANGLES]
    states += [tl.State(name, f"{unit}/s", 3.0) for name in RATES]
    return tl.Signals(states, [tl.Command("u", "1", (-1.0, 1.0))], dt, kinematics=tl.RigidBody(ANGLES, RATES))


def flight(seed, size=1.0, dt=0.01, steps=300, noise=2e-3, bias=0.0, level=True):
    """Angles and body rates (steps + 1, 6) under gusts of `size` rad/s; `level` brings it back."""
    random = np.random.default_rng(seed)
    step, fade = dt / WITHIN, 0.3
    attitude, rates, rows = Rotation.from_euler("ZYX", [0.5 * random.normal(), 0.1, -0.1]), np.zeros(3), []
    for i in range(steps * WITHIN + 1):
        angles = attitude.as_euler("ZYX")[::-1]
        if i % WITHIN == 0:
            rows.append([*angles, *rates])
        back = np.array([8.0 * np.sin(angles[0]), 8.0 * angles[1], np.sin(angles[2])]) if level else 0.0
        gust = size * np.sqrt(2.0 * step / fade) * random.normal(size=3)
        rates = rates * (1.0 - step / fade) + gust - step * back
        attitude = attitude * Rotation.from_rotvec(step * rates)
    states = np.array(rows) + noise * random.normal(size=(steps + 1, 6))
    states[:, 3:] += bias * random.normal(size=3)
    return states


def said(states, dt=0.01):
    run = tl.Trajectory(dt * np.arange(len(states)), states, np.zeros((len(states) - 1, 1)))
    return list(against_derivatives([run], signals(dt)))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "how",
    [
        {"size": 0.1},
        {"size": 1.0},
        {"size": 1.0, "noise": 1e-5, "bias": 0.02},
        {"size": 4.0, "level": False},
        {"size": 4.0, "level": False, "dt": 0.05, "noise": 0.02},
    ],
)
def test_nothing_is_said_of_a_body_that_turns_as_declared_however_it_tumbles(seed, how):
    assert not said(flight(seed, **how), how.get("dt", 0.01))


def negated(place):
    return lambda states: states * np.where(np.arange(6) == place, -1.0, 1.0)


def swapped(one, other):
    order = [other if k == one else one if k == other else k for k in range(6)]
    return lambda states: states[:, order]


MISTAKES = {
    "p negated": (negated(3), "mainly p", "with the sign of p changed"),
    "q negated": (negated(4), "mainly q", "with the sign of q changed"),
    "yaw negated": (negated(2), "mainly r", "with the sign of yaw changed"),
    "p and q exchanged": (swapped(3, 4), "mainly p", "with p and q exchanged"),
    "angles 57 times too small": (
        lambda states: states / np.array([57.3] * 3 + [1.0] * 3),
        "roll changes 0.0",
        "with roll, pitch, yaw multiplied by 57.3",
    ),
    "rates in degrees": (
        lambda states: states * np.array([1.0] * 3 + [57.3] * 3),
        "roll changes 0.0",
        "with p, q, r divided by 57.3",
    ),
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_columns_is_named_with_what_would_make_them_agree(mistake, seed):
    change, found, cure = MISTAKES[mistake]
    (remark,) = said(change(flight(seed)))
    assert remark.code == "kinematics" and remark.serious
    assert found in str(remark) and cure in str(remark)


def test_a_yaw_that_wraps_and_a_pitch_over_the_vertical_are_no_mistake():
    steps, dt = 400, 0.01
    rates = np.stack([0.3 + 0.0 * np.arange(steps + 1), 3.0 * np.ones(steps + 1), np.ones(steps + 1)], axis=1)
    attitude, rows = Rotation.from_euler("ZYX", [3.0, 0.1, 0.2]), []
    for rate in rates:
        rows.append([*attitude.as_euler("ZYX")[::-1], *rate])
        attitude = attitude * Rotation.from_rotvec(dt * rate)
    states = np.array(rows)
    assert np.abs(np.diff(states[:, 2])).max() > 3.0  # it jumps
    assert not said(states + 1e-3 * np.random.default_rng(0).normal(size=states.shape))


def test_a_log_check_says_it():
    states = negated(4)(flight(0))
    times = 0.01 * np.arange(len(states))
    found = check_log(
        times, states, np.random.default_rng(0).normal(size=(len(states) - 1, 1)), signals(0.01)
    )
    assert "kinematics" in [remark.code for remark in found.remarks] and not found.fit


def drifting(seed, dt=0.01, steps=3000, wander=0.06):
    """Half a minute of level flight whose gyroscopes' bias wanders, as measured ones do: it adds up to a radian."""
    states = flight(seed, size=0.3, dt=dt, steps=steps)
    wanders = np.cumsum(np.random.default_rng(seed).normal(size=(steps + 1, 3)), axis=0) / np.sqrt(steps)
    return states + np.pad(wander * wanders, ((0, 0), (3, 0)))


@pytest.mark.parametrize("seed", range(4))
def test_a_bias_that_drifts_over_a_long_flight_is_no_mistake_and_hides_none(seed):
    states = drifting(seed)
    rates = states[:, 3:] - states[:, 3:].mean(axis=0)
    # Integrated it is as far as the angles go, or further.
    off = 0.01 * np.cumsum(rates, axis=0) - (states[:, :3] - states[:, :3].mean(axis=0))
    assert (np.ptp(off, axis=0) > 0.5 * np.ptp(states[:, :3], axis=0)).any()
    assert not said(states)
    for place in (3, 4, 5):
        (remark,) = said(negated(place)(states))
        assert f"with the sign of {RATES[place - 3]} changed" in str(remark)
