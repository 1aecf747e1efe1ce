"""Disturbances that last are believed where they explain more than they cost."""

from dataclasses import replace

import numpy as np
import pytest

from small_plants import pendulum_like, swung
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.identify import PROPOSALS, Found, decided
from twinloop.identification.proposals.calm import calm
from twinloop.identification.search.selection import posed
from twinloop.identification.starts import starts

WITHOUT = tuple(proposal for proposal in PROPOSALS if proposal is not calm)
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


def learnt(runs, proposals):
    context = Context(
        runs, pendulum_like(), options_of("default", QUICK), Unit(3, (len(runs),)), _core.Workers(1)
    )
    start, *_ = starts(context, "acceleration")
    found = Found(start())
    for propose in proposals:
        found = decided(found, propose(context, found.best))
    return context, found.best


def lasting(hypothesis):
    return [found.chain.motion.correlated > 0.0 for found in hypothesis.sums]


@pytest.mark.parametrize("first", range(0, 12, 3))
def test_where_nothing_lasts_no_disturbance_is_found_that_does(first):
    runs = [swung(gravity, seed, noise=1e-3) for seed in range(first, first + 2)]
    _, before = learnt(runs, WITHOUT)
    context, after = learnt(runs, PROPOSALS)
    assert lasting(before) == [True] and lasting(after) == [False]
    assert after.evidence.beats(before.evidence)
    assert list(calm(context, after)) == []
    # The law stays what it is.
    assert after.sums[0].weights.keys() == before.sums[0].weights.keys()
    np.testing.assert_allclose(
        list(after.sums[0].weights.values()), list(before.sums[0].weights.values()), rtol=0.02
    )


@pytest.mark.parametrize("seed", [0, 5])
def test_a_wind_that_lasts_is_kept(seed):
    _, found = learnt([blown(seed, 3.0), blown(seed + 1, 3.0)], PROPOSALS)
    assert lasting(found) == [True]
    # Standard deviation of what a period's pushes have in common, as it was made.
    assert np.sqrt(found.sums[0].chain.motion.correlated) == pytest.approx(3.0, rel=0.5)


def test_what_is_left_of_a_description_is_its_likelihood_and_its_terms():
    runs = [swung(gravity, seed, noise=1e-3) for seed in range(2)]
    _, before = learnt(runs, WITHOUT)
    context, after = learnt(runs, (*WITHOUT, calm))
    (old,), (new,) = before.sums, after.sums
    problem = posed(context, before)
    regression = problem.regression(old.chain, problem.values(problem.usable(list(old.weights))))
    weights = np.array(list(old.weights.values()))
    gained = [regression.likelihood(weights, found.chain.sensors, found.chain.motion) for found in (old, new)]
    assert new.description_length - old.description_length == pytest.approx(gained[1] - gained[0], abs=0.1)


def test_noise_under_which_tuned_weights_are_no_regression_s_makes_nothing_shorter():
    """Weights that are tuned on predictions fit no noise that is next to none; dropping a disturbance gains nothing."""
    runs = [swung(gravity, seed, noise=1e-3) for seed in range(2)]
    context, before = learnt(runs, WITHOUT)
    (found,) = before.sums
    quiet = found.chain.with_noise(found.chain.sensors, (1e-13, 1e-11, found.chain.motion.correlation_time))
    tuned = {term: 1.01 * weight for term, weight in found.weights.items()}
    (old,) = sums = (replace(found, weights=tuned, chain=quiet),)
    for after in calm(context, replace(before, sums=sums)):
        assert after.sums[0].description_length >= old.description_length - 1e-6
