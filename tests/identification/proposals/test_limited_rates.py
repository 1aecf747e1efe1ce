"""Actuators that move at a limited rate: found with their lag, and none where there is none or none was met."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import twinloop as tl
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.evidence import LAGGING, by_evidence, price
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.identify import identify_runs
from twinloop.identification.proposals.at_once import at_once
from twinloop.identification.records import Run
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import ANEW, begun
from twinloop.law.actuation import Actuation, Actuator

DT, STEPS = 0.05, 240
SIGNALS = tl.Signals(
    [tl.State("heading", "rad", 1.0), tl.State("turn", "rad/s", 1.0, derivative_of="heading")],
    [tl.Command("rudder", "rad", (-0.6, 0.6))],
    DT,
)
FAST = {
    "moves": 1500,
    "starts": 2,
    "generations": 0,
    "committee_size": 3,
    "tuning_steps": 10,
    "hidden": False,
}


def sailed(seed, lag, rate, size=0.5, hold=16):
    """A ship with d turn / dt = 3 effect - 0.8 turn, whose rudder gear lags and moves at a limited rate."""
    random = np.random.default_rng(seed)
    commands = np.repeat(size * random.uniform(-1.0, 1.0, STEPS // hold), hold)
    state, effect, states, fine = np.zeros(2), 0.0, [np.zeros(2)], 200
    for command in commands:
        for _ in range(fine):
            off = command - effect
            step = DT / fine
            effect += step * np.clip(off / max(lag, step), -rate, rate)
            state = state + step * np.array([state[1], 3.0 * effect - 0.8 * state[1]])
        states.append(state)
    read = np.array(states) + 2e-3 * random.normal(size=(STEPS + 1, 2))
    return Run.of(read, commands[:, np.newaxis])


def learnt(runs, **changes):
    options = options_of("default", {**FAST, **changes})
    rests = [np.zeros(1)]
    return identify_runs(runs, SIGNALS, options, rests=rests, workers=_core.Workers())


@pytest.mark.parametrize(("lag", "rate"), [(0.0, 1.2), (0.12, 0.4)])
def test_a_limited_rate_is_found_with_its_lag(lag, rate):
    found = learnt([sailed(seed, lag, rate) for seed in (0, 1)])
    (actuator,) = found.actuation.actuators
    tuned = Actuation.of(found.model, SIGNALS).actuators[0]
    assert actuator.ramp > 0.0
    assert tuned.rate(SIGNALS.commands[0].size) == pytest.approx(rate, rel=0.05)
    assert tuned.lag == pytest.approx(lag, abs=0.03) and tuned.delay == 0
    assert 0.8 < found.misfit < 1.2
    # Without it a lag stands for it, and leaves more.
    without = learnt([sailed(seed, lag, rate) for seed in (0, 1)], ramps=False)
    assert without.actuation.actuators[0].ramp == 0.0
    assert without.description_length > found.description_length + 50.0


@pytest.mark.parametrize(("lag", "rate", "size"), [(0.1, np.inf, 0.5), (0.0, np.inf, 0.5), (0.0, 2.0, 0.02)])
def test_none_is_found_where_there_is_none_and_where_none_was_met(lag, rate, size):
    # A gentle run never meets what a wild one would.
    runs = [sailed(seed, lag, rate, size, hold=1 if size < 0.1 else 16) for seed in (0, 1)]
    assert learnt(runs).actuation.actuators[0].ramp == 0.0


@pytest.mark.parametrize(("rate", "stays"), [(0.4, True), (40.0, False)])
def test_a_limit_that_tuning_has_shown_to_bind_nothing_is_dropped_and_one_that_does_stays(rate, stays):
    runs = [sailed(seed, 0.12, rate).continued(SIGNALS) for seed in (0, 1)]
    options = options_of("default", {**FAST, "lags": True})
    context = Context(runs, SIGNALS, options, Unit(0), _core.Workers(1))
    first = begun(context, "acceleration", context.first_pool(), ANEW)
    first = replace(first, actuation=Actuation((Actuator(0.12, 0, None, 0.6 / min(rate, 5.0)),)))
    limited = fitted(context, from_both_sides(context, first))
    assert limited.actuation.actuators[0].ramp > 0.0
    (free,) = at_once(context, limited)
    assert free.actuation.actuators[0].ramp == 0.0
    best = max([limited, free], key=by_evidence)
    assert best is (limited if stays else free)
    assert (free.evidence.length < limited.evidence.length) is not stays


def test_a_limited_rate_is_paid_for_like_a_lag():
    groups = [(0,), (1,)]

    def of(*actuators):
        return price("acceleration", Actuation(actuators), groups, 2)

    ramped = Actuator(ramp=0.3)
    assert of(ramped, Actuator()) - of(Actuator(), Actuator()) == LAGGING
    assert of(ramped._replace(lag=0.2), Actuator()) - of(Actuator(lag=0.2), Actuator()) == LAGGING
    assert of(ramped, ramped) - of(ramped, Actuator()) == LAGGING


@settings(max_examples=25)
@given(st.floats(0.0, 0.3), st.floats(0.05, 3.0), st.integers(0, 2**32 - 1), st.floats(1e-2, 1e2))
def test_effects_do_not_depend_on_the_unit_and_never_move_faster(lag, ramp, seed, unit):
    commands = np.random.default_rng(seed).normal(size=(30, 1))
    own = _core.command_effects([(lag, 0, 0.0, ramp)], [], [2.0], DT, commands)
    other = _core.command_effects([(lag, 0, 0.0, ramp)], [], [2.0 * unit], DT, unit * commands)
    np.testing.assert_allclose(np.array(other), unit * np.array(own), rtol=1e-9, atol=1e-12 * unit)
    ends = np.concatenate([[0.0], own[2][:, 0]])
    assert (np.abs(np.diff(ends)) <= 2.0 / ramp * DT * (1.0 + 1e-9)).all()
    # On its way it never passes the command.
    before, after = np.sign(commands[:, 0] - ends[:-1]), np.sign(commands[:, 0] - ends[1:])
    assert (before * after >= -1e-9).all()


def test_a_model_keeps_its_limits_in_its_record_and_its_variants():
    found = learnt([sailed(0, 0.0, 0.4), sailed(1, 0.0, 0.4)])
    times = [found.model.actuators[0][0], found.model.actuators[0][3]]
    same = found.model.with_constants(found.model.constants, times)
    assert same.actuators == found.model.actuators
    record = found.to_record()
    again = type(found).from_record(record, SIGNALS)
    assert again.model.actuators == found.model.actuators and again.actuation == found.actuation
    # As a version wrote them that knew no limits.
    earlier = {**record["actuation"], "version": 3}
    earlier["actuators"] = [{k: v for k, v in one.items() if k != "ramp"} for one in earlier["actuators"]]
    old = Actuation.from_record(earlier)
    assert old == replace(found.actuation, actuators=(found.actuation.actuators[0]._replace(ramp=0.0),))
