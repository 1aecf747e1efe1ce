"""A lag that tuning has shown to be nothing is none; one that is there stays."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from small_plants import lagging_motor
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.evidence import LAGGING
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.proposals.at_once import NOTHING, at_once
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import ANEW, begun
from twinloop.law.actuation import Actuation, Actuator

DT = 0.05
SIGNALS = tl.Signals([tl.State("speed", "m/s", 2.0)], [tl.Command("u", "1", (-1.0, 1.0), scale=1.0)], DT)


def found(lag):
    """A fitted hypothesis of a motor with such a lag (s), begun with it."""
    stream = np.random.default_rng(1)
    commands = np.repeat(stream.uniform(-1.0, 1.0, (30, 1)), 8, axis=0)
    run = lagging_motor(commands, DT, lag, lambda u: 3.0 * u, stream, steps=200).continued(SIGNALS)
    context = Context(
        [run], SIGNALS, options_of("default", {"generations": 0, "moves": 2000}), Unit(0), _core.Workers(1)
    )
    first = begun(context, "acceleration", context.first_pool(), ANEW)
    first = replace(first, actuation=Actuation((Actuator(lag or 0.3 * DT, 0, None),)))
    return context, fitted(context, from_both_sides(context, first))


def test_a_lag_that_is_tuned_to_nothing_saves_its_price():
    context, hypothesis = found(0.0)
    assert 0.0 < hypothesis.actuation.actuators[0].lag < NOTHING * DT
    (other,) = at_once(context, hypothesis)
    assert other.actuation == Actuation.direct(SIGNALS) and other.evidence > hypothesis.evidence
    assert other.evidence.length < hypothesis.evidence.length - LAGGING + 1.0
    np.testing.assert_allclose(other.fit.model.constants, [-0.8, 3.0], rtol=0.01)
    assert list(at_once(context, other)) == []
    kept = replace(context, options=replace(context.options, at_once=False))
    assert list(at_once(kept, hypothesis)) == []


def test_a_lag_that_is_there_stays():
    context, hypothesis = found(0.1)
    assert hypothesis.actuation.actuators[0].lag == pytest.approx(0.1, rel=0.02)
    assert list(at_once(context, hypothesis)) == []
