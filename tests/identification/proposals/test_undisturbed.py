"""Terms are searched as if nothing disturbed, too: what explains all that is left would hide what is missing."""

from dataclasses import replace

import numpy as np
import pytest

from small_plants import pendulum_like, swung
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.proposals.undisturbed import undisturbed
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import ANEW, begun

QUICK = {"moves": 4000, "generations": 0}


def gravity(angle, rate, torque):
    return -9.0 * np.sin(angle) - 0.4 * rate + 5.0 * torque


def of_first_rung(noise):
    """Two swings, and what the first rung makes of them, which has no sine: a linear law, and what disturbs it."""
    runs = [swung(gravity, seed, noise=noise) for seed in range(2)]
    context = Context(runs, pendulum_like(), options_of("default", QUICK), Unit(0), _core.Workers(1))
    first = begun(context, "acceleration", context.first_pool(), ANEW)
    return context, fitted(context, from_both_sides(context, first))


def law(hypothesis):
    names = ["angle", "rate", "torque"]
    return {hypothesis.pool.text(node, names): weight for node, weight in hypothesis.sums[0].weights.items()}


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
def test_what_a_disturbance_stood_in_for_is_found(noise):
    context, hypothesis = of_first_rung(noise)
    motion = hypothesis.sums[0].chain.motion
    assert "sin(angle)" not in law(hypothesis) and max(motion.white, motion.correlated) > 0.0
    *_, best = sorted(undisturbed(context, hypothesis), key=lambda found: -found.evidence.length)
    assert best.evidence > hypothesis.evidence
    found = law(best)
    for term, weight in {"sin(angle)": -9.0, "rate": -0.4, "torque": 5.0}.items():
        assert found[term] == pytest.approx(weight, rel=0.01)
    assert len(found) <= 4
    # Where hardly anything disturbs there is nothing to look for.
    assert list(undisturbed(context, best)) == []


def test_it_can_be_switched_off_and_needs_a_model():
    context, hypothesis = of_first_rung(1e-3)
    options = replace(context.options, undisturbed=False)
    assert list(undisturbed(replace(context, options=options), hypothesis)) == []
    assert list(undisturbed(context, replace(hypothesis, fit=None))) == []
