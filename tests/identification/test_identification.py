"""Pools of expressions, ladders of libraries, and whether the law of a small plant is found from its runs."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import UNARY, operate, rk4, same_bits
from sameness import same
from small_plants import fans, gravity, lagging_motor, pendulum_like, swung
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.fit import fitting
from twinloop.identification.fit.tuning import LONGEST_MEMORY
from twinloop.identification.identify import identify_runs
from twinloop.identification.proposals.parts import cut
from twinloop.identification.records import HELD, Run, guessed_noise
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.search.structure import prices
from twinloop.identification.search.subsets import Judge
from twinloop.identification.sensors.chains import chains
from twinloop.identification.settings import LEAST_MOVES, IdentificationOptions
from twinloop.identification.starts import ANEW, begun
from twinloop.identification.terms.libraries import LIBRARIES, rungs
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation, Actuator

WORKERS = _core.Workers()
FAST = {
    "moves": 2000, "starts": 2, "generations": 0, "lags": False, "committee_size": 3, "tuning_steps": 8,
}  # fmt: skip
INPUTS = 3

# Pools


@st.composite
def pools(draw):
    """A pool with a few nodes, a hidden state among them."""
    pool = Pool(INPUTS)
    pool.hidden(0)
    for _ in range(draw(st.integers(0, 8))):
        operand = st.integers(0, len(pool) - 1)
        constant = st.floats(-5.0, 5.0).filter(lambda x: abs(x) > 1e-3)
        operation = draw(
            st.sampled_from(["+", "-", "*", "/", "min", "max", "abs", "sqrt", "sin", "cos", "tanh"])
        )
        further = [] if operation in UNARY else [draw(st.one_of(operand, constant))]
        pool.add(operation, draw(operand), *further)
    return pool


def value(pool, number, rows):
    """A node, written once more as a recursion."""
    operation, operands, number = pool[number]
    if operation == "input":
        return rows[:, int(number)]
    if operation == "constant":
        return np.full(len(rows), number)
    return operate(operation, *(value(pool, operand, rows) for operand in operands))


@given(pools(), st.data(), st.integers(0, 2**32 - 1))
def test_a_program_of_sums_is_those_sums(pool, data, seed):
    rows = np.random.default_rng(seed).uniform(-2.0, 2.0, (7, INPUTS + 1))
    node, weight = st.integers(0, len(pool) - 1), st.floats(-9.0, 9.0)
    outputs = data.draw(st.lists(st.dictionaries(node, weight, max_size=6), min_size=1, max_size=3))
    found = pool.program_of_sums(outputs, hidden=1).run(rows)
    with np.errstate(all="ignore"):
        for i, terms in enumerate(outputs):
            parts = [w * value(pool, n, rows) for n, w in terms.items()]
            size = 1.0 + np.sum(np.abs(parts), axis=0) if parts else np.ones(len(rows))
            expected = np.sum(parts, axis=0) if parts else np.zeros(len(rows))
            tame = size < 1e6
            assert (np.abs(found[tame, i] - expected[tame]) <= 1e-9 * size[tame]).all()


@given(pools(), st.integers(0, 2**32 - 1))
def test_values_of_nodes_are_those_of_the_recursion(pool, seed):
    rows = np.random.default_rng(seed).uniform(-2.0, 2.0, (7, INPUTS + 1))
    numbers = list(range(len(pool)))[::-1]
    with np.errstate(all="ignore"):
        expected = np.stack([value(pool, n, rows) for n in numbers], axis=1)
        tame = (np.abs(expected) < 1e6).all()
    assert pool.values([], rows).shape == (len(rows), 0)
    found = pool.values(numbers, rows)
    assert found.shape == expected.shape
    if tame:
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8)


def test_no_nodes_have_no_values():
    pool = Pool(INPUTS)
    assert pool.values([], np.zeros((4, INPUTS))).shape == (4, 0)
    assert pool.values([pool.one, 1], np.full((4, INPUTS), 2.0)).tolist() == [[1.0, 2.0]] * 4


def test_equal_expressions_are_one_node():
    pool = Pool(INPUTS)
    assert pool.product(0, 1) == pool.product(1, 0) and pool.add("+", 2, 1) == pool.add("+", 1, 2)
    assert pool.add("-", 2, 1) != pool.add("-", 1, 2)
    assert pool.product(2, 2) != pool.add("*", 2, 2.0)
    assert pool.needed([pool.product(0, 1, 2)]) == [0, 1, 2, pool.product(0, 1), pool.product(0, 1, 2)]


@given(pools(), pools())
def test_a_copy_of_a_pool_grows_as_the_pool_would_and_leaves_it_as_it_was(pool, more):
    before, again = pool.to_record(), pool.copy()
    for grown in (again, other := pool.copy()):
        for number in range(INPUTS, len(more)):
            grown.rungs[grown.enter(more[number])] = 3
            grown.found[grown.enter(more[number])] = 1.0
            grown.length(grown.enter(more[number]))
    assert pool.to_record() == before
    assert same(again, other) and again.extends(pool)
    assert pool.extends(again) == (len(again) == len(pool))
    for number in range(INPUTS, len(more)):
        assert pool.enter(more[number]) == again.enter(more[number])


def test_an_empty_sum_is_zero_and_one_is_one():
    pool = Pool(INPUTS)
    found = pool.program_of_sums([{}, {pool.one: 2.5}, {0: 1.0, pool.one: -1.0}]).run([[3.0, 0.0, 0.0]])
    assert found.tolist() == [[0.0, 2.5, 2.0]]


def test_longer_expressions_cost_more_and_what_is_known_elsewhere_its_own_price():
    pool = Pool(8)
    square = pool.product(0, 0)
    terms = [0, square, pool.product(0, 1), pool.product(0, 1, 2), pool.product(0, 1, 2, 2)]
    lengths = [pool.length(term) for term in terms]
    # One of 9 linear terms or of 9 kinds of one input, one of 28 pairs.
    assert lengths[0] == lengths[1] == pytest.approx(np.log(27.0))
    assert lengths[2] == pytest.approx(np.log(84.0))
    assert lengths[2] < lengths[3] < lengths[4]
    assert pool.length(pool.add("+", 0, 0.5)) == lengths[2]
    # A function is a choice of its own: where rates have one sign only, |rate| says what -rate does.
    for node in (pool.add("abs", 0), pool.product(pool.add("abs", 0), 0)):
        assert pool.length(node) == pytest.approx(lengths[1] + np.log(pool.operations))
    found = prices(pool, terms, 1000, 1, {terms[4]: 1.25})
    expected = np.log(1000.0) + 2.0 * np.array([*lengths[:4], 1.25])
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert (prices(pool, terms, 0, 1) > 0.0).all()
    # From the sixth run on they rise, and slower than evidence does; up to then each tells something of its own.
    few, many = (prices(pool, terms, 1000, runs, {terms[4]: 1.25}) for runs in (5, 20))
    np.testing.assert_allclose(few, found)
    np.testing.assert_allclose(many, 8.0**0.5 * found)


def test_each_rung_has_the_terms_of_those_below_and_a_stranger_stands_above_all():
    pool = Pool(INPUTS)
    ladder = rungs(pool, pendulum_like(), LIBRARIES, 450)
    assert len(ladder) == 3
    drag = pool.product(pool.add("abs", 1), 1)
    assert drag in ladder[0] and pool.rung([drag]) == 0
    assert all(set(low) < set(high) for low, high in pairwise(ladder))
    assert all(len(set(terms)) == len(terms) for terms in ladder)
    sine = pool.add("sin", 0)
    assert sine not in ladder[0] and sine in ladder[1]
    assert pool.rung([0, 1]) == 0 and pool.rung([0, sine]) == 1
    assert pool.rung([pool.add("tanh", 0)]) == len(ladder)
    assert rungs(Pool(INPUTS), pendulum_like(), (), 450) == []
    assert len(rungs(Pool(INPUTS), pendulum_like(), ("linear", "cubic"), 4)) == 1


LEVEL = 0.5
"""Scale of a level, m."""


def tanks_like(*more):
    levels = [tl.State(name, "m", LEVEL) for name in ("upper", "lower")]
    return tl.Signals([*levels, *more], [tl.Command("pump", "V", (0.0, 10.0), scale=10.0)], 2.0)


def signed_root(pool, node):
    """Of levels in units of their scale."""
    node = pool.share(node, LEVEL)
    return pool.add("/", node, pool.add("sqrt", node))


def test_roots_are_of_levels_and_of_nothing_that_moves():
    pool = Pool(6)
    motion = tanks_like(
        tl.State("place", "m", 1.0),
        tl.State("speed", "m/s", 1.0, derivative_of="place"),
        tl.State("turn", "rad", 1.0),
    )
    found = rungs(pool, motion, ("roots",), 450)[0]
    upper, lower = (signed_root(pool, i) for i in range(2))
    between = signed_root(pool, pool.add("-", 0, 1))
    assert set(found) == {upper, lower, pool.product(5, upper), pool.product(5, lower), between}
    # As short as the root without its sign.
    assert pool.length(upper) == pool.length(pool.add("sqrt", 0))


@pytest.mark.parametrize("libraries", [("roots",), ("quotients",)])
def test_angles_and_rates_have_no_roots_and_no_quotients(libraries):
    body = tl.RigidBody(("a", "b", "c"), ("p", "q", "r"))
    six = [tl.State(name, "rad", 1.0) for name in "abc"] + [tl.State(name, "rad/s", 1.0) for name in "pqr"]
    flying = tl.Signals(six, [tl.Command("u", "V", (0.0, 1.0))], 0.02, kinematics=body)
    assert rungs(Pool(7), flying, libraries, 450) == []
    assert rungs(Pool(INPUTS), pendulum_like(), libraries, 450) == []
    # Whatever else a body carries has them.
    tank = tl.State("tank", "l", 1.0)
    carrying = tl.Signals([*six, tank], [tl.Command("u", "V", (0.0, 1.0))], 0.02, kinematics=body)
    pool = Pool(8)
    (terms,) = rungs(pool, carrying, libraries, 450)
    assert {6} <= {leaf for term in terms for leaf in pool.leaves(term)} <= {6, 7, None}


@pytest.mark.parametrize("joined", [False, True])
def test_the_law_of_two_tanks_is_found(joined):
    """One runs into the other, which leaks; joined at the bottom water runs both ways."""

    def rates(x, u):
        between = np.sign(x[0] - x[1]) * np.sqrt(abs(x[0] - x[1])) if joined else np.sqrt(x[0])
        return np.array([0.02 * u - 0.016 * between, 0.016 * between - 0.012 * np.sqrt(x[1])])

    runs = []
    for seed in range(2):
        stream = np.random.default_rng(seed)
        commands = np.repeat(stream.uniform(0.1, 1.0, 30), 5)
        x, states = np.array([0.1, 0.2 + 0.2 * seed]), [np.array([0.1, 0.2 + 0.2 * seed])]
        for u in commands:
            x = x + rates(x, u)
            states.append(x)
        noisy = np.array(states) + 5e-4 * stream.normal(size=(151, 2))
        runs.append(Run.of(noisy, 10.0 * commands[:, np.newaxis]))
    found = identified(runs, tanks_like(), moves=8000)
    pool = found.pool
    between, leak = signed_root(pool, pool.add("-", 0, 1) if joined else 0), signed_root(pool, 1)
    # √x is √scale times the root of x in units of it.
    out, leaking = 0.016 * LEVEL**0.5, 0.012 * LEVEL**0.5
    for sum_, expected in zip(
        found.sums, ({2: 0.02, between: -out}, {between: out, leak: -leaking}), strict=True
    ):
        assert set(sum_.weights) == set(expected)
        for term, weight in expected.items():
            assert sum_.weights[term] == pytest.approx(weight, rel=0.02)


def magnet_like():
    return tl.Signals(
        [tl.State("gap", "m", 1.0), tl.State("speed", "m/s", 3.0, derivative_of="gap")],
        [tl.Command("current", "A", (0.0, 3.0), scale=1.0)],
        0.02,
    )


def test_quotients_are_of_what_may_be_a_distance():
    pool = Pool(INPUTS)
    found = rungs(pool, magnet_like(), ("quotients",), 450)[0]
    share = pool.share(0, 1.0)  # of its scale: what is too small to divide by must not depend on the unit
    above = (pool.one, 2, pool.product(2, 2))
    assert set(found) == {
        pool.add("/", a, below) for below in (share, pool.product(share, share)) for a in above
    }


def test_the_law_of_a_magnet_is_found():
    """It holds a body up with the square of current over distance."""

    def lifted(gap, speed, current):
        return -9.81 + 3.0 * (2.0 + current) ** 2 / gap**2 - 0.8 * speed

    runs = []
    for seed in range(2):
        run = swung(lifted, seed, start=(1.2 + 0.3 * seed, 0.0), noise=1e-3, amplitude=1.0)
        runs.append(Run.of(run.states, run.commands + 2.0))
    found = identified(runs, magnet_like(), moves=8000)
    pool, weights = found.pool, found.sums[0].weights
    share = pool.share(0, 1.0)
    pull = pool.add("/", pool.product(2, 2), pool.product(share, share))
    expected = {pool.one: -9.81, pull: 3.0, 1: -0.8}
    assert set(weights) == set(expected)
    for term, weight in expected.items():
        assert weights[term] == pytest.approx(weight, rel=0.03)


def test_driven_states_are_those_that_no_other_gives():
    names = ("roll", "pitch", "yaw", "p", "q", "r")
    states = [
        tl.State(name, unit, 1.0) for name, unit in zip(names, ["rad"] * 3 + ["rad/s"] * 3, strict=True)
    ]
    command = [tl.Command("u", "V", (0.0, 1.0))]
    body = tl.RigidBody(names[:3], names[3:])
    assert tl.Signals(states, command, 0.1).driven == (0, 1, 2, 3, 4, 5)
    assert tl.Signals(states, command, 0.1, kinematics=body).driven == (3, 4, 5)
    assert pendulum_like().driven == (1,)


def test_every_state_is_in_one_chain():
    body = tl.RigidBody(("a", "b", "c"), ("p", "q", "r"))
    states = [tl.State(n, "rad", 1.0) for n in "abc"] + [tl.State(n, "rad/s", 1.0) for n in "pqr"]
    states += [tl.State("x", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="x")]
    signals = tl.Signals(states, [tl.Command("u", "1", (-1.0, 1.0))], 0.1, kinematics=body)
    for form in ("acceleration", "increment"):
        found = chains(signals, form, np.ones(8))
        assert sorted(i for chain in found for i in chain.states) == list(range(8))
    found = chains(signals, "acceleration", np.arange(8.0))
    assert [(c.states, c.output) for c in found] == [
        ((3,), 0), ((4,), 1), ((5,), 2), ((7, 6), 3), ((0,), None), ((1,), None), ((2,), None),
    ]  # fmt: skip
    assert found[3].sensors.tolist() == [7.0, 6.0]


def test_a_first_guess_of_the_noise_is_its_variance_and_never_nothing():
    stream = np.random.default_rng(0)
    t = 0.02 * np.arange(2000)[:, None]
    states = np.sin(t * [1.0, 2.0]) + stream.normal(size=(2000, 2)) * [0.01, 0.3]
    np.testing.assert_allclose(guessed_noise([Run.of(states, t)], np.ones(2)), [1e-4, 0.09], rtol=0.2)
    still = Run.of(np.zeros((50, 2)), np.zeros((49, 1)))
    assert guessed_noise([still], np.ones(2)).tolist() == [HELD * HELD] * 2
    assert (guessed_noise([Run.of(np.ones((3, 2)), np.ones((2, 1)))], np.ones(2)) > 0.0).all()


# Laws of small plants


def identified(runs, signals, rests=(), workers=WORKERS, seed=0, **changes):
    options = options_of("default", {**FAST, **changes})
    return identify_runs(runs, signals, options, rests=rests, workers=workers, seed=seed)


def law(found, output=0):
    """Coefficients by how their term is written."""
    names = []
    for number in found.sums[output].weights:
        operation, operands, _ = found.pool[number]
        plain = {"input": number, "constant": "1"}
        names.append(plain.get(operation, (operation, *operands)))
    model = dict(zip(names, found.model.constants.tolist(), strict=True))
    return model


def test_the_law_of_a_pendulum_is_found():
    runs = [swung(gravity, seed, start=(0.5 + seed, 0.0)) for seed in range(2)]
    found = identified(runs, pendulum_like())
    assert found.model.form == "acceleration" and found.terms == 3
    terms = law(found)
    assert set(terms) == {1, 2, ("sin", 0)}
    assert terms["sin", 0] == pytest.approx(-9.0, rel=0.01)
    assert terms[1] == pytest.approx(-0.4, rel=0.01) and terms[2] == pytest.approx(5.0, rel=0.01)
    assert len(found.members) == 3 and found.outliers == 0 and found.readings == 404
    assert found.members[0] is found.model


def flown_in_gusts(seed):
    """Two excited flights of a quadrotor with drag and lagging motors in gusts of 0.5 rad/s²."""
    rig = tl.systems.Quadrotor.harsh(noise=1e-3, seed=seed)
    task = {"initial_state": rig.initial_state, "target_state": rig.target_state, "duration": rig.duration}
    gentle = {"excitation": 0.004, "hold_back": False}
    campaign = tl.Campaign(rig.signals, controller=rig.controller, seed=seed, options=gentle, **task)
    flights = [rig.run(campaign.test(rig.default_gains)) for _ in range(2)]
    return rig.signals, [Run.of(flight.states, flight.commands) for flight in flights]


@pytest.mark.parametrize("seed", [2, 3])
def test_from_above_gusts_are_told_from_terms_where_from_below_they_are_not(seed):
    signals, runs = flown_in_gusts(seed)
    changes = {"libraries": ("linear", "quadratic", "damping"), "moves": 50_000}
    changes |= {"hidden": False, "directions": False}

    def begins(above):
        options = options_of("default", {**FAST, **changes, "noise_from_above": above})
        context = Context(runs, signals, options, Unit(0), WORKERS)
        return from_both_sides(context, begun(context, "acceleration", context.first_pool(), ANEW))

    both, below = begins(above=True), begins(above=False)
    assert both.length < below.length - 100.0
    both, below = (sum(len(found.weights) for found in each.sums) for each in (both, below))
    assert both < 10 < below
    both = identified(runs, signals, **changes)
    gusts = np.sqrt([found.chain.motion.correlated for found in both.sums])
    assert ((gusts > 0.2) & (gusts < 2.0)).all()


def test_terms_that_exact_runs_cannot_tell_apart_are_left_out():
    features = np.random.default_rng(1).normal(size=(50, 3))
    twins = np.hstack([features, features])
    measured = np.vstack([np.zeros((1, 1)), np.cumsum(features @ [[1.0], [2.0], [0.0]], axis=0)])
    record = (measured, np.ones_like(measured), twins, twins, twins)
    gram = _core.Regression(1, 1.0, "increment", [record]).gram([1e-6], (1e-9, 0.0, 1.0))
    both, prices_ = [(0, 1, 3), (1, 4)], np.ones(6)
    assert all(gram.solve(list(subset)) is None for subset in both)
    found = Judge(gram, prices_, {})(both)
    assert {judged.features for judged in found} == {(0, 1), (1,)}
    assert Judge(gram, prices_, {})([*both, (2,)])[0].features == (2,)


def test_where_nothing_drives_a_state_but_noise_no_term_does():
    stream = np.random.default_rng(1)
    walk = np.cumsum(0.1 * stream.normal(size=(200, 1)), axis=0)
    signals = tl.Signals([tl.State("level", "m", 1.0)], [tl.Command("u", "V", (-1.0, 1.0))], 0.1)
    run = Run.of(walk + 1e-3 * stream.normal(size=walk.shape), stream.uniform(-1.0, 1.0, (199, 1)))
    found = identified([run], signals)
    assert found.terms == 0 and len(found.members) == 3
    assert np.isfinite(found.chi_squared)


def test_a_lag_of_the_actuator_is_found():
    dt, lag = 0.02, 0.06
    stream, runs = np.random.default_rng(1), []
    signals = tl.Signals([tl.State("speed", "m/s", 3.0)], [tl.Command("u", "V", (-2.0, 2.0), scale=1.0)], dt)
    for _ in range(2):
        commands = np.repeat(stream.uniform(-2.0, 2.0, (12, 1)), 10, axis=0)
        runs.append(lagging_motor(commands, dt, lag, lambda u: 3.0 * u, stream))
    found = identified(runs, signals, lags=True, form="acceleration", longest_delay=1)
    [(time, delay, _, _)] = found.actuation.actuators
    assert time == pytest.approx(lag, rel=0.1) and delay == 0
    terms = law(found)
    assert set(terms) == {0, 1}
    assert terms[0] == pytest.approx(-0.8, rel=0.1) and terms[1] == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize("least", [0.1, -1.0])
def test_a_thruster_that_lags_by_what_no_grid_has_and_turns_round_is_found(least):
    """Its force is u |u| behind a lag of 4.1 periods, between two that are tried; `least`: of what it is ever asked."""
    dt, lag = 0.05, 0.205
    stream, runs = np.random.default_rng(4), []
    signals = tl.Signals([tl.State("speed", "m/s", 2.0)], [tl.Command("u", "1", (-1.0, 1.0), scale=1.0)], dt)
    for _ in range(2):
        commands = np.repeat(stream.uniform(least, 1.0, (16, 1)), 12, axis=0)
        runs.append(lagging_motor(commands, dt, lag, lambda u: 3.0 * u * abs(u), stream))
    found = identified(runs, signals, lags=True, form="acceleration", longest_delay=2)
    [(time, delay, _, _)] = found.actuation.actuators
    assert time == pytest.approx(lag, rel=0.02) and delay == 0
    # Where it was never asked to turn round readings do not say that it pulls then.
    rows = np.array([[0.0, -1.0], [0.0, 1.0], [1.0, 0.0]])
    np.testing.assert_allclose(found.model.program.run(rows)[:, 0], [-3.0, 3.0, -0.8], rtol=0.03)


def test_a_command_that_is_only_switched_over_acts_as_it_is():
    """Of full and reversed thrust u and u |u| are the same readings; the gains in between would not be."""
    dt, stream = 0.05, np.random.default_rng(2)
    signals = tl.Signals([tl.State("speed", "m/s", 2.0)], [tl.Command("u", "1", (-1.0, 1.0), scale=1.0)], dt)
    commands = np.repeat(stream.choice([-1.0, 1.0], (30, 1)), 8, axis=0)
    speeds = [0.0]
    for u in commands[:, 0]:
        speeds.append(speeds[-1] * np.exp(-0.8 * dt) + (1.0 - np.exp(-0.8 * dt)) / 0.8 * 3.0 * u)
    readings = np.array(speeds)[:, None]
    runs = [Run.of(readings + 1e-3 * stream.normal(size=readings.shape), commands)]
    found = identified(runs, signals, form="acceleration")
    rows = np.array([[0.0, 0.5], [0.0, -0.25]])
    np.testing.assert_allclose(found.model.program.run(rows)[:, 0], [1.5, -0.75], rtol=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_of_two_groups_of_commands_only_the_one_that_lags_is_believed_to(seed):
    dt, lag = 0.02, 0.06
    stream, runs = np.random.default_rng(seed), []
    commands = [tl.Command("heat", "W", (0.0, 4.0), scale=2.0), tl.Command("u", "V", (-2.0, 2.0), scale=1.0)]
    signals = tl.Signals([tl.State("speed", "m/s", 3.0)], commands, dt)
    for _ in range(2):
        given = np.repeat(stream.uniform((0.0, -2.0), (4.0, 2.0), (12, 2)), 10, axis=0)
        runs.append(lagging_motor(given, dt, lag, lambda heat, u: 3.0 * u + 0.7 * heat, stream))
    found = identified(runs, signals, lags=True, form="acceleration", longest_delay=1)
    at_once, late = found.actuation.actuators
    assert at_once.direct and late.lag == pytest.approx(lag, rel=0.1) and late.delay == 0


def test_a_delay_beyond_the_longest_that_is_tried_is_found_where_a_lag_stands_in():
    dt, dead, stream, runs = 0.1, 3, np.random.default_rng(2), []
    signals = tl.Signals([tl.State("level", "m", 3.0)], [tl.Command("u", "V", (-2.0, 2.0), scale=1.0)], dt)
    for _ in range(2):
        commands = np.repeat(stream.uniform(-2.0, 2.0, (12, 1)), 8, axis=0)
        acting = np.concatenate([np.full(dead, commands[0, 0]), commands[:, 0]])[: len(commands)]
        kept, level = np.exp(-0.8 * dt), [0.0]
        for u in acting:
            level.append(kept * level[-1] + (1.0 - kept) * 2.0 / 0.8 * u)
        readings = np.array(level)[:, None]
        runs.append(Run.of(readings + 1e-3 * stream.normal(size=readings.shape), commands))
    found = identified(runs, signals, lags=True, form="acceleration", longest_delay=2)
    [(time, delay, _, _)] = found.actuation.actuators
    assert delay == dead and time < 0.1 * dt
    terms = law(found)
    assert terms[0] == pytest.approx(-0.8, rel=0.02) and terms[1] == pytest.approx(2.0, rel=0.02)


def test_a_hidden_state_that_commands_fill_is_found():
    signals, runs = fans(3, fading=3.0)
    rests = [np.array([1.0, 1.0])]
    blind = identified(runs, signals, rests=rests, form="acceleration", hidden=False)
    found = identified(runs, signals, rests=rests, form="acceleration")
    [(commands, squared, rest, time, *_)] = found.actuation.hidden
    assert (list(commands), squared, rest) == ([0, 1], True, 1.0)
    assert time == pytest.approx(0.8, rel=0.1)
    assert found.description_length < blind.description_length - 100.0 and found.terms < 8
    # The residuals are noise alone; without the state it is several times as much, or a disturbance.
    assert found.misfit == pytest.approx(1.0, abs=0.2)
    assert found.chains[0].motion.correlated < 0.1 * blind.chains[0].motion.correlated
    text = tl.Twin(found.model, signals).equations(3)
    assert "d hidden / dt = left**2/2 + right**2/2 - 1 - hidden/0." in text
    assert all(len(member.hidden) == 1 for member in found.members)
    alone = identified(runs, signals, rests=rests, workers=_core.Workers(threads=1), form="acceleration")
    assert alone.model.hidden == found.model.hidden
    assert same_bits(alone.model.constants, found.model.constants)


def test_what_fills_a_hidden_state_that_never_empties_is_kept_for_no_longer_than_runs_can_show():
    dt, stream, runs = 0.1, np.random.default_rng(2), []
    signals = tl.Signals([tl.State("speed", "m/s", 3.0)], [tl.Command("u", "V", (-2.0, 2.0), scale=1.0)], dt)
    for _ in range(3):
        commands = np.repeat(stream.uniform(-2.0, 2.0, (10, 1)), 6, axis=0)
        states = [np.zeros(2)]
        for (u,) in commands:
            states.append(rk4(lambda x, u=u: np.array([x[1] - x[0] ** 3, u + 0.02 * x[1]]), states[-1], dt))
        speed = np.array(states)[:, :1]
        runs.append(Run.of(speed + 1e-3 * stream.normal(size=speed.shape), commands))
    # A pair that motion helps to fill grows as this one does.
    found = identified(runs, signals, rests=[np.zeros(1)], form="acceleration", storage=False)
    [(_, squared, _, time, *_)] = found.actuation.hidden
    assert not squared and time == pytest.approx(LONGEST_MEMORY * 60 * dt)


def test_where_nothing_is_hidden_the_law_is_as_if_nobody_had_looked():
    signals, runs = fans(2, fading=0.0)
    laws = [
        identified(runs, signals, rests=[np.ones(2)], form="acceleration", hidden=hidden)
        for hidden in (True, False)
    ]
    assert laws[0].actuation.hidden == ()
    assert same_bits(laws[0].model.constants, laws[1].model.constants)
    assert str(laws[0].model.program) == str(laws[1].model.program)
    assert laws[0].pool.nodes == laws[1].pool.nodes and laws[0].pool.rungs == laws[1].pool.rungs


def test_one_run_has_no_hidden_state():
    signals, runs = fans(1, fading=3.0)
    assert identified(runs, signals, rests=[np.ones(2)], form="acceleration").actuation.hidden == ()


def test_a_law_in_increments_is_found():
    stream = np.random.default_rng(2)
    signals = tl.Signals(
        [tl.State("x", "1", 2.0), tl.State("y", "1", 2.0)], [tl.Command("u", "1", (-1.0, 1.0))], 0.1
    )
    states, commands = [np.array([0.3, -0.5])], np.repeat(stream.uniform(-1.0, 1.0, (40, 1)), 4, axis=0)
    for u in commands[:, 0]:
        x, y = states[-1]
        states.append(states[-1] + [0.2 * y - 0.1 * x, 0.25 * u - 0.3 * y + 0.05 * x * u])
    found = identified([Run.of(np.array(states), commands)], signals)
    assert found.model.form == "increment"
    assert found.sums[0].weights.keys() == {0, 1}
    assert found.sums[1].weights.keys() == {2, 1, found.pool.product(0, 2)}
    np.testing.assert_allclose(sorted(found.model.constants), [-0.3, -0.1, 0.05, 0.2, 0.25], rtol=1e-3)


# Parts of a run


def wild(angle, rate, torque):
    return -9.0 * np.sin(angle) - 0.4 * rate * abs(rate) + 5.0 * torque * np.cos(angle)


def free_runs(members, signals, run):
    """States of members under a run's commands, of those that last (members, n + 1, n_x)."""
    twins = [tl.Twin(member, signals).simulate_commands(run.states[0], run.commands) for member in members]
    return np.stack([twin.states for twin in twins if len(twin.states) == len(run.states)])


