"""Joints that share their masses: nodes that solve equations together, and the search for them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import twinloop as tl
from problems import problem_of
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.search import selection
from twinloop.identification.search.joints import with_joints
from twinloop.identification.search.structure import Sum
from twinloop.identification.search.walks import Walks
from twinloop.identification.sensors.chains import chains
from twinloop.identification.starts import begun
from twinloop.identification.terms.joints import forces, masses, solution
from twinloop.identification.terms.pool import Pool

WORKERS = _core.Workers(1)
WEIGHT = st.floats(-0.2, 0.2)


@given(st.data(), st.integers(1, 4))
def test_nodes_of_a_solution_are_those_of_numpy(data, count):
    pool = Pool(3)
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3))
    entry = st.dictionaries(st.sampled_from([0, 1, 2, pool.one]), WEIGHT, max_size=2)
    matrix = data.draw(
        st.lists(st.lists(entry, min_size=count, max_size=count), min_size=count, max_size=count)
    )
    right = data.draw(st.lists(entry, min_size=count, max_size=count))

    def value(terms):
        return sum((w * pool.values([term], rows)[:, 0] for term, w in terms.items()), np.zeros(20))

    below = np.array(
        [[value(terms) + float(i == j) for j, terms in enumerate(row)] for i, row in enumerate(matrix)]
    )
    expected = np.linalg.solve(
        below.transpose(2, 0, 1), np.array([value(terms) for terms in right]).T[:, :, None]
    )
    for i, node in enumerate(solution(pool, matrix, right)):
        found = 0.0 if node is None else node[1] * pool.values([node[0]], rows)[:, 0]
        assert np.allclose(found, expected[:, i, 0], atol=1e-9)


def test_a_one_on_the_diagonal_is_no_constant_that_tuning_moves():
    pool = Pool(2)
    ((node, _),) = solution(pool, [[{0: 0.5}]], [{1: 2.0}])
    free = [pool[held] for held in pool.held([node]) if held != pool.one]
    assert len(free) == 2


def cart(x, v, a, w):
    """A pendulum on a cart, solved by somebody else from the equations as textbooks write them."""
    inertia = np.array([[1.5, 0.3 * np.cos(a)], [0.3 * np.cos(a), 0.18]])
    push = np.array([0.3 * w * w * np.sin(a) - 0.4 * v, -0.3 * 9.81 * np.sin(a)])
    return [v, *np.linalg.solve(inertia, push)[:1], w, *np.linalg.solve(inertia, push)[1:]]


def apart(x, v, a, w):
    """A pendulum beside a cart on a spring."""
    return [v, -2.0 * x - 0.4 * v, w, -16.0 * np.sin(a) - 0.1 * w]


def posed(slope, noise):
    length, steps = 4.0, 150
    times = np.linspace(0.0, length, steps)
    states = solve_ivp(
        lambda t, s: slope(*s), times[[0, -1]], (0.0, 0.5, 2.2, 0.0), "DOP853", times, rtol=1e-12, atol=1e-12
    ).y.T
    readings = states + noise * states.std(axis=0) * np.random.default_rng(0).standard_normal(states.shape)
    signals = tl.Signals(
        states=[
            tl.State("x", "m", 1.0),
            tl.State("v", "m/s", 2.0, derivative_of="x"),
            tl.State("a", "rad", 2.0),
            tl.State("w", "rad/s", 8.0, derivative_of="a"),
        ],
        commands=[tl.Command("idle", "1", (0.0, 1.0))],
        dt=length / (steps - 1),
    )
    run = Run.of(readings, np.zeros((steps - 1, 1)))
    problem = problem_of(signals, run)
    pool = problem.pool
    terms = [pool.one, 0, 1, 2, 3, pool.add("sin", 2)]
    problem.usable(terms)
    known = []
    for chain in chains(signals, "acceleration", guessed_noise([run], np.ones(4))):
        chain = chain.with_noise(chain.sensors, (1.0, 0.0, 1.0))
        gram = problem.regression(chain, problem.values(terms)).gram(chain.sensors, chain.motion, WORKERS)
        weights, _, left = gram.solve(list(range(len(terms))), 1e-9)
        known.append(Sum(dict(zip(terms, weights.tolist(), strict=True)), left + 200.0, chain))
    return problem, signals, known, states


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_the_masses_of_a_cart_and_its_pendulum_are_found(noise):
    problem, signals, known, states = posed(cart, noise)
    found = with_joints(problem, signals, known, Walks(25_000, 16, Unit(0, (1,))))
    assert all(new is not old for new, old in zip(found, known, strict=True))
    rows = np.random.default_rng(3).uniform(states.min(axis=0), states.max(axis=0), (50, 4))
    truth = np.array([cart(*row) for row in rows])[:, [1, 3]]
    inputs = np.column_stack([rows, np.zeros(50)])
    for column, sum_ in enumerate(found):
        ((node, weight),) = sum_.weights.items()
        missed = weight * problem.pool.values([node], inputs)[:, 0] - truth[:, column]
        # Simpson's rule leaves a percent or two of so fast a swing, which tuning on predictions takes away.
        assert np.sqrt(np.square(missed).mean()) < (0.03 if noise == 0.0 else 0.05) * truth[:, column].std()


def test_joints_that_share_no_mass_stay_apart():
    problem, signals, known, _ = posed(apart, 0.01)
    found = with_joints(problem, signals, known, Walks(25_000, 16, Unit(0, (1,))))
    assert all(new is old for new, old in zip(found, known, strict=True))


def test_where_no_rates_are_declared_there_are_no_joints():
    problem, signals, known, _ = posed(cart, 0.0)
    bare = tl.Signals(
        states=[tl.State(name, "1", 1.0) for name in signals.state_names],
        commands=[tl.Command("idle", "1", (0.0, 1.0))],
        dt=signals.dt,
    )
    alone = [replace(found, chain=replace(found.chain, states=found.chain.states[:1])) for found in known]
    assert with_joints(problem, bare, alone, Walks(100, 4, Unit(0, (1,)))) == alone


def test_terms_of_joints_are_entered_once():
    problem, signals, _, _ = posed(cart, 0.0)
    for terms in (forces(problem.pool, signals), masses(problem.pool, signals)):
        assert len(terms) == len(set(terms))
        assert problem.usable(terms) == terms


# An arm that moves little


def arm(state, torques, rubs):
    """Accelerations of two links in a horizontal plane, solved by somebody else, with dry friction or without."""
    _, elbow, p, q = state
    inertia = np.array([[1.4 + 0.84 * np.cos(elbow), 0.35 + 0.42 * np.cos(elbow)], [0.0, 0.35]])
    inertia[1, 0] = inertia[0, 1]
    swirl = 0.42 * np.sin(elbow)
    dry = rubs * np.array([0.8 * np.tanh(p / 0.05), 0.3 * np.tanh(q / 0.05)])
    force = np.array([torques[0] - 1.2 * p + swirl * q * (2.0 * p + q), torques[1] - 0.5 * q - swirl * p * p])
    return np.linalg.solve(inertia, force - dry)


ARM = tl.Signals(
    states=[
        tl.State("shoulder", "rad", 1.0),
        tl.State("elbow", "rad", 1.0),
        tl.State("shoulder_rate", "rad/s", 4.0, derivative_of="shoulder"),
        tl.State("elbow_rate", "rad/s", 4.0, derivative_of="elbow"),
    ],
    commands=[tl.Command("first", "N m", (-20.0, 20.0)), tl.Command("second", "N m at it", (-8.0, 8.0))],
    dt=0.01,
)


BRIEF = {"generations": 0, "committee_size": 2, "lags": False, "moves": 16000, "contacts": False}


def moved(seed, rubs, steps=120):
    """A flight in which the elbow stays within half a radian: there many functions of it are nearly the same."""
    stream = np.random.default_rng(seed)
    wanted = np.repeat(stream.uniform([-0.5, 0.2], [0.5, 0.9], (4, 2)), steps // 4, axis=0)
    state, states, commands = np.array([0.0, 0.5, 0.0, 0.0]), [], []
    for target in wanted:
        command = np.clip([60.0, 25.0] * (target - state[:2]) - [10.0, 3.0] * state[2:], [-20, -8], [20, 8])
        states.append(state)
        commands.append(command)
        for _ in range(10):
            middle = state + 0.0005 * np.array([*state[2:], *arm(state, command, rubs)])
            state = state + 0.001 * np.array([*middle[2:], *arm(middle, command, rubs)])
    readings = np.array([*states, state]) + stream.normal(size=(steps + 1, 4)) * [5e-4, 5e-4, 5e-3, 5e-3]
    return Run.of(readings, np.array(commands))


@pytest.mark.parametrize("rubs", [False, True], ids=["smooth", "with dry friction"])
def test_the_masses_of_an_arm_that_moves_little_are_found(rubs):
    runs = [moved(seed, rubs) for seed in range(4)]
    found = identify_runs(runs, ARM, options_of("default", BRIEF), workers=_core.Workers())
    stream = np.random.default_rng(9)
    states = stream.uniform([-1.0, -0.2, -3.0, -3.0], [1.0, 1.3, 3.0, 3.0], (200, 4))
    torques = stream.uniform([-20.0, -8.0], [20.0, 8.0], (200, 2))
    truth = np.array([arm(state, torque, rubs) for state, torque in zip(states, torques, strict=True)])
    said = found.model.program.run(np.column_stack([states, torques / [20.0, 8.0]]))
    # Rates, torques and poses that no flight has come near.
    assert np.all(np.sqrt(np.square(said - truth).mean(axis=0)) < 0.05 * truth.std(axis=0))


@pytest.mark.parametrize(("steps", "count", "sought"), [(120, 1, False), (120, 2, True), (1000, 1, True)])
def test_shared_masses_are_sought_in_several_runs_or_a_long_one(steps, count, sought, monkeypatch):
    searches = []
    monkeypatch.setattr(selection, "with_joints", lambda *given: searches.append(given) or list(given[2]))
    runs = [moved(seed, False, steps) for seed in range(count)]
    context = Context(runs, ARM, options_of("default", BRIEF), Unit(0), WORKERS)
    first = begun(context, "acceleration", context.first_pool(), 0)
    selection.climbed(context, selection.from_both_sides(context, first))
    assert bool(searches) is sought
