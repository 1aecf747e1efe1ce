"""Poles: a denominator may not vanish in the envelope, whether or not a run has been there."""

import numpy as np
import pytest

import twinloop as tl
from problems import problem_of
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.search.poles import divides, room, vanishes_nowhere
from twinloop.identification.search.quotients import with_quotients
from twinloop.identification.search.structure import Sum
from twinloop.identification.search.walks import Walks
from twinloop.identification.sensors.chains import chains
from twinloop.identification.terms.denominators import Denominator, alone, denominators
from twinloop.identification.terms.pool import Pool

WORKERS = _core.Workers(1)
COMMAND = tl.Command("u", "1", (0.0, 1.0))


def test_a_law_is_to_hold_in_the_envelope_and_where_the_runs_were():
    signals = tl.Signals(
        [
            tl.State("inside", "1", 1.0, envelope=(-2.0, 2.0)),
            tl.State("beyond", "1", 1.0, envelope=(-0.5, 0.5)),
            tl.State("content", "1", 1.0, envelope=(-2.0, 2.0)),
            tl.State("debt", "1", 1.0, envelope=(-2.0, 2.0)),
            tl.State("bare", "1", 1.0),
            tl.State("angle", "deg", 1.0, periodic=360.0),
        ],
        [COMMAND],
        0.1,
    )
    seen = np.linspace(-1.0, 1.0, 50)[:, np.newaxis]
    states = seen * [1.0, 1.0, 0.0, 0.0, 1.0, 1.0] + [0.0, 0.0, 0.3, -0.3, 0.0, 0.0]
    assert room(signals, states) == ((-2, 2), (-1, 1), (0, 2), (-2, 0), (-1, 1), (-180, 180), (0, 1))


def test_a_command_may_be_all_that_it_is_allowed_to_be_in_units_of_its_scale():
    commands = [
        tl.Command("duty", "1", (0.0, 0.5)),
        tl.Command("torque", "N m", (-2.0, 4.0), scale=2.0),
    ]
    signals = tl.Signals([tl.State("x", "1", 1.0, envelope=(-1.0, 1.0))], commands, 0.1)
    assert room(signals, np.zeros((9, 1)))[1:] == ((0, 1), (-1, 2))


def test_what_may_be_0_is_nothing_to_divide_by():
    # A level that is never below 0, a place on either side of it; commands that may be 0 and one that may not.
    pool, bounds = Pool(5), ((0.0, 3.0), (-1.0, 2.0), (0.0, 1.0), (-1.0, 1.0), (0.1, 1.0))
    above_two = pool.add("-", 1, 2.1)
    sum_ = pool.add("+", 0, pool.add("abs", 1))
    allowed = [0, 4, pool.product(0, 0), pool.product(0, 4), above_two, sum_, pool.add("cos", 2)]
    refused = [1, 2, 3, pool.product(0, 2), pool.product(1, 1), pool.add("sqrt", 2), pool.add("-", 0, 4)]
    assert [divides(pool, node, 2, bounds) for node in allowed] == [True] * len(allowed)
    assert [divides(pool, node, 2, bounds) for node in refused] == [False] * len(refused)
    # What is hidden begins at 0; where nothing is known of the room, nothing is refused.
    assert not divides(pool, pool.hidden(0), 2, bounds)
    assert all(divides(pool, node, 2, ()) for node in (*refused, pool.hidden(0)))


@pytest.mark.parametrize(("highest", "clear"), [(3.0, True), (3.4, False)])
def test_a_pole_between_states_is_seen(highest, clear):
    pool = Pool(3)
    bounds = ((0.0, highest), (0.0, highest), (0.0, 1.0))
    assert vanishes_nowhere(pool, Denominator(((pool.product(0, 1), -0.1),)), bounds) is clear
    assert vanishes_nowhere(pool, Denominator(((pool.product(0, 0), -0.1),)), bounds) is clear
    assert vanishes_nowhere(pool, Denominator(((pool.product(0, 0), 0.1),)), bounds)
    assert vanishes_nowhere(pool, Denominator(((pool.product(0, 0), -0.1),)), ())


def test_a_room_may_end_where_a_state_alone_vanishes_but_not_go_beyond():
    pool = Pool(3)
    for single in alone(pool, 0, 2.0):
        assert vanishes_nowhere(pool, single, ((0.0, 3.0), (-1.0, 1.0)))
        assert vanishes_nowhere(pool, single, ((0.5, 3.0), (-1.0, 1.0)))
    assert not vanishes_nowhere(pool, alone(pool, 1, 2.0)[0], ((0.0, 3.0), (-1.0, 1.0)))


@pytest.mark.parametrize(("highest", "found"), [(1.8, True), (4.0, False)])
def test_no_quotient_has_a_pole_in_the_room_of_its_states(highest, found):
    signals = tl.Signals([tl.State("x", "1", 1.0, envelope=(0.0, highest))], [COMMAND], 0.02)
    # Solves dx/dt = 0.3 / (1 - 0.5 x), which has its pole at 2, from x = 0.0975 on.
    x = 2.0 - 2.0 * np.sqrt(1.0 - 0.095 - 0.3 * signals.dt * np.arange(120))
    run = Run.of(x[:, np.newaxis], np.zeros((len(x) - 1, 1)))
    problem = problem_of(signals, run)
    pool = problem.pool
    (chain,) = chains(signals, "acceleration", guessed_noise([run], np.ones(1)))
    terms = [pool.one, 0, pool.product(0, 0)]
    problem.usable(terms)
    gram = problem.regression(chain, problem.values(terms)).gram(chain.sensors, chain.motion, WORKERS)
    weights, _, residual = gram.solve([0, 1, 2], 1e-9)
    known = Sum(dict(zip(terms, weights.tolist(), strict=True)), residual + 200.0, chain)
    (sum_,) = with_quotients(problem, signals, [known], (), Walks(12_500, 16, Unit(0, (1,))))
    below = denominators(pool, sum_.weights)
    assert bool(below) is found
    assert all(vanishes_nowhere(pool, each, problem.room) for each in below)