def test_members_of_parts_know_how_far_the_law_of_one_run_carries():
    """On a wilder run errors are several times the spread without them, and less than it with them."""
    signals, ratios = pendulum_like(), {True: [], False: []}
    for seed in range(3):
        run = swung(wild, seed, start=(0.3, 0.0), noise=1e-3)
        other = swung(wild, seed + 50, start=(1.5, 0.0))
        for of_parts, found in ratios.items():
            members = identified([run], signals, seed=3, parts=of_parts, committee_size=8).members
            assert len(members) == 8
            states = free_runs(members, signals, other)
            error = np.sqrt(((states.mean(axis=0) - other.states) ** 2).mean())
            found.append(error / np.sqrt(states.var(axis=0).mean()))
    assert np.median(ratios[True]) < 2.0 < np.median(ratios[False])


def test_a_part_may_lead_to_a_shorter_description_and_never_to_a_longer_one():
    signals, saved = pendulum_like(), []
    for seed in range(3):
        run = swung(wild, seed, start=(0.3, 0.0))
        found, alone = (identified([run], signals, parts=of_parts) for of_parts in (True, False))
        saved.append(alone.description_length - found.description_length)
        if saved[-1] > 100.0:
            assert set(law(found)) >= {("sin", 0)}
    assert min(saved) >= 0.0 and max(saved) > 50.0


