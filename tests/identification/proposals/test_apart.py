"""Commands that are alike share a lag until their readings say that each has one of its own."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.proposals.apart import apart
from twinloop.identification.records import Run
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import ANEW, begun
from twinloop.law.actuation import Actuation, Actuator, alike_commands

DT = 0.05
SIGNALS = tl.Signals(
    [tl.State("pitch_rate", "rad/s", 2.0), tl.State("yaw_rate", "rad/s", 2.0)],
    [tl.Command("main", "1", (-1.0, 1.0)), tl.Command("tail", "1", (-1.0, 1.0))],
    DT,
)


def flown(lags, seed, steps=160):
    """Two rotors, one an axis and a little on the other, that answer with these lags (s); ten steps a period."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-1.0, 1.0, (steps // 8, 2)), 8, axis=0)
    effect, rates, rows = commands[0], np.zeros(2), [np.zeros(2)]
    shares = 1.0 - np.exp(-DT / (10.0 * np.array(lags)))
    for command in commands:
        for _ in range(10):
            # What arrives changes within the step: its middle is what drives it.
            before, effect = effect, effect + shares * (command - effect)
            middle = 0.5 * (before + effect)
            driven = np.array([3.0 * middle[0] - 0.4 * middle[1], 2.0 * middle[1]])
            rates = rates + DT / 10.0 * (driven - 0.8 * rates) * (1.0 - 0.4 * DT / 10.0)
        rows.append(rates)
    readings = np.array(rows) + 2e-3 * stream.normal(size=(steps + 1, 2))
    return Run.of(readings, commands)


def shared(lags):
    """A fitted hypothesis in which both commands have one lag, as a search for one would begin."""
    runs = [flown(lags, seed) for seed in range(2)]
    options = options_of("default", {"generations": 0, "moves": 2000, "libraries": ("linear",)})
    context = Context(runs, SIGNALS, options, Unit(0), _core.Workers(1))
    first = begun(context, "acceleration", context.first_pool(), ANEW)
    middle = float(np.sqrt(lags[0] * lags[1]))
    behind = replace(first, actuation=Actuation((Actuator(middle, 0, None),) * 2))
    return context, fitted(context, from_both_sides(context, behind))


@pytest.mark.parametrize("lags", [(0.25, 0.12), (0.1, 0.3)])
def test_commands_that_lag_differently_get_lags_of_their_own(lags):
    context, hypothesis = shared(lags)
    assert hypothesis.alike == ((0, 1),)
    (found,) = apart(context, hypothesis)
    assert found.alike == ((0,), (1,)) and found.evidence > hypothesis.evidence
    np.testing.assert_allclose([actuator.lag for actuator in found.actuation.actuators], lags, rtol=0.03)
    weights = [
        {found.pool.text(node, ["p", "r", "m", "t"]): w for node, w in s.weights.items()} for s in found.sums
    ]
    assert weights[0] == pytest.approx({"p": -0.8, "m": 3.0, "t": -0.4}, rel=0.03)
    assert weights[1] == pytest.approx({"r": -0.8, "t": 2.0}, rel=0.03)


def test_commands_that_lag_alike_stay_together():
    context, hypothesis = shared((0.2, 0.2))
    assert list(apart(context, hypothesis)) == []
    options = replace(context.options, apart=False)
    other, different = shared((0.25, 0.12))
    assert list(apart(replace(other, options=options), different)) == []


def test_what_was_found_apart_is_not_alike_later():
    known = Actuation((Actuator(0.25), Actuator(0.12)))
    assert alike_commands(SIGNALS) == ((0, 1),)
    assert alike_commands(SIGNALS, known) == ((0,), (1,))
    assert alike_commands(SIGNALS, Actuation((Actuator(0.2),) * 2)) == ((0, 1),)


def gates(delays, seed, steps=200):
    """Two gates between three pools, each of which acts so many periods after it was sent."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-0.8, 0.8, (steps // 10, 2)), 10, axis=0)
    sent = np.vstack([np.repeat(commands[:1], 20, axis=0), commands])
    levels, rows = np.zeros(2), [np.zeros(2)]
    for k in range(steps):
        first, second = (sent[20 + k - delay, i] for i, delay in enumerate(delays))
        for _ in range(10):

            def flow(x, first=first, second=second):
                return np.array([first - 0.6 * second - 0.3 * x[0], 0.6 * second - 0.4 * x[1] + 0.2 * x[0]])

            begun = flow(levels)
            levels = levels + 0.05 * DT * (begun + flow(levels + 0.1 * DT * begun))
        rows.append(levels)
    readings = np.array(rows) + 3e-3 * stream.normal(size=(steps + 1, 2))
    return tl.Trajectory(DT * np.arange(steps + 1), readings, commands)


@pytest.mark.parametrize("delays", [(7, 0), (3, 8), (4, 4), (0, 0)])
def test_alike_commands_are_given_delays_of_their_own(delays):
    twin = tl.identify([gates(delays, seed) for seed in (1, 2)], SIGNALS)
    assert tuple(actuator.delay for actuator in twin.law.actuation.actuators) == delays
    assert all(actuator.lag < 0.1 * DT for actuator in twin.law.actuation.actuators)
