"""Angles of a rigid body are moved, within a period, by what disturbs their rates."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from twinloop.identification.sensors.chains import Chain, Motion, chains, stirred

DT = 0.02
ANGLES, RATES = ("roll", "pitch", "yaw"), ("p", "q", "r")
STATES = [*(tl.State(name, "rad", 1.0) for name in ANGLES), *(tl.State(name, "rad/s", 4.0) for name in RATES)]
COMMANDS = [tl.Command(name, "1", (-1.0, 1.0)) for name in "abc"]
BODY = tl.Signals(STATES, COMMANDS, DT, kinematics=tl.RigidBody(ANGLES, RATES))


def of_body(motion: Motion) -> tuple[list[Chain], list[Chain]]:
    """Chains of angles and of rates, each rate disturbed alike but for a factor."""
    every = chains(BODY, "acceleration", np.full(6, 4e-6))
    driven = [
        replace(chain, motion=motion._replace(white=motion.white * (k + 1)))
        for k, chain in enumerate(chain for chain in every if chain.output is not None)
    ]
    return [chain for chain in every if chain.output is None], driven


@pytest.mark.parametrize(("white", "gust", "time"), [(0.04, 0.0, 1.0), (0.0, 3.0, 0.2), (0.01, 2.0, 0.3)])
def test_what_a_rate_at_the_beginning_of_each_period_misses_adds_up_like_this(white, gust, time):
    """A rate that moves in fine steps; its integral less that of its values at the beginnings, by what they rose."""
    random, fine, periods, flights = np.random.default_rng(0), 20, 400, 600
    h = DT / fine
    keep = np.exp(-h / time)
    push = gust * random.standard_normal(flights)
    missed, rate = np.zeros(flights), np.zeros(flights)
    for _ in range(periods):
        begun = rate.copy()
        for _ in range(fine):
            before = rate.copy()
            rate = rate + h * push + np.sqrt(white * h) * random.standard_normal(flights)
            push = keep * push + gust * np.sqrt(1.0 - keep * keep) * random.standard_normal(flights)
            missed += h * (0.5 * (before + rate) - begun)
    given, driven = of_body(Motion(white, gust * gust, time))
    roll = next(chain for chain in stirred(given, driven, BODY) if chain.states == (0,))
    assert missed.var() == pytest.approx(roll.motion.white * periods * DT, rel=0.15)


def test_each_angle_is_stirred_by_its_own_rate_and_never_less_than_before():
    given, driven = of_body(Motion(0.04, 0.0, 1.0))
    found = {chain.states[0]: chain.motion.white for chain in stirred(given, driven, BODY)}
    assert found == pytest.approx({k: DT * DT * 0.04 * (k + 1) / 3.0 for k in range(3)})
    calm = [replace(chain, motion=Motion(1.0, 0.0, 1.0)) for chain in given]
    assert [chain.motion.white for chain in stirred(calm, driven, BODY)] == [1.0] * 3


def test_without_a_body_nothing_is():
    free = tl.Signals(STATES, COMMANDS, DT)
    given, driven = of_body(Motion(0.04, 9.0, 0.2))
    assert stirred(given, driven, free) == given


def quadrotor_in_gusts(seed: int, steps: int = 150) -> tl.Trajectory:
    """A body whose commands turn it at 90, 80 and 6 rad/s², in gusts of 3, 3 and 0.5 rad/s² that last 0.2 s."""
    random, fine = np.random.default_rng(seed), 10
    gain, sds = np.array([90.0, 80.0, 6.0]), np.array([3.0, 3.0, 0.5])
    h = DT / fine
    keep = np.exp(-h / 0.2)
    x, push = np.zeros(6), sds * random.standard_normal(3)
    times = DT * np.arange(steps + 1)
    chirp = 0.04 * np.sin(
        2.0 * np.pi * (1.0 + times[:, None]) * times[:, None] * [0.7, 0.9, 0.5] + [0.0, 1.0, 2.0]
    )
    read, sent = [], []
    for k in range(steps + 1):
        seen = x + np.array([2e-3] * 3 + [1e-2] * 3) * random.standard_normal(6)
        read.append(seen)
        if k == steps:
            break
        u = np.clip(
            chirp[k] * [1.0, 1.0, 6.0] - seen[:3] * [0.08, 0.08, 0.3] - seen[3:] * [0.05, 0.05, 0.3], -1, 1
        )
        sent.append(u)
        for _ in range(fine):
            roll, pitch, _, p, q, r = x
            across = q * np.sin(roll) + r * np.cos(roll)
            turn = [p + across * np.tan(pitch), q * np.cos(roll) - r * np.sin(roll), across / np.cos(pitch)]
            x = x + h * np.concatenate([turn, gain * u + push])
            push = keep * push + sds * np.sqrt(1.0 - keep * keep) * random.standard_normal(3)
    return tl.Trajectory(times, np.array(read), np.array(sent))


def test_the_law_of_a_body_in_gusts_does_not_take_the_blame_for_what_they_do_within_a_period():
    options = {"libraries": ("linear",), "generations": 0, "moves": 2000, "starts": 1, "parts": False}
    twin = tl.identify([quadrotor_in_gusts(seed) for seed in range(4)], BODY, options=options, progress=None)
    found = np.diag(twin.linearise(np.zeros(6), np.zeros(3)).B[3:])
    np.testing.assert_allclose(found, [90.0, 80.0, 6.0], rtol=0.08)