def test_parts_are_searched_with_the_fewest_moves_too():
    found = identified([swung(gravity, 0)], pendulum_like(), moves=LEAST_MOVES, committee_size=8)
    assert found.of_parts and np.isfinite(found.description_length)


def test_a_part_begins_with_the_effects_that_its_commands_have_there():
    signals, [run] = fans(1, fading=3.0)
    whole = Actuation((Actuator(0.06, 1, None), Actuator(0.0, 2, 0.5)))
    effects = _core.command_effects(whole.actuators, (), [1.0, 1.0], signals.dt, run.commands)[0]
    found = cut(run, signals, whole)
    assert [len(part.commands) for part, _ in found] == [105, 105, 75, 75]
    for (part, behind), first in zip(found, (0, 45, 0, 75), strict=True):
        rows = slice(first, first + len(part.commands))
        assert same_bits(part.commands, run.commands[rows])
        assert same_bits(part.states, run.states[first : rows.stop + 1])
        own = _core.command_effects(behind.actuators, (), [1.0, 1.0], signals.dt, part.commands)[0]
        # A delay of periods before the part is not in its commands; a lag goes on from where it was.
        np.testing.assert_allclose(own[2:, 1], effects[rows][2:, 1], rtol=1e-12)
        np.testing.assert_allclose(own[0], effects[rows][0], rtol=1e-12)
    short = cut(run.part(0, 30), signals, whole)
    assert [len(part.commands) for part, _ in short] == [21, 21]
    assert cut(run.part(0, 20), signals, whole) == []


