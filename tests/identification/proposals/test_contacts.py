"""What begins at a place: the force of a stop, the torque behind a gear's play, a valve that opens late."""

import re
from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.fit.models import layout
from twinloop.identification.records import Run
from twinloop.identification.search.drives import drive
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum
from twinloop.identification.starts import starts
from twinloop.identification.terms.hinges import (
    DAMPINGS,
    LIMITS,
    Hinge,
    begun,
    damped,
    entered,
    hinges,
    limits,
)
from twinloop.identification.terms.pool import Pool
from twinloop.law.play import FIRM

WORKERS = _core.Workers(2)
DT = 0.02
RAIL = tl.Signals(
    [tl.State("position", "m", 1.0), tl.State("velocity", "m/s", 3.0, derivative_of="position")],
    [tl.Command("force", "N", (-8.0, 8.0))],
    DT,
)
STOP, STIFFNESS = 0.6, 900.0
SHAFT = tl.Signals(
    [
        tl.State("motor", "rad", 2.0),
        tl.State("load", "rad", 2.0),
        tl.State("motor_rate", "rad/s", 10.0, derivative_of="motor"),
        tl.State("load_rate", "rad/s", 10.0, derivative_of="load"),
    ],
    [tl.Command("torque", "N m", (-0.6, 0.6))],
    DT,
)
PLAY = 0.06


def flown(derivative, start, commands, signals, noise, seed):
    """A run in forty steps of Runge and Kutta's method a period."""
    x, states, h = np.array(start), [np.array(start)], DT / 40
    for u in commands:
        for _ in range(40):
            k1 = derivative(x, u)
            k2 = derivative(x + 0.5 * h * k1, u)
            k3 = derivative(x + 0.5 * h * k2, u)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + derivative(x + h * k3, u))
        states.append(x)
    readings = np.array(states) + noise * np.random.default_rng(seed).standard_normal(
        (len(states), len(start))
    )
    return tl.Trajectory(DT * np.arange(len(states)), readings, np.array(commands)[:, None])


def on_the_rail(x, u):
    depth = max(0.0, x[0] - STOP)
    return np.array([x[1], u - 0.8 * x[1] - STIFFNESS * depth])


def behind_play(x, u):
    twist = x[0] - x[1]
    torque = 20.0 * (max(0.0, twist - PLAY) - max(0.0, -twist - PLAY)) + 0.05 * (x[2] - x[3]) * (
        abs(twist) > PLAY
    )
    return np.array([x[2], x[3], (u - torque - 0.05 * x[2]) / 0.02, (torque - 0.04 * x[3]) / 0.03])


