"""Delays that a lag stood in for, and lags that a delay stood in for, are put right once terms are known."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from small_plants import lagging_motor
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.proposals.delays import delays
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import ANEW, begun
from twinloop.law.actuation import Actuation, Actuator

DT = 0.05
SIGNALS = tl.Signals([tl.State("speed", "m/s", 2.0)], [tl.Command("u", "1", (-1.0, 1.0), scale=1.0)], DT)


def begun_with(lag, delay, believed, **changes):
    """A fitted hypothesis of a motor with this lag (s) and delay (periods), begun with another lag and delay."""
    stream, dead = np.random.default_rng(3), max(1, delay)
    commands = np.repeat(stream.uniform(-1.0, 1.0, (30, 1)), 8, axis=0)
    acting = np.concatenate([np.repeat(commands[:1], dead, axis=0), commands[:-dead]]) if delay else commands
    run = lagging_motor(acting, DT, lag, lambda u: 3.0 * u, stream, steps=200)
    run = replace(run, commands=commands[: len(run.commands)]).continued(SIGNALS)
    context = Context(
        [run],
        SIGNALS,
        options_of("default", {"generations": 0, "moves": 2000, **changes}),
        Unit(0, (1,)),
        _core.Workers(1),
    )
    first = begun(context, "acceleration", context.first_pool(), ANEW)
    first = replace(first, actuation=Actuation((believed,)))
    return context, fitted(context, from_both_sides(context, first))


@pytest.mark.parametrize(
    ("lag", "delay", "believed"),
    [
        (0.1, 3, Actuator(0.2)),
        (0.0, 4, Actuator(0.1, 1)),
        (0.15, 0, Actuator(0.05, 3)),
        (0.1, 1, Actuator(0.0, 4)),
    ],
    ids=["a lag for a delay", "most of a delay", "a delay for a lag", "a longer delay for both"],
)
def test_delays_are_put_right_once_terms_are_known(lag, delay, believed):
    context, hypothesis = begun_with(lag, delay, believed)
    assert hypothesis.actuation.actuators[0].delay == believed.delay
    moved, other = delays(context, hypothesis)
    assert moved.evidence > hypothesis.evidence
    (found,) = other.actuation.actuators
    assert found.delay == delay and found.lag == pytest.approx(lag, rel=0.02, abs=0.05 * DT)
    # Behind the wrong delay it is not known that the motor slows down by itself.
    assert hypothesis.terms == moved.terms == 1 and other.evidence > moved.evidence
    np.testing.assert_allclose(other.fit.model.constants, [-0.8, 3.0], rtol=0.01)
    assert list(delays(context, other)) == []


def test_what_is_right_stays_and_what_acts_at_once_is_given_no_delay():
    assert list(delays(*begun_with(0.1, 2, Actuator(0.1, 2)))) == []
    assert list(delays(*begun_with(0.0, 0, Actuator()))) == []
    assert list(delays(*begun_with(0.1, 3, Actuator(0.2), delays=False))) == []
