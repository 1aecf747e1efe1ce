"""Support: terms that are zero on most readings are no more than these bear."""

import numpy as np
import pytest

import twinloop as tl
from problems import problem_of
from twinloop.identification.fit.support import EACH, MANY, borne
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import chains

DT, STEPS, NOISE = 0.05, 200, 1e-4
SIGNALS = tl.Signals([tl.State("level", "m", 1.0)], [tl.Command("valve", "1", (0.0, 1.0))], DT)


def filled(opened):
    """level' = 2 valve - 0.5 level with the valve open for some periods; a sum of terms of which most are wrong."""
    valve = np.zeros(STEPS)
    valve[20 : 20 + opened] = np.linspace(0.3, 1.0, opened)
    level = [0.4]
    for u in valve:
        level.append(4.0 * u + (level[-1] - 4.0 * u) * np.exp(-0.5 * DT))
    readings = np.array(level)[:, None] + NOISE * np.random.default_rng(3).standard_normal((STEPS + 1, 1))
    run = Run.of(readings, valve[:, None])
    problem = problem_of(SIGNALS, run)
    pool = problem.pool
    products = [1]
    for _ in range(4):
        products.append(pool.product(products[-1], 0))
    (chain,) = chains(SIGNALS, "acceleration", guessed_noise([run], np.ones(1)))
    chain = chain.with_noise(np.array([NOISE**2]), (1e-12, 0.0, DT))
    return problem, Sum(dict.fromkeys([0, pool.one, *products], 1.0), 0.0, chain), products


@pytest.mark.parametrize("opened", [3, 11, 17, 24])
def test_as_many_terms_are_left_as_their_readings_bear(opened):
    problem, found, products = filled(opened)
    left = borne(problem, found)
    rare = [term for term in left.weights if term in products]
    assert len(rare) == min(len(products), max(1, opened // EACH))
    assert {0, problem.pool.one} <= set(left.weights)
    assert (left is found) == (len(rare) == len(products))


def test_what_is_left_of_a_few_is_what_explains_most():
    problem, found, products = filled(6)
    left = borne(problem, found)
    regression = problem.regression(found.chain, problem.values([0, problem.pool.one, *products]))
    gram = regression.gram(found.chain.sensors, found.chain.motion, problem.workers)
    alone = {products[i]: gram.solve([0, 1, 2 + i])[2] for i in range(len(products))}
    (kept,) = set(left.weights) & set(products)
    assert kept == min(alone, key=alone.get) == 1
    assert left.weights[1] == pytest.approx(2.0, rel=1e-3) and left.weights[0] == pytest.approx(
        -0.5, rel=1e-2
    )


def test_terms_of_enough_readings_are_all_left():
    problem, found, _ = filled(MANY)
    assert borne(problem, found) is found


def test_a_record_that_is_short_as_a_whole_bears_what_it_did():
    for terms in ([0], [0, 1]):
        run = Run.of(np.linspace(1.0, 2.0, 9)[:, None], np.ones((8, 1)))
        problem = problem_of(SIGNALS, run)
        (chain,) = chains(SIGNALS, "acceleration", guessed_noise([run], np.ones(1)))
        found = Sum(dict.fromkeys([*terms, problem.pool.one], 1.0), 0.0, chain)
        assert borne(problem, found) is found