def test_exact_readings_leave_the_noise_of_rounding_and_members_as_far_apart():
    signals = pendulum_like()
    rough = [swung(gravity, seed, start=(0.5 + seed, 0.0)) for seed in range(3)]
    plant = tl.Twin(identified(rough[:2], signals).model, signals)
    runs = [
        Run.of(plant.simulate_commands(run.states[0], run.commands).states, run.commands) for run in rough
    ]
    found = identified(runs[:2], signals, committee_size=8)
    assert found.misfit < 1e-6 and (found.sensors(2) > 0.0).all() and (found.sensors(2) < 1e-10).all()
    error = np.abs(free_runs([found.model], signals, runs[2])[0] - runs[2].states)
    spread = free_runs(found.members, signals, runs[2]).std(axis=0)
    expected = np.sqrt(spread**2 + found.sensors(2) ** 2)
    assert (error <= 3.0 * expected).mean() >= 0.7
    # Rounded to hundredths they are noisy again, and no less noisy than that.
    coarse = identified([Run.of(np.round(run.states, 2), run.commands) for run in runs], signals)
    assert (coarse.sensors(2) > 0.5 * 0.01 / np.sqrt(12.0)).all()
    assert [any("almost exact" in str(said) for said in one.remarks) for one in (found, coarse)] == [
        True,
        False,
    ]