def pushed(amplitude, seed, steps=150, held=10):
    stream = np.random.default_rng(seed)
    return np.repeat(stream.uniform(-amplitude, amplitude, steps // held), held)


def places(twin):
    law = twin.equations(4)
    damped = [float(text) / FIRM for text in re.findall(r"Max\(Min\([^,]*? [-+] ([0-9.]+), ", law)]
    return [*damped, *(float(text) for text in re.findall(r"Max\([^,]*? [-+] ([0-9.]+), 0\)", law))]


def free_run_error(twin, derivative, start, commands, signals):
    """Mean square over that of standing still, on a run that nobody has learnt."""
    truth = flown(derivative, start, commands, signals, 0.0, 0)
    free = twin.simulate_commands(truth.states[0], truth.commands)
    if len(free.states) < len(truth.states):
        return np.inf
    scales = np.array([state.scale for state in signals.states])
    off = np.square((free.states - truth.states) / scales).mean()
    return off / np.square((truth.states - truth.states[0]) / scales).mean()


def test_a_stop_is_found_where_it_is():
    runs = [
        flown(on_the_rail, (0.0, 0.0), pushed(6.0, seed) + 1.5, RAIL, [1e-3, 1e-2], seed) for seed in (1, 2)
    ]
    assert all(run.states[:, 0].max() > STOP + 0.01 for run in runs)

    twin = tl.identify(runs, RAIL, seed=0)
    without = tl.identify(runs, RAIL, seed=0, options={"contacts": False, "storage": False})

    assert min(abs(place - STOP) for place in places(twin)) < 0.01
    unseen = pushed(6.0, 3) + 1.5
    error = free_run_error(twin, on_the_rail, (0.0, 0.0), unseen, RAIL)
    assert error < 0.01
    assert error < 0.1 * free_run_error(without, on_the_rail, (0.0, 0.0), unseen, RAIL)


def test_a_stop_of_rubber_is_a_spring_and_a_damper_that_never_pull():
    damping = 18.0

    def on_rubber(x, u):
        push = max(0.0, STIFFNESS * (x[0] - STOP) + damping * x[1]) if x[0] > STOP else 0.0
        return np.array([x[1], u - 0.8 * x[1] - push])

    runs = [
        flown(on_rubber, (0.0, 0.0), pushed(6.0, seed) + 1.5, RAIL, [1e-3, 1e-2], seed) for seed in (1, 2)
    ]
    twin = tl.identify(runs, RAIL, seed=0)

    law = twin.equations(4)
    (stiffness,) = re.findall(r"- ([0-9.]+)\*Max\(Min\(", law)
    ((held, place),) = re.findall(r"\+ ([0-9.]+)\*velocity.*\n *- ([0-9.]+)\n", law)
    assert float(place) == pytest.approx(STOP, abs=0.002)
    assert float(stiffness) == pytest.approx(STIFFNESS, rel=0.1)
    assert float(held) == pytest.approx(damping / STIFFNESS, rel=0.15)
    assert "hidden" not in law
    assert free_run_error(twin, on_rubber, (0.0, 0.0), pushed(6.0, 3) + 1.5, RAIL) < 0.02


def test_play_is_found_between_two_states():
    runs = [
        flown(behind_play, (0.0,) * 4, pushed(0.4, seed), SHAFT, [1e-3, 1e-3, 1e-2, 1e-2], seed)
        for seed in (1, 2)
    ]

    twin = tl.identify(runs, SHAFT, seed=0)

    # In units of the angles' scale, which is 2 rad.
    assert min(abs(2.0 * place - PLAY) for place in places(twin)) < 0.01
    assert free_run_error(twin, behind_play, (0.0,) * 4, pushed(0.4, 3), SHAFT) < 0.02


CORNER = tl.Signals(
    [
        tl.State("body", "m", 0.1),
        tl.State("wheel", "m", 0.1),
        tl.State("body_rate", "m/s", 1.0, derivative_of="body"),
        tl.State("wheel_rate", "m/s", 1.0, derivative_of="wheel"),
    ],
    [tl.Command("actuator", "N", (-2.0, 2.0))],
    DT,
)
BUMP, REBOUND, ROAD = 2.0, 6.0, 0.02


def on_a_damper(x, u):
    """A body on a wheel, whose damper holds back three times as much apart as together, and whose tyre can lift off."""
    apart = x[2] - x[3]
    pull = 40.0 * (x[0] - x[1]) + (REBOUND if apart > 0.0 else BUMP) * apart - 4.0 * u
    return np.array([x[2], x[3], -pull, 4.0 * pull - 500.0 * min(x[1], ROAD) - 4.0 * x[3]])


def test_a_damper_is_found_that_holds_back_less_one_way_and_a_tyre_that_lifts_off():
    runs = [
        flown(on_a_damper, (0.05, 0.0, 0.0, 0.0), pushed(2.0, seed), CORNER, [1e-4, 1e-4, 1e-3, 1e-3], seed)
        for seed in (1, 2)
    ]
    assert all(0.1 < np.mean(run.states[:, 1] > ROAD) < 0.9 for run in runs)

    twin = tl.identify(runs, CORNER, seed=0)
    without = tl.identify(runs, CORNER, seed=0, options={"contacts": False})

    unseen = pushed(2.0, 3)
    error = free_run_error(twin, on_a_damper, (0.05, 0.0, 0.0, 0.0), unseen, CORNER)
    assert error < 1e-4
    assert error < 0.1 * free_run_error(without, on_a_damper, (0.05, 0.0, 0.0, 0.0), unseen, CORNER)
    for side in (1.0, -1.0):
        linear = twin.linearise(at=np.array([0.0, 0.0, 0.3 * side, 0.0]), command=np.zeros(1))
        np.testing.assert_allclose(
            linear.A[2, 2:], np.array([-1.0, 1.0]) * (REBOUND if side > 0.0 else BUMP), rtol=0.02
        )


def test_hinges_of_rates_are_of_differences_at_rest_and_where_valves_open():
    stream = np.random.default_rng(0)
    rows = np.column_stack([stream.uniform(-1.0, 1.0, (200, 3)), stream.uniform(0.2, 1.0, (200, 2))])
    found = [hinge for hinge in hinges(CORNER, rows) if {2, 3} & set(hinge.inputs)]
    apart = rows[:, 2] - rows[:, 3]

    assert {hinge.inputs for hinge in found} == {(2, 3)} and all(not hinge.rates for hinge in found)
    assert [hinge.side for hinge in found if hinge.place == 0.0] == [1]
    assert {hinge.side for hinge in found if hinge.place != 0.0} == {1, -1}
    # Each is 0 for some of the readings, and grows for others.
    assert all(0 < (hinge.side * (apart - hinge.place) > 0.0).sum() < len(rows) for hinge in found)


def test_a_limited_power_is_found():
    road = tl.Signals([tl.State("speed", "m/s", 10.0)], [tl.Command("throttle", "1", (0.0, 1.0))], DT)

    def on_the_road(x, u):
        return np.array([9.0 * min(u, 4.0 / x[0]) - 0.6 * x[0]])

    def driven(seed):
        return np.clip(0.5 + pushed(0.5, seed, steps=400, held=25), 0.2, 1.0)

    runs = [flown(on_the_road, (6.0,), driven(seed), road, [1e-2], seed) for seed in (1, 2)]
    limited = [run.commands[:, 0] * run.states[1:, 0] > 4.0 for run in runs]
    assert all(0.1 < np.mean(each) < 0.9 for each in limited)

    twin = tl.identify(runs, road, seed=0)
    without = tl.identify(runs, road, seed=0, options={"contacts": False})

    assert min(abs(10.0 * place - 4.0) for place in places(twin)) < 0.1
    error = free_run_error(twin, on_the_road, (6.0,), driven(3), road)
    assert error < 1e-4
    assert error < 0.1 * free_run_error(without, on_the_road, (6.0,), driven(3), road)


SERVO = tl.Signals([tl.State("angle", "rad", 1.0)], [tl.Command("asked", "1", (-1.2, 1.2))], DT)
PUSHED_BALL = tl.Signals(
    [*SERVO.states, tl.State("place", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="place")],
    SERVO.commands,
    DT,
)


def turning(x, u):
    """It turns 5 rad/s at most."""
    return np.array([np.clip((u - x[0]) / 0.06, -5.0, 5.0)])


def pushing_a_ball(x, u):
    return np.array([*turning(x, u), x[2], 3.0 * x[0] - 0.3 * x[2]])


@pytest.mark.parametrize(
    ("signals", "plant", "noise"),
    [(SERVO, turning, [2e-3]), (PUSHED_BALL, pushing_a_ball, [2e-3, 1e-3, 5e-3])],
)
def test_a_servo_that_turns_only_so_fast_is_found(signals, plant, noise):
    start = (0.0,) * signals.n_x
    for seed in (0, 10):
        runs = [
            flown(plant, start, pushed(1.0, seed + i, held=15), signals, noise, seed + i) for i in range(2)
        ]

        twin = tl.identify(runs, signals, seed=0)
        without = tl.identify(runs, signals, seed=0, options={"contacts": False})

        unseen = pushed(1.0, 99, held=15)
        error = free_run_error(twin, plant, start, unseen, signals)
        assert error < 1e-5
        assert error < 0.02 * free_run_error(without, plant, start, unseen, signals)


def accelerating(x, u):
    """It follows six times its command by 3 m/s² at most, which it does most of the time."""
    return np.array([np.clip(2.0 * (6.0 * u - x[0]), -3.0, 3.0)])


def opening(x, u):
    """A valve that opens three times as fast as it closes."""
    return np.array([np.clip(8.0 * (u - x[0]), -0.5, 1.5)])


@pytest.mark.parametrize(("plant", "proportion"), [(turning, 1.2), (accelerating, 7.2), (opening, 1.2)])
def test_in_which_proportion_inputs_drive_through_a_limit_shows_where_they_drive_least(plant, proportion):
    run = flown(plant, (0.0,), pushed(1.0, 0, steps=300, held=25), SERVO, [1e-3], 0)
    context = Context([Run.of(run.states, run.commands)], SERVO, options_of("default", {}), Unit(0), WORKERS)
    start = starts(context, "acceleration")[0]()
    problem, chain = Problem(context, start), start.driven[0]
    regression = problem.regression(chain, problem.values(problem.usable([0, 1])))
    everywhere, _, _ = regression.gram(chain.sensors, chain.motion, WORKERS).solve([0, 1])
    found = drive(problem, chain, [0, 1])
    # A command of 1.2 is 1 for a model.
    assert found[1] / found[0] == pytest.approx(-proportion, rel=0.05)
    assert abs(found[1] / found[0] + proportion) < 0.5 * abs(everywhere[1] / everywhere[0] + proportion)


VALVE = tl.Signals(
    [tl.State("flow", "l/s", 1.0), tl.State("level", "m", 1.0)], [tl.Command("valve", "%", (0.0, 100.0))], DT
)


def filling(x, u):
    """A valve that opens three times as fast as it closes fills a tank."""
    return np.array([np.clip(8.0 * (0.02 * u - x[0]), -0.5, 1.5), 0.5 * x[0] - 0.4 * np.sqrt(x[1])])


@pytest.mark.parametrize(
    ("plant", "signals", "start", "middle", "most", "noise"),
    [
        (accelerating, SERVO, (0.0,), 0.0, 1.0, [1e-2]),
        (filling, VALVE, (1.0, 1.0), 50.0, 45.0, [3e-3, 3e-3]),
    ],
)
def test_what_is_limited_most_of_the_time_or_to_one_side_more_is_found(
    plant, signals, start, middle, most, noise
):
    runs = [
        flown(plant, start, middle + pushed(most, i, steps=200, held=25), signals, noise, i) for i in range(2)
    ]
    twin = tl.identify(runs, signals, seed=0)
    without = tl.identify(runs, signals, seed=0, options={"contacts": False})
    unseen = middle + pushed(most, 99, steps=200, held=25)
    error = free_run_error(twin, plant, start, unseen, signals)
    assert error < 1e-3
    assert error < 0.01 * free_run_error(without, plant, start, unseen, signals)


def test_hinges_of_a_drive_do_not_depend_on_units_and_leave_out_what_hardly_counts():
    inputs = np.random.default_rng(0).normal(size=(200, 3))
    values = []
    for factor in (1.0, 2.0**9):
        pool, seen = Pool(3), inputs * [factor, 1.0, 1.0]
        found = limits([{0: -3.0 / factor, 1: 0.01, 2: 5.0}, {1: 7.0, 2: 0.1}], seen)
        terms = [entered(pool, hinge, 100) for hinge in found]
        assert all(set(pool.leaves(term)) <= {0, 2, None} for term in terms) and len(set(terms)) == 4 * LIMITS
        values.append(pool.values(terms, seen))
    np.testing.assert_array_equal(*values)
    driven = -3.0 * inputs[:, 0] + 5.0 * inputs[:, 2]
    for hinge, column in zip(found, values[0].T, strict=True):
        place = hinge.place * np.abs(driven).max()
        above, below = np.maximum(0.0, driven - place), np.maximum(0.0, -driven - place)
        expected = above if hinge.side else above - below
        np.testing.assert_allclose(column * np.abs(driven).max(), expected, atol=1e-12)


def test_a_linear_plant_has_no_hinge():
    def slope(x, u):
        return np.array([x[1], u - 0.8 * x[1] - 3.0 * x[0]])

    runs = [flown(slope, (0.0, 0.0), pushed(6.0, seed), RAIL, [1e-3, 1e-2], seed) for seed in (1, 2)]
    assert "Max" not in tl.identify(runs, RAIL, seed=0).equations(4)


def test_a_hinge_is_nothing_on_one_side_and_grows_on_the_other():
    pool, inputs = Pool(3), np.random.default_rng(0).uniform(-1.0, 1.0, (200, 3))
    terms = [entered(pool, hinge, 100) for hinge in hinges(RAIL, inputs)]
    values = pool.values(terms, inputs)

    assert len(terms) == len(set(terms)) > 0
    position = inputs[:, 0]
    of_position = [i for i, term in enumerate(terms) if set(pool.leaves(term)) <= {0, None}]
    assert of_position
    for i in of_position:
        column = values[:, i]
        assert (column >= 0.0).all() and (column == 0.0).any()
        beyond = column > 0.0
        # With the position, or against it, one for one.
        slope = np.polyfit(position[beyond], column[beyond], 1)[0] if beyond.sum() > 1 else 1.0
        assert abs(slope) == pytest.approx(1.0)
    # A command of two signs has one that is alike on both sides.
    (of_force, *_) = [term for term in terms if set(pool.leaves(term)) <= {2, None}]
    mirrored = inputs * [1.0, 1.0, -1.0]
    np.testing.assert_array_equal(pool.values([of_force], mirrored), -pool.values([of_force], inputs))


@pytest.mark.parametrize("scale", [1.0, 2.0**9])
@pytest.mark.parametrize("side", [1, -1, 0])
def test_a_damped_hinge_is_what_a_spring_and_a_damper_push_with(side, scale):
    signals = tl.Signals(
        [
            tl.State("position", "m", 2.0 * scale),
            tl.State("velocity", "m/s", 3.0 * scale, derivative_of="position"),
        ],
        RAIL.commands,
        DT,
    )
    inputs = np.random.default_rng(0).uniform(-1.0, 1.0, (500, 3))
    place = -0.2 if side < 0 else 0.2
    bare = Hinge((0,), (0.5 / scale,), (), side, place)
    # With its rate or without, it is the same place.
    several = damped([bare, replace(bare, rates=(1,))], signals)
    assert [one.damping for one in several] == [share * DT for share in DAMPINGS]
    pool = Pool(3)
    terms = [entered(pool, one, 100) for one in several]
    values = pool.values(terms, inputs * [scale, scale, 1.0])
    for one, column in zip(several, values.T, strict=True):
        expected = []
        for x, v in 0.5 * inputs[:, :2]:
            above = max(0.0, min(100.0 * (x - place), x - place + one.damping * v))
            less = -place if side == 0 else place
            below = max(0.0, min(100.0 * (less - x), less - x - one.damping * v))
            expected.append({1: above, -1: below, 0: above - below}[side])
        np.testing.assert_allclose(column, expected, atol=1e-12)
    # One number more than without, that was estimated.
    assert [pool.length(term) for term in terms] == [pool.length(entered(pool, bare, 100)) + 5.0] * len(terms)
    of_command = Hinge((2,), (1.0,), (), 1, 0.3)
    assert damped([of_command, replace(bare, place=0.0)], signals) == []


def test_hinges_are_read_off_terms_that_are_there():
    pool, first = Pool(3), Hinge((0,), (1.0,), (), 1, 0.4)
    second = replace(first, side=-1, place=-0.7)
    terms = [entered(pool, first, 9), pool.product(1, entered(pool, second, 9)), pool.add("max", 1, 0.0), 2]
    assert begun(pool, terms, RAIL) == [first, second]
    assert begun(pool, [entered(pool, Hinge((2,), (1.0,), (), 1, 0.3), 9)], RAIL) == []


def test_what_is_made_of_a_hinge_costs_what_its_place_does():
    pool, hinge = Pool(3), Hinge((0,), (1.0,), (), 1, 0.4)
    inside = pool.add("max", pool.add("-", pool.share(0, 1.0), 0.4), 0.0)
    wrapped, product = pool.add("sin", inside), pool.product(2, inside)
    before = [pool.length(node) for node in (inside, wrapped, product)]
    assert entered(pool, hinge, 100) == inside
    more = pool.length(inside) - before[0]
    assert more > 5.0
    assert [pool.length(node) for node in (wrapped, product)] == [before[1] + more, before[2] + more]
    # A square that is dearer than it is written is not a place.
    square = pool.product(1, 1)
    cubic = pool.length(pool.product(square, 2))
    pool.found[square] = 10.0
    assert pool.length(pool.product(square, 2)) == cubic


@pytest.mark.parametrize("least", [-1.0, 0.5])
@pytest.mark.parametrize("factor", [2.0**20, 2.0**-7])
def test_hinges_do_not_depend_on_units(factor, least):
    inputs = np.random.default_rng(0).uniform(least, 1.0, (200, 3))
    other = tl.Signals(
        [
            tl.State("position", "m", factor),
            tl.State("velocity", "m/s", 3.0 * factor, derivative_of="position"),
        ],
        RAIL.commands,
        DT,
    )
    values = []
    for signals, scale in ((RAIL, 1.0), (other, factor)):
        pool, seen = Pool(3), inputs * [scale, scale, 1.0]
        found = hinges(signals, seen)
        terms = [entered(pool, hinge, 100) for hinge in found]
        # Times a rate; a power is over the speed again.
        rated = [bool(hinge.rates) for hinge in found]
        values.append(pool.values(terms, seen) / np.where(rated, scale, 1.0))
    np.testing.assert_array_equal(*values)


def test_the_zero_of_a_hinge_is_no_constant_to_be_tuned():
    class Held:
        def __init__(self, pool, term):
            self.pool, self.form = pool, "acceleration"
            chain = type("Chain", (), {"states": (1,)})
            self.sums = (Sum({term: 1.0}, 0.0, chain),)
            self.candidates = type("C", (), {"priors": type("P", (), {"fixed": {}})})

    pool = Pool(3)
    term = pool.add("max", pool.add("-", 0, 0.6), 0.0)
    free, weights = layout(Held(pool, term))

    # Of 0.6, 0 and the weight, the first and the last may move.
    assert free == [0, 2] and weights == [range(2, 3)]
