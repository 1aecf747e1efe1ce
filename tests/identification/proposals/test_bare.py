"""A hidden state that stood in for terms gives way to these; one that is there stays."""

from dataclasses import replace

import numpy as np

from small_plants import pendulum_like, swung
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.evidence import by_evidence
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.proposals.bare import bare
from twinloop.identification.search.hidden import with_hidden
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import ANEW, begun
from twinloop.law.actuation import HiddenState

SIGNALS = pendulum_like()
OPTIONS = options_of("default", {"moves": 4000, "generations": 0, "pruning": False})
TIME = 0.8


def gravity(angle, rate, torque):
    return -9.0 * np.sin(angle) - 0.4 * rate + 5.0 * torque


def of_first_rung(runs):
    """What the first rung, which has no sine, makes of runs, with some of a state that the torque fills besides."""
    context = Context(runs, SIGNALS, OPTIONS, Unit(0), _core.Workers(1))
    first = begun(context, "acceleration", context.first_pool(), ANEW)
    hidden = HiddenState((0,), False, 0.0, TIME)
    behind = replace(
        first,
        actuation=replace(first.actuation, hidden=(hidden,)),
        candidates=with_hidden(context, first.candidates),
    )
    found = from_both_sides(context, behind)
    sums = [replace(one, weights={**one.weights, found.pool.hidden(0): 0.1}) for one in found.sums]
    return context, fitted(context, replace(found, sums=tuple(sums)))


def names_of(hypothesis):
    names = ["angle", "rate", "torque", "hidden"]
    return {hypothesis.pool.text(node, names) for found in hypothesis.sums for node in found.weights}


def test_a_hidden_state_that_stood_in_for_terms_gives_way_to_these():
    context, hypothesis = of_first_rung([swung(gravity, seed, noise=1e-3) for seed in range(2)])
    assert "sin(angle)" not in names_of(hypothesis) and "hidden" in names_of(hypothesis)
    best = max([hypothesis, *bare(context, hypothesis)], key=by_evidence)
    assert best.actuation.hidden == () and best.evidence.length < hypothesis.evidence.length - 30.0
    assert names_of(best) == {"sin(angle)", "rate", "torque"}
    # It is not looked for where nothing is hidden, or nothing fitted.
    assert list(bare(context, best)) == [] and list(bare(context, replace(hypothesis, fit=None))) == []