def test_a_committee_of_one_is_the_best_model():
    found = identified([swung(gravity, 0)], pendulum_like(), committee_size=1)
    assert found.members == [found.model]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_outlier_is_not_learnt_from(seed):
    run = swung(gravity, seed, noise=1e-3)
    spoilt = run.states.copy()
    spoilt[40, 1] += 4.0
    clean, found = (identified([Run.of(s, run.commands)], pendulum_like()) for s in (run.states, spoilt))
    assert clean.outliers <= 1 and 1 <= found.outliers <= 2
    assert any("ignored" in str(remark) for remark in found.remarks)
    for x in ([0.3, 0.5], [1.0, -1.0]):
        one, other = (f.model.step([x], [[0.4]])[0] for f in (clean, found))
        np.testing.assert_allclose(one, other, atol=0.01)


def finite(found, signals):
    """Whether everything about an identification can be used."""
    states, commands = np.full((1, signals.n_x), 0.1), np.full((1, signals.n_u), 0.1)
    steps = [member.step(states, commands) for member in found.members]
    return all(np.isfinite(s).all() for s in steps) and np.isfinite(found.sensors(signals.n_x)).all()


def test_a_run_that_never_moves_is_handled():
    signals = pendulum_like()
    still = Run.of(np.zeros((60, 2)), np.zeros((59, 1)))
    found = identified([still], signals)
    assert finite(found, signals)
    assert np.abs(found.model.step([[0.0, 0.0]], [[0.0]])).max() < 1e-3


