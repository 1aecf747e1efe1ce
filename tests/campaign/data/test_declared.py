"""Declared derivatives and body rates, held against records."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import twinloop as tl
from twinloop.campaign.data.declared import against_derivatives

DT, STEPS, NOISE = 0.01, 300, 2e-3
ANGLES, RATES = ("roll", "pitch", "yaw"), ("p", "q", "r")


def signals(order=(0, 1, 2), unit="rad", declared=True):
    """Angles and rates in some order of the columns."""
    states = [tl.State(ANGLES[k], unit, 1.0) for k in order]
    states += [
        tl.State(RATES[k], f"{unit}/s", 1.0, derivative_of=ANGLES[k] if declared else None) for k in order
    ]
    return tl.Signals(states, [tl.Command("u", "1", (-1.0, 1.0))], DT)


def flight(size, body, order=(0, 1, 2), seed=0):
    """Angles that swing by `size` rad, with body rates by SciPy's rotations, or with their derivatives."""
    random = np.random.default_rng(seed)
    t = DT * np.arange(STEPS + 1)

    def angles(t):
        phases = [0.3, 1.1, 2.0]
        return np.stack([size * np.sin((2.0 + k) * t + phase) for k, phase in enumerate(phases)], axis=1)

    if body:
        ahead, behind = (Rotation.from_euler("ZYX", angles(t + half)[:, ::-1]) for half in (5e-6, -5e-6))
        rates = (behind.inv() * ahead).as_rotvec() / 1e-5
    else:
        rates = (angles(t + 5e-6) - angles(t - 5e-6)) / 1e-5
    columns = [*order, *(3 + k for k in order)]
    states = np.concatenate([angles(t), rates], axis=1)[:, columns]
    states = states + NOISE * random.normal(size=states.shape)
    return tl.Trajectory(t, states, np.zeros((STEPS, 1)))


def said(recorded, known):
    return list(against_derivatives([recorded], known))


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 0, 2)])
@pytest.mark.parametrize("seed", range(3))
def test_body_rates_declared_as_derivatives_are_called_so_and_which_angle_is_which(order, seed):
    (remark,) = said(flight(0.6, True, order, seed), signals(order))
    assert remark.code == "body-rates" and remark.serious
    assert f"RigidBody(angles={ANGLES}, rates={RATES})" in str(remark)
    assert '[kinematics] with angles = ["roll", "pitch", "yaw"] and rates = ["p", "q", "r"]' in str(remark)
    assert "Remove derivative_of" in str(remark) and "begin a new one" in str(remark)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_and_small_angles_are_as_declared(seed):
    assert not said(flight(0.6, False, seed=seed), signals())
    assert not said(flight(0.02, True, seed=seed), signals())


def test_nothing_is_said_where_nothing_was_declared_and_other_units_stay_derivatives():
    assert not said(flight(0.6, True), signals(declared=False))
    assert "body-rates" not in [remark.code for remark in said(flight(0.6, True), signals(unit="deg"))]


def test_a_wrong_sign_is_no_body():
    recorded = flight(0.6, True)
    states = recorded.states.copy()
    states[:, 4] *= -1.0
    turned = tl.Trajectory(recorded.t, states, recorded.commands)
    assert [remark.code for remark in said(turned, signals())] and "body-rates" not in [
        remark.code for remark in said(turned, signals())
    ]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_angle_that_wraps_is_followed_round_and_a_wrong_sign_is_seen_all_the_same(sign):
    t = 0.05 * np.arange(201)
    angle, rate = 3.0 * t + np.sin(2.0 * t), 3.0 + 2.0 * np.cos(2.0 * t)
    known = tl.Signals(
        [tl.State("angle", "rad", 3.0, periodic=True), tl.State("rate", "rad/s", 8.0, derivative_of="angle")],
        [tl.Command("u", "1", (-1.0, 1.0))], 0.05,
    )  # fmt: skip
    states = np.stack([np.angle(np.exp(1j * angle)), sign * rate], axis=1)
    found = said(tl.Trajectory(t, states, np.zeros((200, 1))), known)
    assert [remark.code for remark in found] == ([] if sign > 0.0 else ["derivative"])


@pytest.mark.parametrize(("dead", "value"), [("p", 0.7), ("p", 0.0), ("roll", 0.3)])
def test_a_sensor_that_gives_one_number_contradicts_what_moves(dead, value):
    column = signals().state_names.index(dead)
    recorded = [flight(0.6, False, seed=seed) for seed in range(2)]
    for run in recorded:
        states = run.states.copy()
        states[:, column] = value
        run.__dict__["states"] = states
    assert [remark.code for remark in against_derivatives(recorded, signals())] == ["derivative"]


def test_what_turns_evenly_or_hardly_moves_contradicts_no_constant_rate():
    heading = tl.Signals(
        [tl.State("a", "rad", 1.0, periodic=True), tl.State("w", "rad/s", 1.0, derivative_of="a")],
        [tl.Command("u", "1", (-1.0, 1.0))],
        DT,
    )
    t = DT * np.arange(STEPS + 1)
    even = np.column_stack([(7.0 * t + np.pi) % (2.0 * np.pi) - np.pi, np.full(STEPS + 1, 7.0)])
    rest = np.column_stack([1e-3 * np.sin(t), np.zeros(STEPS + 1)])
    for states in (even, rest, np.zeros((STEPS + 1, 2))):
        assert not said(tl.Trajectory(t, states, np.zeros((STEPS, 1))), heading)
