"""What innovations say for a model: its likelihood, and of disturbances whether they explain more than they cost."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from small_plants import pendulum_like, swung
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.evidence import CORRELATED
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.fit.innovations import Described
from twinloop.identification.fit.models import model_of
from twinloop.identification.records import Run
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.search.structure import priced
from twinloop.identification.searches import PROPOSALS, Found, decided
from twinloop.identification.starts import ANEW, begun, starts

QUICK = {"moves": 2000, "starts": 2, "generations": 2, "population": 30, "committee_size": 4}


def gravity(angle, rate, torque):
    return -9.0 * np.sin(angle) - 0.4 * rate + 5.0 * torque


def blown(seed, size, lasts=0.3):
    """The pendulum in a wind whose push on it is remembered for some time, s; 40 pushes a period."""
    stream = np.random.default_rng(1000 + seed)
    share = np.exp(-0.001 / lasts)
    push = [0.0]

    def slope(angle, rate, torque):
        push[0] = share * push[0] + size * np.sqrt(1.0 - share * share) * stream.standard_normal()
        return gravity(angle, rate, torque) + push[0]

    return swung(slope, seed, noise=1e-3)


def context_of(runs, signals, **options):
    options = options_of("default", {**QUICK, **options})
    return Context(runs, signals, options, Unit(3, (len(runs),)), _core.Workers(1))


def learnt(runs, **options):
    context = context_of(runs, pendulum_like(), **options)
    start, *_ = starts(context, "acceleration")
    found = Found(start())
    for propose in PROPOSALS:
        found = decided(found, propose(context, found.best))
    return found.best


def lasting(hypothesis):
    return [found.chain.motion.correlated > 0.0 for found in hypothesis.sums]


@pytest.mark.parametrize("first", range(0, 12, 3))
def test_where_nothing_lasts_no_disturbance_is_found_that_does(first):
    runs = [swung(gravity, seed, noise=1e-3) for seed in range(first, first + 2)]
    found = learnt(runs)
    assert lasting(found) == [False]
    free = learnt(runs, price_disturbances=False)
    # The law stays what it is.
    assert found.sums[0].weights.keys() == free.sums[0].weights.keys()
    np.testing.assert_allclose(
        list(found.sums[0].weights.values()), list(free.sums[0].weights.values()), rtol=0.02
    )


@pytest.mark.parametrize("seed", [0, 5])
def test_a_wind_that_lasts_is_kept(seed):
    found = learnt([blown(seed, 3.0), blown(seed + 1, 3.0)])
    assert lasting(found) == [True]
    # Standard deviation of what a period's pushes have in common, as it was made.
    assert np.sqrt(found.sums[0].chain.motion.correlated) == pytest.approx(3.0, rel=0.5)


def pushed(gust):
    """A mass that its command alone pushes: no reading is in its law, so that a regression knows all of it exactly."""
    stream = np.random.default_rng(2)
    signals = tl.Signals([tl.State("speed", "m/s", 1.0)], [tl.Command("force", "N", (-1.0, 1.0))], 0.1)
    runs = []
    for _ in range(2):
        commands = np.repeat(stream.uniform(-1.0, 1.0, (20, 1)), 5, axis=0)
        wind = gust * np.convolve(stream.normal(size=119), np.ones(20) / 20.0**0.5, mode="valid")
        speed = np.concatenate([[0.0], np.cumsum(0.1 * (2.0 * commands[:, 0] + wind))])
        runs.append(Run.of((speed + 0.01 * stream.normal(size=101))[:, np.newaxis], commands))
    context = context_of(runs, signals)
    hypothesis = from_both_sides(context, begun(context, "acceleration", context.first_pool(), ANEW))
    return context, fitted(context, hypothesis)


@pytest.mark.parametrize("gust", [0.0, 0.5])
@pytest.mark.parametrize("factor", [1.0, 30.0])
def test_another_noise_gains_what_it_makes_readings_likelier_by_less_what_a_disturbance_costs(gust, factor):
    context, hypothesis = pushed(gust)
    (found,) = hypothesis.sums
    assert [hypothesis.pool.text(term, ["v", "f"]) for term in found.weights] == ["f"]
    own = found.chain.with_noise(found.chain.sensors * factor, found.chain.motion)
    said = Described(context, replace(hypothesis, sums=(replace(found, chain=own),)))
    problem = Problem(context, hypothesis)
    regression = problem.regression(own, problem.values(problem.usable(list(found.weights))))

    def length(chain):
        likelihood = regression.likelihood(list(found.weights.values()), chain.sensors, chain.motion)
        return likelihood + CORRELATED * (chain.motion.correlated > 0.0)

    (chain,) = said.chains
    assert said.gained == pytest.approx(length(own) - length(chain), abs=1e-3)
    assert said.gained > 10.0 * (factor > 1.0) - 1.0
    assert (chain.motion.correlated > 0.0) == (gust > 0.0)


def test_terms_are_paid_for():
    context, hypothesis = pushed(0.0)
    (found,) = hypothesis.sums
    grown = replace(hypothesis, candidates=hypothesis.candidates.growing())
    more = grown.pool.product(0, 0)
    weighed = replace(found, weights={**found.weights, more: 0.0})
    model = model_of(context, other := replace(grown, sums=(weighed,), fit=None))
    other = replace(other, fit=replace(hypothesis.fit, model=model))
    costs = [priced(grown.pool, list(sum_.weights), 202, 2) for sum_ in (found, weighed)]
    lengths = [Described(context, each).hypothesis.evidence.length for each in (hypothesis, other)]
    assert lengths[1] - lengths[0] == pytest.approx(costs[1] - costs[0], abs=1e-6)
    assert costs[1] > costs[0]