def test_a_state_that_is_constant_stays():
    signals = tl.Signals(
        [tl.State("x", "m", 2.0), tl.State("load", "kg", 3.0)], [tl.Command("u", "N", (-1.0, 1.0))], 0.05
    )
    stream, states = np.random.default_rng(3), [np.array([0.2, 1.5])]
    commands = np.repeat(stream.uniform(-1.0, 1.0, (20, 1)), 4, axis=0)
    for u in commands[:, 0]:
        states.append(states[-1] + [0.1 * u - 0.05 * states[-1][0], 0.0])
    found = identified([Run.of(np.array(states), commands)], signals)
    assert finite(found, signals)
    following = found.model.step([[0.5, 1.5]], [[0.4]])[0]
    np.testing.assert_allclose(following, [0.5 + 0.04 - 0.025, 1.5], atol=1e-3)


def test_commands_at_their_bounds_all_the_time_are_handled():
    signals = pendulum_like()
    run = swung(gravity, 5)
    full = Run.of(run.states, np.full_like(run.commands, 2.0))
    assert finite(identified([full], signals), signals)


def test_a_very_short_run_is_handled():
    run = swung(gravity, 6, steps=5)
    for steps in (2, 3, 5):
        short = Run.of(run.states[: steps + 1], run.commands[:steps])
        assert finite(identified([short], pendulum_like()), pendulum_like())


