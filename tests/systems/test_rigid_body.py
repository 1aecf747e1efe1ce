"""Rigid bodies: body rates turn the attitude as SciPy's rotations do, at every pitch."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
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


SPINS = (0.5, -0.4, 0.3)
"""What gyroscopic torques turn of each rate: p' = 0.5 q r, and so on."""


def tumbling(turn):
    """A body of which a usual rate turns it by so many rad a period, and its model."""
    signals = tl.Signals(
        [tl.State(name, "rad" if i < 3 else "rad/s", 3.0 if i < 3 else turn / DT) for i, name in enumerate(NAMES)],
        BODY.commands, DT, kinematics=BODY.kinematics,
    )  # fmt: skip
    pool, pairs = Pool(7), ((4, 5), (3, 5), (3, 4))
    sums = [{pool.product(*pair): spin} for pair, spin in zip(pairs, SPINS, strict=True)]
    return signals, _core.Model(pool.program_of_sums(sums), "acceleration", signals.engine)


@pytest.mark.parametrize(("turn", "steps"), [(0.2, 1), (0.8, 4), (1.5, 6)])
def test_a_second_of_fast_turning_is_what_scipy_integrates(turn, steps):
    signals, model = tumbling(turn)
    assert signals.substeps == steps
    rates = turn / DT * np.array([0.6, -0.5, 0.62])
    found = flown(model, [0.2, -0.3, 0.1, *rates], round(1.0 / DT))

    def slope(_, x):
        (a, b, c, d), (p, q, r) = x[:4], x[4:]
        turned = np.array(
            [-b * p - c * q - d * r, a * p + c * r - d * q, a * q - b * r + d * p, a * r + b * q - c * p]
        )
        return [*(0.5 * turned), SPINS[0] * q * r, SPINS[1] * p * r, SPINS[2] * p * q]

    begun = attitude(found[0]).as_quat()[[3, 0, 1, 2]]
    ended = solve_ivp(slope, (0.0, 1.0), [*begun, *rates], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    expected = Rotation.from_quat(ended[[1, 2, 3, 0]])
    # In one step a period the last two would miss by 0.018 and by 0.55 rad.
    assert (attitude(found[-1]).inv() * expected).magnitude() < 4e-4
    np.testing.assert_allclose(found[-1, 3:], ended[4:], atol=4e-4 * turn / DT)


def test_steps_depend_on_the_angle_that_a_usual_rate_turns_by_and_on_no_unit_of_time():
    for turn, steps in ((1e-3, 1), (0.25, 1), (0.26, 2), (0.5, 2), (1.0, 4), (1e6, 64)):
        for unit in (1.0, 2.0**10, 2.0**-9):
            states = [tl.State(name, "rad" if i < 3 else "rad/s", 3.0 if i < 3 else turn / DT / unit)
                      for i, name in enumerate(NAMES)]  # fmt: skip
            assert tl.Signals(states, BODY.commands, DT * unit, kinematics=BODY.kinematics).substeps == steps
    assert tl.Signals(BODY.states, BODY.commands, 50.0 * DT).substeps == 1


@pytest.mark.parametrize("width", _core.vector_widths())
def test_every_width_turns_alike_to_the_bit(width):
    stream = np.random.default_rng(0)
    states = np.hstack([stream.uniform(-1.5, 1.5, (37, 3)), stream.uniform(-9.0, 9.0, (37, 3))])
    found = coasting().step(states, np.zeros((37, 1)), _core.Workers(width=width))
    alone = np.array([coasting().step(x[np.newaxis], np.zeros((1, 1)))[0] for x in states])
    assert found.tobytes() == alone.tobytes()
    _, model = tumbling(1.5)
    states[:, 3:] *= 15.0
    found = model.step(states, np.zeros((37, 1)), _core.Workers(width=width))
    alone = np.array([model.step(x[np.newaxis], np.zeros((1, 1)))[0] for x in states])
    assert found.tobytes() == alone.tobytes()
