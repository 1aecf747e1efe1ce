"""Dry friction: a width that is found, friction that falls once the motion has set in, and none where there is none."""

import re

import numpy as np
import pytest

import twinloop as tl
from twinloop.identification.terms.friction import entered, frictions, upright
from twinloop.identification.terms.pool import Pool

DT = 0.02
SLIDE = tl.Signals(
    [tl.State("position", "m", 1.0), tl.State("velocity", "m/s", 10.0, derivative_of="position")],
    [tl.Command("force", "N", (-8.0, 8.0))],
    DT,
)
DRY, WIDTH = 2.0, 0.08
BREAKAWAY, FALLEN = 3.5, 0.4
NOISE = np.array([1e-3, 1e-2])


def rubbing(x, u):
    return np.array([x[1], u - 0.5 * x[1] - DRY * np.tanh(x[1] / WIDTH)])


def breaking_away(x, u):
    dry = DRY + (BREAKAWAY - DRY) * np.exp(-((x[1] / FALLEN) ** 2))
    return np.array([x[1], u - 0.5 * x[1] - dry * np.tanh(x[1] / WIDTH)])


def sliding(x, u):
    return np.array([x[1], u - 0.8 * x[1]])


def flown(derivative, commands, seed, gusts=0.0):
    """A run in forty steps of Runge and Kutta's method a period, with a force that lasts for half a second."""
    stream = np.random.default_rng(seed)
    x, states, h, gust = np.zeros(2), [np.zeros(2)], DT / 40, 0.0
    for u in commands:
        gust = gust * np.exp(-DT / 0.5) + gusts * stream.standard_normal() * np.sqrt(
            1.0 - np.exp(-2.0 * DT / 0.5)
        )
        for _ in range(40):
            k1 = derivative(x, u + gust)
            k2 = derivative(x + 0.5 * h * k1, u + gust)
            k3 = derivative(x + 0.5 * h * k2, u + gust)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + derivative(x + h * k3, u + gust))
        states.append(x)
    readings = np.array(states) + NOISE * stream.standard_normal((len(states), 2))
    return tl.Trajectory(DT * np.arange(len(states)), readings, np.array(commands)[:, None])


def pushed(seed, steps=150, held=10):
    """Forces that move it, let it stick and turn it round."""
    return np.repeat(np.random.default_rng(seed).uniform(-8.0, 8.0, steps // held), held)


def runs_of(derivative, gusts=0.0):
    return [flown(derivative, pushed(seed), seed, gusts) for seed in (1, 2)]


def free_run_error(twin, derivative):
    """Mean square over that of standing still, on a run that nobody has learnt."""
    commands = pushed(3)
    x = flown(derivative, commands, 3)
    free = twin.simulate_commands(np.zeros(2), x.commands)
    scales = np.array([state.scale for state in SLIDE.states])
    return np.square((free.states - x.states) / scales).mean() / np.square(x.states / scales).mean()


def test_dry_friction_is_found_with_its_width_and_no_disturbance_is_left():
    twin = tl.identify(runs_of(rubbing), SLIDE, seed=0)

    ((weight, slope),) = re.findall(r"([-+] [0-9.]+)\*tanh\(([0-9.]+)\*velocity\)", twin.equations(5))
    assert float(weight.replace(" ", "")) == pytest.approx(-DRY, rel=0.02)
    assert 1.0 / float(slope) == pytest.approx(WIDTH, rel=0.05)
    assert not twin.noise.correlated
    assert free_run_error(twin, rubbing) < 1e-4


def test_friction_that_falls_once_it_moves_is_followed():
    runs = runs_of(breaking_away)
    # No evolved terms: of enough of them any curve can be made.
    twin, without = (
        tl.identify(runs, SLIDE, seed=0, options={"generations": 0, "friction": friction})
        for friction in (True, False)
    )
    assert not twin.noise.correlated
    error = free_run_error(twin, breaking_away)
    assert error < 1e-3
    assert error < 0.2 * free_run_error(without, breaking_away)


@pytest.mark.parametrize("gusts", [0.0, 0.5])
def test_what_slides_freely_has_none_whatever_disturbs_it(gusts):
    assert "tanh" not in tl.identify(runs_of(sliding, gusts), SLIDE, seed=0).equations(4)


def test_where_a_coefficient_is_bounded_no_friction_evades_the_bound():
    from_libraries = {"libraries": ("linear",), "generations": 0}
    free, bounded = (
        tl.identify(runs_of(rubbing), SLIDE, seed=0, options={**from_libraries, **bounds}).equations(4)
        for bounds in ({}, {"bounded_terms": ("velocity: velocity in -1 .. 0",)})
    )
    assert "tanh" in free
    assert "tanh" not in bounded


@pytest.mark.parametrize("factor", [2.0**20, 2.0**-7])
def test_friction_does_not_depend_on_units(factor):
    inputs = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 3))
    other = tl.Signals(
        [
            tl.State("position", "m", factor),
            tl.State("velocity", "m/s", 10.0 * factor, derivative_of="position"),
        ],
        SLIDE.commands,
        DT,
    )
    values = []
    for signals, scale in ((SLIDE, 1.0), (other, factor)):
        pool, seen = Pool(3), inputs * [scale, scale, 1.0]
        every = list(frictions(signals, seen))
        values.append(pool.values([entered(pool, each, len(every), 100) for each in every], seen))
    assert values[0].shape[1] > 0
    np.testing.assert_array_equal(*values)


def test_a_speed_that_never_turned_round_has_no_friction_to_be_told_from_a_constant():
    inputs = np.random.default_rng(0).uniform(0.1, 1.0, (200, 3))
    assert not list(frictions(SLIDE, inputs))


def test_friction_against_a_negative_slope_is_written_with_a_positive_one():
    pool, inputs = Pool(3), np.random.default_rng(0).uniform(-1.0, 1.0, (50, 3))
    backwards = pool.add("tanh", pool.add("*", pool.share(1, 2.0), -7.0))
    node, sign = upright(pool, backwards)
    np.testing.assert_array_equal(sign * pool.values([node], inputs), pool.values([backwards], inputs))
    assert upright(pool, node) == (node, 1)
    assert sign == -1