def test_what_was_learnt_before_is_not_changed_and_the_same_bits_come_again():
    signals, options = pendulum_like(), options_of("default", FAST)
    runs = [swung(gravity, seed, noise=1e-3) for seed in range(2)]
    first = identify_runs(runs[:1], signals, options, workers=WORKERS, iteration=1)
    before = (len(first.pool), first.model.constants, dict(first.sums[0].weights))
    later = [
        identify_runs(runs, signals, options, workers=workers, iteration=2, earlier=first)
        for workers in (WORKERS, _core.Workers(threads=2), WORKERS)
    ]
    assert len(first.pool) == before[0] and dict(first.sums[0].weights) == before[2]
    assert same_bits(first.model.constants, before[1])
    for other in later[1:]:
        assert [str(m.program) for m in other.members] == [str(m.program) for m in later[0].members]
        assert other.description_length == later[0].description_length


def test_a_model_that_a_small_change_makes_diverge_keeps_its_terms(monkeypatch):
    # Then tuning knows no covariance, and nothing can be said of a weight.
    tune = fitting.tune

    def without_covariance(*arguments, **named):
        fit, draws = tune(*arguments, **named)
        return replace(fit, covariance=fit.covariance[:0]), draws

    monkeypatch.setattr(fitting, "tune", without_covariance)
    stream = np.random.default_rng(5)
    commands = stream.uniform(-1.0, 1.0, (40, 1))
    states = np.zeros((41, 1))
    for k in range(40):
        states[k + 1] = 0.9 * states[k] + 0.3 * commands[k]
    signals = tl.Signals(
        states=[tl.State("level", "m", scale=1.0)], commands=[tl.Command("pump", "V", bounds=(-1, 1))], dt=0.5
    )
    options = IdentificationOptions(moves=1000, generations=0, committee_size=2, lags=False)
    found = identify_runs([Run.of(states, commands)], signals, options, workers=_core.Workers(1))
    assert found.terms == 2


