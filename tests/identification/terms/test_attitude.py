"""Attitude: a body's pose turns its thrust, its weight and its velocity, whoever computes the rotation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import twinloop as tl
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.search.problem import Problem
from twinloop.identification.starts import ANEW, begun
from twinloop.identification.terms.attitude import attitude, carried, tilted, tilts, turned
from twinloop.identification.terms.directions import of_mixer, terms_of, together
from twinloop.identification.terms.pool import Pool

ANGLES, RATES = ("roll", "pitch", "yaw"), ("p", "q", "r")
GRAVITY, THRUST, FALL = 9.81, 6.0, 0.4
"""m/s², of four rotors at 1, 1/s."""


def body(velocities=("climb",), rotors=4, thrust=False):
    """Signals of a rigid body with velocities logged beside it, of rotors that are alike or one thrust."""
    states = [tl.State(name, "rad", 1.0) for name in ANGLES]
    states += [tl.State(name, "rad/s", 3.0) for name in RATES]
    states += [tl.State(name, "m/s", 3.0) for name in velocities]
    commands = [tl.Command(f"rotor_{i}", "1", (0.0, 2.0), scale=1.0) for i in range(rotors)]
    commands += [tl.Command("thrust", "N", (0.0, 2.0), scale=1.0)] if thrust else []
    return tl.Signals(states, commands, 0.02, kinematics=tl.RigidBody(ANGLES, RATES))


@given(st.lists(st.floats(-1.4, 1.4), min_size=3, max_size=3))
def test_tilts_are_the_vertical_in_the_body_and_the_bodys_vertical_in_the_earth(pose):
    signals, pool = body(), Pool(11)
    rotation = Rotation.from_euler("ZYX", pose[::-1]).as_matrix()
    row = np.array([[*pose, *[0.0] * 8]])
    found = pool.values(tilts(pool, signals), row)[0]
    # The row is (-sin, ., .): its sign is the weight's.
    expected = [-rotation[2, 0], rotation[2, 1], rotation[2, 2], rotation[0, 2], rotation[1, 2]]
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_without_velocities_or_a_body_nothing_is_turned():
    assert tilts(Pool(10), body(velocities=())) == []
    plain = tl.Signals([tl.State("climb", "m/s", 3.0)], [tl.Command("u", "1", (0.0, 1.0))], 0.02)
    assert attitude(Pool(2), plain) == []


def placed(units=("m", "m", "m", "m/s", "m/s", "m/s"), attitude=True):
    """Signals of a body with further states of these units, places first, and one command."""
    states = [tl.State(name, "rad", 1.0) for name in ANGLES]
    states += [tl.State(name, "rad/s", 3.0) for name in RATES]
    states += [tl.State(f"s{i}", unit, 1.0) for i, unit in enumerate(units)]
    body = tl.RigidBody(ANGLES, RATES) if attitude else None
    return tl.Signals(states, [tl.Command("u", "N", (-1.0, 1.0))], 0.1, kinematics=body)


@given(
    st.lists(st.floats(-1.4, 1.4), min_size=3, max_size=3),
    st.lists(st.floats(-9.0, 9.0), min_size=3, max_size=3),
)
def test_places_change_by_the_velocity_of_the_body_as_its_pose_turns_it(pose, velocity):
    signals, pool = placed(), Pool(13)
    row = np.array([[*pose, *[0.0] * 6, *velocity, 0.0]])
    along_the_earth = Rotation.from_euler("ZYX", pose[::-1]).apply(velocity)
    np.testing.assert_allclose(pool.values(carried(pool, signals), row)[0], along_the_earth, atol=1e-13)
    assert [pool.length(node) for node in carried(pool, signals)] == [pool.length(0)] * 3


@pytest.mark.parametrize(
    "signals",
    [
        placed(units=("m", "m/s", "m/s")),
        placed(units=("m", "m/s", "m/s", "m/s", "m/s")),
        placed(units=("m", "km/s", "km/s", "km/s")),
        placed(units=("rad",)),
        placed(attitude=False),
    ],
    ids=["two velocities", "four velocities", "other units", "an angle beside the rates", "no body"],
)
def test_velocities_that_may_not_be_those_of_the_body_are_not_turned(signals):
    assert carried(Pool(len(signals.states) + 1), signals) == []


def test_a_tilt_is_as_short_as_an_input_and_times_a_command_as_a_product_of_two():
    signals, pool = body(rotors=0, thrust=True), Pool(8)
    tilt = tilts(pool, signals)[2]
    assert pool.length(tilt) == pool.length(0)
    assert [pool.length(node) for node in tilted(pool, tilt, 7)] == [pool.length(pool.product(0, 7))] * 2
    # Five tilts, alone and times the thrust and its square.
    assert len(set(attitude(pool, signals))) == 15


@pytest.mark.parametrize(
    ("signals", "along"),
    [
        (body(velocities=("north", "east", "fall"), rotors=1), RATES),
        (placed(), (*RATES, "s3", "s4", "s5")),
    ],
    ids=["velocities along the earth's axes", "velocities along the body's axes"],
)
def test_what_a_pose_turns_is_short_along_the_earth_and_as_long_as_it_is_written_along_the_body(
    signals, along
):
    """The weight that rights a body is short for both: it is no thrust, and no yaw turns it."""
    run = Run.of(np.zeros((20, signals.n_x)), np.zeros((19, 1)))
    context = Context([run], signals, options_of("default", {}), Unit(0), _core.Workers(1))
    first = begun(context, "acceleration", context.first_pool(), ANEW)
    problem, pool = Problem(context, first), first.pool
    sin_pitch, aside, down, north, east = tilts(pool, signals)
    command = signals.n_x
    long = [*tilted(pool, north, command), *carried(pool, signals)]
    short = [pool.one, 0, command, pool.product(0, command), sin_pitch, aside, down]
    assert turned(pool, signals, [*short, north, east, *long]) == {north, east, *long}
    for chain in first.driven:
        names = [signals.state_names[i] for i in chain.states]
        found = problem.as_written(chain, [*short, *long])
        if names[0] in along:
            assert sorted(found) == sorted(long)
            assert all(found[node] > 3.0 * pool.length(node) for node in long)
        else:
            assert found == {}


def test_commands_that_pull_together_are_turned_and_those_against_each_other_are_not():
    signals, pool = body(), Pool(11)
    found = tilts(pool, signals)
    together_, apart = ((7, 1.0), (8, 1.0)), ((7, 1.0), (8, -1.0))
    assert len(terms_of(pool, apart, (), found)) == 2
    terms = terms_of(pool, together_, (), found)
    assert pool.product(found[0], together(pool, together_, squared=True)) in terms
    assert len(terms) == 2 + 2 * len(found)
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 11))
    for term, plain in terms.items():
        np.testing.assert_allclose(pool.values(plain, rows).sum(axis=1), pool.values([term], rows)[:, 0])


def flights(signals, runs=2, noise=2e-3, seed=4):
    """Flights of a body that tumbles gently: rates follow differences of four rotors, its thrust carries it."""
    draw, found = np.random.default_rng(seed), []
    mixer = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    for _ in range(runs):
        axes = np.repeat(0.25 * draw.uniform(-1.0, 1.0, (15, 3)), 10, axis=0)
        level = np.repeat(draw.uniform(0.9, 1.6, (15, 1)), 10, axis=0)
        commands = level + axes @ mixer.T
        state, states = np.zeros(9), [np.zeros(9)]
        for u in commands:

            def slope(_, x, u=u):
                rotation = Rotation.from_euler("ZYX", x[2::-1]).as_matrix()
                s, c, t = np.sin(x[0]), np.cos(x[0]), np.tan(x[1])
                p, q, r = x[3:6]
                angles = [p + t * (q * s + r * c), q * c - r * s, (q * s + r * c) / np.cos(x[1])]
                rates = 2.0 * (mixer.T @ u**2) - 3.0 * x[3:6] - 4.0 * x[:3]
                lift = THRUST / 4.0 * (u**2).sum() * rotation[:, 2]
                return [*angles, *rates, *(lift - [0.0, 0.0, GRAVITY] - FALL * x[6:])]

            state = solve_ivp(slope, (0.0, signals.dt), state, rtol=1e-9, atol=1e-9).y[:, -1]
            states.append(state)
        readings = np.array(states) + noise * draw.standard_normal((len(states), 9))
        found.append(Run.of(readings, commands))
    return found, mixer


def test_a_thrust_that_a_pose_turns_is_one_term_along_each_axis_of_the_earth():
    signals = body(velocities=("north", "east", "fall"))
    runs, mixer = flights(signals)
    options = {
        "form": "acceleration", "moves": 4000, "starts": 2, "generations": 0, "lags": False, "hidden": False,
        "storage": False, "committee_size": 3, "tuning_steps": 8, "libraries": ("linear", "quadratic", "attitude"),
    }  # fmt: skip
    axes = of_mixer(np.column_stack([mixer, np.ones(4)]), signals)
    found = identify_runs(
        runs, signals, options_of("default", options), rests=[np.ones(4)], axes=axes, workers=_core.Workers()
    )
    pool = found.pool
    lift = [pool.product(tilt, together(pool, axes[3], squared=True)) for tilt in tilts(pool, signals)]
    north, east, fall = found.sums[-3:]
    for sum_, node in ((north, lift[3]), (east, lift[4]), (fall, lift[2])):
        assert sum_.weights[node] == pytest.approx(THRUST / 4.0, rel=0.02)
        assert len(sum_.weights) <= 3
    assert fall.weights[pool.one] == pytest.approx(-GRAVITY, rel=0.02)
