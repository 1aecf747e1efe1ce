"""Libraries: an angle is an angle in whatever unit it is logged."""

import math

import numpy as np
import pytest

import twinloop as tl
from twinloop.identification.terms.denominators import below
from twinloop.identification.terms.joints import masses
from twinloop.identification.terms.libraries import LIBRARIES, angles, rungs, trigonometric
from twinloop.identification.terms.pool import Pool


def arm(unit, periodic=False):
    turn = {"rad": 2.0 * math.pi}.get(unit, 360.0)
    states = [tl.State(name, unit, turn / 4.0, periodic=periodic and turn) for name in ("shoulder", "elbow")]
    return tl.Signals(states, [tl.Command("torque", "N m", (-1.0, 1.0))], 0.01), turn


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("unit", ["deg", "degrees", "°"])
@pytest.mark.parametrize("library", [trigonometric, below, masses])
def test_degrees_have_the_sines_and_cosines_that_radians_have(library, unit, periodic):
    poses = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 2))
    values = []
    for signals, turn in (arm(unit, periodic), arm("rad", periodic)):
        pool = Pool(3)
        found = library(pool, signals)
        rows = np.hstack([turn * poses, np.full((20, 1), 0.5)])
        # Products with an angle itself differ by its unit.
        values.append(pool.values([node for node in found if not _times_angle(pool, node)], rows))
    assert values[0].shape == values[1].shape
    assert np.allclose(*values, atol=1e-12)


def _times_angle(pool, node):
    return pool[node].operation == "*" and bool({0, 1} & set(pool[node].operands))


def test_a_turn_costs_nothing_and_is_no_constant_that_tuning_moves():
    lengths = []
    for unit in ("deg", "rad"):
        signals, _ = arm(unit)
        pool = Pool(3)
        waves = trigonometric(pool, signals)
        lengths.append([pool.length(node) for node in waves])
        assert all(None not in pool.leaves(node) for node in waves)
    assert lengths[0] == lengths[1]


def test_other_units_are_no_angles():
    signals = tl.Signals(
        [tl.State("a", "degC", 1.0), tl.State("b", "m", 1.0)], [tl.Command("u", "V", (0.0, 1.0))], 0.1
    )
    assert angles(signals) == set()
    assert rungs(Pool(3), signals, LIBRARIES, 450)


@pytest.mark.parametrize(
    ("unit", "moves"),
    [("m/s", True), ("deg/s", True), ("L/min", True), ("rpm", True), ("m", False), ("K", False)],
)
def test_what_is_per_time_is_likelier_slowed_both_ways_than_driven_on_by_its_square(unit, moves):
    signals = tl.Signals([tl.State("x", unit, 1.0)], [tl.Command("u", "V", (0.0, 1.0))], 0.1)
    pool = Pool(2)
    rungs(pool, signals, ("quadratic", "damping"), 450)
    square, slowed = pool.product(0, 0), pool.product(pool.add("abs", 0), 0)
    assert (pool.length(square) > pool.length(slowed)) is moves
