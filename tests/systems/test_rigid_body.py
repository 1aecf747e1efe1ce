"""Rigid bodies: body rates turn the attitude as SciPy's rotations do, at every pitch."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import twinloop as tl
from twinloop import _core
from twinloop.identification.terms.pool import Pool

DT = 0.01
NAMES = ("roll", "pitch", "yaw", "p", "q", "r")
BODY = tl.Signals(
    [tl.State(name, "rad" if i < 3 else "rad/s", 3.0 if i < 3 else 20.0) for i, name in enumerate(NAMES)],
    [tl.Command("u", "N m", (-1.0, 1.0))],
    DT,
    kinematics=tl.RigidBody(NAMES[:3], NAMES[3:]),
)


def coasting(outputs=({}, {}, {})):
    return _core.Model(
        Pool(7).program_of_sums([dict(terms) for terms in outputs]), "acceleration", BODY.engine
    )


def attitude(states):
    """Rotations of roll, pitch and yaw, turned about z, then y, then x."""
    return Rotation.from_euler("ZYX", np.asarray(states)[..., [2, 1, 0]])


def flown(model, state, steps):
    states = [np.asarray(state, dtype=float)]
    for _ in range(steps):
        states.append(model.step(states[-1][np.newaxis], np.zeros((1, 1)))[0])
    return np.array(states)


ANGLES = st.tuples(st.floats(-3.0, 3.0), st.floats(-1.57, 1.57), st.floats(-3.0, 3.0))
RATES = st.tuples(*[st.floats(-20.0, 20.0)] * 3)


@given(ANGLES, RATES)
def test_constant_body_rates_turn_by_their_rotation_vector(angles, rates):
    found = flown(coasting(), [*angles, *rates], 20)
    expected = attitude(found[0]) * Rotation.from_rotvec(20 * DT * np.array(rates))
    # A Runge-Kutta step of 0.35 rad at the most leaves some 1e-5 of it.
    assert (attitude(found[-1]).inv() * expected).magnitude() < 5e-4
    if np.abs(rates).max() < 5.0:
        assert (attitude(found[-1]).inv() * expected).magnitude() < 1e-6


def test_a_flight_through_the_vertical_goes_on():
    found = flown(coasting(), [0.3, 1.4, -0.2, 0.5, 4.0, -1.0], 100)
    expected = attitude(found[0]) * Rotation.from_rotvec(100 * DT * np.array([0.5, 4.0, -1.0]))
    assert (attitude(found[-1]).inv() * expected).magnitude() < 1e-5
    assert (np.abs(found[:, 1]) <= np.pi / 2.0).all()


def test_roll_and_yaw_turn_on_beyond_half_a_turn():
    found = flown(coasting(), [0.0, 0.0, 0.0, 5.0, 0.0, 0.0], 200)
    np.testing.assert_allclose(found[:, 0], 5.0 * DT * np.arange(201), atol=1e-6)
    found = flown(coasting(), [0.0, 0.0, 0.0, 0.0, 0.0, -5.0], 200)
    np.testing.assert_allclose(found[:, 2], -5.0 * DT * np.arange(201), atol=1e-6)


def test_a_program_sees_the_angles_of_each_stage():
    # d p / dt = -9 sin(roll): a pendulum about the first axis.
    pool = Pool(7)
    model = _core.Model(
        pool.program_of_sums([{pool.add("sin", 0): -9.0}, {}, {}]), "acceleration", BODY.engine
    )
    found = flown(model, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100)
    energy = 0.5 * found[:, 3] ** 2 - 9.0 * np.cos(found[:, 0])
    assert np.ptp(energy) < 1e-6


@pytest.mark.parametrize("width", _core.vector_widths())
def test_every_width_turns_alike_to_the_bit(width):
    stream = np.random.default_rng(0)
    states = np.hstack([stream.uniform(-1.5, 1.5, (37, 3)), stream.uniform(-9.0, 9.0, (37, 3))])
    found = coasting().step(states, np.zeros((37, 1)), _core.Workers(width=width))
    alone = np.array([coasting().step(x[np.newaxis], np.zeros((1, 1)))[0] for x in states])
    assert found.tobytes() == alone.tobytes()
