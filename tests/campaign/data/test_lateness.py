"""A sensor that is late beside that of its derivative: in ms where a log shows it, and else nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from twinloop.campaign.data import lateness as room

DT = 0.05
TIMES = DT * np.arange(200)


def angle(t):
    return np.sin(2.0 * t) + 0.3 * np.sin(5.1 * t + 1.0)


def rate(t):
    return 2.0 * np.cos(2.0 * t) + 1.53 * np.cos(5.1 * t + 1.0)


def lateness(angles, rates, dt):
    return room.lateness(angles[:, None], rates[:, None], dt)


def noisy(values, size, seed):
    return values + size * np.random.default_rng(seed).standard_normal(len(values))


@given(st.floats(0.7, 6.0), st.sampled_from([-1.0, 1.0]), st.integers(0, 50))
def test_it_is_found_to_a_tenth_of_a_period_in_spite_of_noise_and_a_biased_rate(periods, sign, seed):
    late = sign * periods * DT
    found = lateness(noisy(angle(TIMES - late), 1e-3, seed), noisy(rate(TIMES), 5e-3, seed + 100) + 0.05, DT)
    assert found == pytest.approx(late, abs=0.1 * DT)


@given(st.integers(0, 200), st.sampled_from([0.0, 1e-3, 1e-2, 0.1]))
def test_nothing_is_said_where_nothing_is_late(seed, noise):
    assert lateness(noisy(angle(TIMES), noise, seed), noisy(rate(TIMES), 5.0 * noise, seed + 1), DT) is None


@pytest.mark.parametrize("rows", [slice(0, -1), slice(1, None)])
def test_nor_of_a_simulator_that_makes_euler_steps(rows):
    rates = rate(TIMES)
    angles = np.concatenate([[0.0], DT * np.cumsum(rates[rows])])
    assert lateness(angles, rates, DT) is None


def test_nor_of_a_log_of_few_rows_or_of_a_state_that_does_something_else():
    assert lateness(angle(TIMES[:4] - 0.1), rate(TIMES[:4]), DT) is None
    assert lateness(noisy(0.0 * TIMES, 1.0, 3), rate(TIMES), DT) is None
    assert lateness(0.0 * TIMES, 0.0 * TIMES, DT) is None


def checked(states, signals):
    commands = np.random.default_rng(2).standard_normal((len(states) - 1, signals.n_u)).clip(-1.0, 1.0)
    found = tl.check_log(signals.dt * np.arange(len(states)), states, commands, signals)
    assert found.fit, found.remarks
    return [remark.sentence for remark in found.remarks if remark.code == "late"]


def declared(**changes):
    states = [
        tl.State("angle", "rad", 3.0, **changes),
        tl.State("rate", "rad/s", 8.0, derivative_of="angle"),
    ]
    return tl.Signals(states, [tl.Command("torque", "N m", (-2.0, 2.0))], DT)


@pytest.mark.parametrize(
    ("late", "words"),
    [
        (0.1, "angle is read about 100 ms later than rate, which moves it. Shift its column by 2 rows"),
        (
            -0.05,
            "angle is read about 50 ms earlier than rate, which moves it. The preset default learns this",
        ),
    ],
)
def test_it_is_a_note_that_says_what_to_do(late, words):
    states = np.stack([noisy(angle(TIMES - late), 1e-4, 1), noisy(rate(TIMES), 5e-4, 2)], axis=1)
    (sentence,) = checked(states, declared())
    assert words in sentence


def test_an_angle_that_wraps_is_followed_round():
    turning = 3.0 * TIMES + angle(TIMES - 0.1)
    wrapped = np.angle(np.exp(1j * noisy(turning, 1e-4, 1)))
    states = np.stack([wrapped, noisy(3.0 + rate(TIMES), 5e-4, 2)], axis=1)
    (sentence,) = checked(states, declared(periodic=True))
    assert "about 100 ms later" in sentence


def test_angles_of_a_body_are_held_against_its_rates():
    names = [("roll", "pitch", "yaw"), ("p", "q", "r")]
    signals = tl.Signals(
        [tl.State(name, unit, 6.0) for of, unit in zip(names, ("rad", "rad/s"), strict=True) for name in of],
        [tl.Command("fan", "N", (-1.0, 1.0))], 0.01, kinematics=tl.RigidBody(*names),
    )  # fmt: skip
    t = 0.01 * np.arange(400)

    def angles(t):
        return 0.5 * np.stack([np.sin(2.0 * t), np.sin(3.1 * t), np.sin(1.3 * t + 1.0)], axis=1)

    (roll, pitch, _), slopes = angles(t).T, (angles(t + 1e-6) - angles(t - 1e-6)) / 2e-6
    p = slopes[:, 0] - slopes[:, 2] * np.sin(pitch)
    q = slopes[:, 1] * np.cos(roll) + slopes[:, 2] * np.sin(roll) * np.cos(pitch)
    r = -slopes[:, 1] * np.sin(roll) + slopes[:, 2] * np.cos(roll) * np.cos(pitch)
    body = np.stack([p, q, r], axis=1)
    assert checked(np.hstack([angles(t), body]), signals) == []
    (sentence,) = checked(np.hstack([angles(t - 0.013), body]), signals)
    assert sentence.startswith(
        "roll, pitch and yaw are read about 13 ms later than p, q and r, which move them."
    )
