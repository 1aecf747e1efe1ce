"""An angle that jumps by a whole turn is said to wrap, if it was not declared to; one that truly turns is not."""

import numpy as np
import pytest

import twinloop as tl
from twinloop.campaign.data.wrapped import jumps, without_turns
from twinloop.campaign.examination.log_check import check_log

TURN = {"rad": 2.0 * np.pi, "deg": 360.0}
STEPS = 300


def signals(unit="rad", rate=False, periodic=False):
    states = [tl.State("yaw", unit, TURN[unit] / 2.0, periodic=periodic)]
    if rate:
        states.append(tl.State("r", f"{unit}/s", TURN[unit], derivative_of="yaw"))
    return tl.Signals(states, [tl.Command("u", "1", (-1.0, 1.0))], 0.02)


def spun(speed, unit="rad", rate=False, noise=1e-3):
    """A swinging angle that drifts by `speed` turns in each period, with its rate."""
    time = np.arange(STEPS + 1)
    angle = 0.4 + speed * time + 0.1 * np.sin(time / 20.0)
    columns = [angle, (speed + 0.005 * np.cos(time / 20.0)) / 0.02][: 1 + rate]
    states = np.stack(columns, axis=1) + noise * np.random.default_rng(3).normal(size=(STEPS + 1, 1 + rate))
    return TURN[unit] * states


def wrapped(states, unit="rad"):
    turn = TURN[unit]
    return np.column_stack([states[:, 0] - turn * np.rint(states[:, 0] / turn), states[:, 1:]])


def checked(states, of):
    commands = np.random.default_rng(0).uniform(-1.0, 1.0, size=(STEPS, 1))
    return check_log(0.02 * np.arange(STEPS + 1), states, commands, of)


@pytest.mark.parametrize("rate", [False, True])
@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_a_wrapped_angle_is_named_with_its_row_and_what_to_declare(unit, rate):
    states = wrapped(spun(0.02, unit, rate), unit)
    row = int(np.argmax(np.abs(np.diff(states[:, 0])) > 0.5 * TURN[unit])) + 1
    found = checked(states, signals(unit, rate))
    (remark,) = [each for each in found.remarks if each.serious]
    assert remark.code == "wraps" and f"yaw jumps by a whole turn at row {row}, {0.02 * row:g} s" in str(
        remark
    )
    assert f"periodic = {'true' if unit == 'rad' else '360.0'} under [states.yaw]" in str(remark)
    declared = signals(unit, rate, periodic=True if unit == "rad" else 360.0)
    assert checked(states, declared).fit


@pytest.mark.parametrize("rate", [False, True])
@pytest.mark.parametrize("speed", [0.0, 0.02, 0.2, 0.3, 0.45, 0.55, 0.8, 0.95, 1.0, 1.05, 1.5, 2.0])
def test_what_truly_turns_is_not_said_to_wrap_however_fast(speed, rate):
    assert not jumps(spun(speed, rate=rate), 0, signals(rate=rate))


@pytest.mark.parametrize("speed", [0.0, 0.02, 0.1, 0.2])
def test_each_jump_is_found_and_taken_away(speed):
    states = spun(speed)
    run = tl.Trajectory(0.02 * np.arange(STEPS + 1), wrapped(states), np.zeros((STEPS, 1)))
    (whole,), _ = without_turns([run], signals(), lambda run, row: "")
    np.testing.assert_allclose(np.diff(whole.states[:, 0]), np.diff(states[:, 0]), atol=1e-9)


def test_a_yaw_that_hovers_about_south_jumps_to_and_fro():
    south = np.full(STEPS + 1, np.pi) + 0.01 * np.random.default_rng(0).normal(size=STEPS + 1)
    states = wrapped(south[:, np.newaxis])
    assert len(jumps(states, 0, signals())) == (np.abs(np.diff(states[:, 0])) > np.pi).sum() > 50


def test_a_whole_turn_that_the_rate_confirms_is_a_motion():
    states = spun(0.0, rate=True)
    states[100:, 0] += TURN["rad"]
    assert jumps(states, 0, signals(rate=True)) == [
        100
    ]  # by a whole turn in a period, and the rate says nothing
    states[99:101, 1] = TURN["rad"] / 0.02
    assert not jumps(states, 0, signals(rate=True))


def test_the_angles_of_a_body_are_held_against_its_rates():
    names = ("roll", "pitch", "yaw", "p", "q", "r")
    states = [tl.State(name, "rad", 3.0) for name in names[:3]] + [
        tl.State(name, "rad/s", 5.0) for name in names[3:]
    ]
    body = tl.Signals(
        states, [tl.Command("u", "1", (-1.0, 1.0))], 0.02, kinematics=tl.RigidBody(names[:3], names[3:])
    )
    time = 0.02 * np.arange(STEPS + 1)
    yaw = 2.9 + 0.5 * np.sin(time)
    still = 1e-3 * np.random.default_rng(1).normal(size=(STEPS + 1, 6))
    flight = still + np.column_stack(
        [0.0 * time, 0.0 * time, yaw, 0.0 * time, 0.0 * time, 0.5 * np.cos(time)]
    )
    assert not jumps(flight, 2, body)
    flight[:, 2] = np.angle(np.exp(1j * flight[:, 2]))
    (remark,) = [each for each in checked(flight, body).remarks if each.serious]
    assert remark.code == "wraps" and str(remark).startswith("yaw jumps")
