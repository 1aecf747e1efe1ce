"""What terms promise: the gain that tuning with them has, before they are tuned."""

from dataclasses import replace

import numpy as np
import pytest

from small_plants import pendulum_like, swung
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import with_fit
from twinloop.identification.fit.models import model_of
from twinloop.identification.fit.promises import promises
from twinloop.identification.fit.tuning import tune
from twinloop.identification.starts import starts

ANGLE, RATE, TORQUE = range(3)


def damped(angle, rate, torque):
    return -9.0 * angle - 0.003 * rate + 5.0 * torque


@pytest.fixture(scope="module")
def without_damping():
    """A law that lacks the damping, tuned as if nothing disturbed it, with its context."""
    runs = [swung(damped, seed, noise=1e-3) for seed in (1, 2)]
    options = options_of("default", {"moves": 100, "starts": 1})
    context = Context(runs, pendulum_like(), options, Unit(3, (2,)), _core.Workers(1))
    start, *_ = starts(context, "acceleration")
    found = start()
    (known,) = found.sums
    quiet = known.chain.with_noise(np.array([1e-6, 1e-6]), (1e-12, 0.0, 1.0))
    lacking = replace(found, sums=(replace(known, chain=quiet, weights={ANGLE: -8.0, TORQUE: 4.0}),))
    fit, _ = tune(context, lacking, model_of(context, lacking), [quiet], 30)
    return context, with_fit(lacking, fit)


def test_a_weak_term_promises_what_tuning_gains_with_it(without_damping):
    context, hypothesis = without_damping
    grown = replace(hypothesis, candidates=hypothesis.candidates.growing())
    nodes = [RATE, grown.pool.add("*", RATE, TORQUE), grown.pool.add("*", ANGLE, TORQUE)]
    promised = promises(context, grown, 0, nodes)
    (known,) = grown.sums
    gained = []
    for node in nodes:
        candidates, weights = grown.candidates.with_terms([node]), {**known.weights, node: 0.0}
        more = replace(grown, candidates=candidates, sums=(replace(known, weights=weights),), fit=None)
        fit, _ = tune(context, more, model_of(context, more), hypothesis.fit.observer, 30)
        gained.append(hypothesis.fit.chi_squared - fit.chi_squared)
    assert promised == pytest.approx(gained, rel=0.05, abs=0.1)
    assert promised[0] > 100.0 > 2.0 * max(promised[1:])
