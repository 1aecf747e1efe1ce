"""Poles: a denominator may not vanish in the envelope, whether or not a run has been there."""

import numpy as np
import pytest

import twinloop as tl
from problems import problem_of
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.search.poles import room, vanishes_nowhere
from twinloop.identification.search.quotients import with_quotients
from twinloop.identification.search.structure import Sum
from twinloop.identification.search.walks import Walks
from twinloop.identification.sensors.chains import chains
from twinloop.identification.terms.denominators import denominators
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
    assert room(signals, states) == ((-2, 2), (-1, 1), (0, 2), (-2, 0), (-1, 1), (-180, 180))


@pytest.mark.parametrize(("highest", "clear"), [(3.0, True), (3.4, False)])
def test_a_pole_between_states_is_seen(highest, clear):
    pool = Pool(3)
    bounds = ((0.0, highest), (0.0, highest), (0.0, 1.0))
    assert vanishes_nowhere(pool, ((pool.product(0, 1), -0.1),), bounds) is clear
    assert vanishes_nowhere(pool, ((pool.product(0, 0), -0.1),), bounds) is clear
    assert vanishes_nowhere(pool, ((pool.product(0, 0), 0.1),), bounds)
    assert vanishes_nowhere(pool, ((pool.product(0, 0), -0.1),), ())


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