# Declared noise


def declared(*noise, kind=pendulum_like):
    """The pendulum's signals with a declared noise of each sensor."""
    signals = kind()
    states = [replace(state, noise=sd) for state, sd in zip(signals.states, noise, strict=True)]
    return replace(signals, states=states)


@pytest.mark.parametrize("factor", [1e-200, 1e-3, 1.0, 1e3, 1e200])
def test_a_declared_noise_is_where_the_estimate_begins_and_no_more(factor):
    runs = [swung(gravity, seed, noise=2e-3) for seed in (2, 3)]
    plain = identified(runs, pendulum_like())
    told = identified(runs, declared(2e-3 * factor, 2e-3))
    assert law(told).keys() == law(plain).keys()
    for term, weight in law(plain).items():
        assert law(told)[term] == pytest.approx(weight, rel=2e-3, abs=2e-3)
    np.testing.assert_allclose(told.sensors(2), plain.sensors(2), rtol=0.1)
    said = [str(remark) for remark in told.remarks if "declared" in str(remark)]
    if factor == 1.0:
        assert said == []
    else:
        assert len(said) == 1 and "sensor of angle" in said[0] and f"{2e-3 * factor:.3g} rad" in said[0]
        assert float(said[0].split("found to be ")[1].split(";")[0]) == pytest.approx(2e-3, rel=0.3)


def test_nothing_is_said_of_a_noise_that_runs_cannot_tell():
    assert not any(
        "declared" in str(r) for r in identified([swung(gravity, 1)], declared(1e-9, 1e-9)).remarks
    )
