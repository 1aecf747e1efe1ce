"""Sensors of driven states that are late by whole periods: found, believed only where they pay, and simulated."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import norm

import twinloop as tl
from sameness import same, through_json
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.identify import UnderWay, identify_runs
from twinloop.identification.late import late, unread
from twinloop.identification.records import Run
from twinloop.identification.remarks import late_sensors
from twinloop.identification.searches import Reading
from twinloop.identification.sensors.chains import Chain
from twinloop.law.reports import Held, given, in_words, late_in, old, reports_of, with_late

DT, STEPS = 0.1, 150
SIGNALS = tl.Signals(
    [tl.State("heat", "K", 10.0), tl.State("share", "%", 5.0)],
    [tl.Command("flow", "l/s", (-2.0, 2.0)), tl.Command("heater", "kW", (-2.0, 2.0))],
    DT,
)
QUICK = {"moves": 1500, "starts": 2, "generations": 0, "committee_size": 3, "tuning_steps": 8}


def reacting(seed, delay=0):
    """True states of a tank: heat moves what reacts, both fade; commands act so many periods late."""
    random = np.random.default_rng(seed)
    commands = np.repeat(random.uniform(-2.0, 2.0, (STEPS // 10, 2)), 10, axis=0)
    states = np.zeros((STEPS + 1, 2))
    for k in range(STEPS):
        (flow, heater), x = commands[k - delay] if k >= delay else (0.0, 0.0), states[k].copy()
        for _ in range(10):
            x += (
                DT
                / 10
                * np.array([4.0 * heater - 0.8 * x[0] - 0.6 * x[1], 0.7 * x[0] + 2.0 * flow - 0.9 * x[1]])
            )
        states[k + 1] = x
    return states, commands


def logged(ages, seeds=(0, 1), delay=0):
    """Runs whose readings are late by so many periods, with noise."""
    runs = []
    for seed in seeds:
        states, commands = reacting(seed, delay)
        read = states + np.array([0.05, 0.03]) * np.random.default_rng([seed, 1]).normal(size=states.shape)
        runs.append(Run.of(given(with_late((), ages), read), commands))
    return runs


def context_of(runs, **changes):
    context = Context(
        runs, SIGNALS, options_of("default", {**QUICK, **changes}), Unit(0, (len(runs),)), _core.Workers(1)
    )
    return context


def learnt(runs, **more):
    options = options_of("default", QUICK)
    return identify_runs(
        runs, SIGNALS, options, seed=1, iteration=len(runs), workers=_core.Workers(1), **more
    )


def ages_of(found):
    return late_in(reports_of(found.model, 2), 2)


@pytest.mark.parametrize("ages", [(0, 3), (1, 0), (0, 0)])
def test_what_is_late_is_found_in_short_looks(ages):
    runs = logged(ages)
    assert late(context_of(runs), runs) == ages


def test_where_all_are_late_their_commands_are():
    runs = logged((2, 2))
    assert late(context_of(runs), runs) == (0, 0)
    runs = logged((1, 3))
    assert late(context_of(runs), runs) == (0, 2)


def test_nothing_is_late_in_one_run_or_where_it_is_switched_off():
    runs = logged((0, 3))
    assert late(context_of(runs[:1]), runs[:1]) == (0, 0)
    assert late(context_of(runs, offsets=False), runs) == (0, 0)


def test_the_law_behind_a_late_sensor_is_the_one_of_readings_in_time_and_the_twin_gives_it_late():
    found = learnt(logged((0, 3)))
    assert ages_of(found) == (0, 3)
    assert found.late(SIGNALS).tolist() == pytest.approx([0.0, 0.3])
    assert any("share come 300 ms later than those of heat;" in str(remark) for remark in found.remarks)
    twin = tl.Twin(found.model, SIGNALS)
    assert "share is given 0.3 s later" in twin.equations()
    text = twin.equations(6).split("d share / dt =")[1]
    assert float(text.split("*heat")[0].split()[-1]) == pytest.approx(0.7, rel=0.05)
    # Its step is that of the true state; what a flight reads is late.
    states, commands = reacting(7)
    run = twin.simulate_commands(np.zeros(2), commands)
    assert np.abs(run.true_states - states).max() < 0.2
    np.testing.assert_array_equal(run.states[3:, 1], run.true_states[:-3, 1])
    np.testing.assert_array_equal(run.states[:, 0], run.true_states[:, 0])


def test_readings_in_time_make_no_sensor_late_and_a_late_command_none_either():
    for delay in (0, 2):
        found = learnt(logged((0, 0), delay=delay))
        assert ages_of(found) == (0, 0)
        assert {one.delay for one in found.actuation.actuators} == {delay}


def test_what_more_runs_say_again_is_believed_and_what_is_settled_stays(monkeypatch):
    known, kept = learnt(logged((0, 3))), []
    more = learnt(logged((0, 3), range(3)), earlier=known, keep=kept.append)
    assert ages_of(more) == (0, 3)
    assert kept[0].late == ((0, 3),)
    monkeypatch.setattr("twinloop.identification.late.from_both_sides", None)  # nothing is searched again
    runs = logged((0, 3), range(5))
    settled = replace(context_of(runs), earlier=more)
    assert late(settled, runs) == (0, 3)


def test_what_short_looks_see_no_more_is_learnt_and_readings_in_time_are_held_against_it(monkeypatch):
    known, kept = learnt(logged((0, 3))), []
    monkeypatch.setattr("twinloop.identification.identify.late", lambda context, runs: (0, 0))
    more = learnt(logged((0, 3), range(3)), earlier=known, keep=kept.append)
    assert kept[0].late == ((0, 3), (0, 0))
    assert ages_of(more) == (0, 3)


def test_readings_that_are_older_than_their_runs_count_as_readings_that_others_foretell():
    runs = logged((0, 3))
    context = replace(context_of(runs), reports=(None, Held(1, 1, 3)))
    chains = chains_of()
    assert unread(context, chains) == pytest.approx(2 * 3 * (1.0 + np.log(2.0 * 0.5)))
    # Of white noise they are what a reading that stands alone has, −2 log of its likelihood but for log 2π.
    errors = np.sqrt(2.0 * 0.5) * np.random.default_rng(0).normal(size=200_000)
    alone = -2.0 * norm.logpdf(errors, scale=1.0).mean() - np.log(2.0 * np.pi)
    assert unread(context, chains) / 6 == pytest.approx(alone, rel=0.02)


@dataclass(frozen=True)
class Fitted:
    """As much of a hypothesis as is asked what its late sensors pay."""

    readings: int
    observer: tuple[Chain, ...] = ()

    @property
    def fit(self):
        return self


@pytest.mark.parametrize(("ages", "distinct"), [((0, 0), 0), ((0, 3), 1), ((2, 2), 1), ((1, 3), 2)])
def test_what_is_late_pays_for_itself_and_for_each_reading(ages, distinct):
    context = replace(context_of(logged(ages)), reports=with_late((), ages))
    paid = [Reading(context, ()).paid(Fitted(readings, chains_of())) for readings in (0, 600, 3000)]
    assert paid[0] == pytest.approx(12.0 * distinct + unread(context, chains_of()))
    assert np.diff(paid) == pytest.approx([12.0 * distinct, 48.0 * distinct])


def chains_of():
    return (
        Chain((0,), 0, "acceleration", np.array([0.04]), np.array([0.04])),
        Chain((1,), 1, "acceleration", np.array([0.5]), np.array([0.5])),
    )


def test_a_law_that_is_only_tuned_again_keeps_what_is_late():
    runs = logged((0, 3))
    known = learnt(runs)
    again = identify_runs(
        runs, SIGNALS, options_of("default", {**QUICK, "anew": False}), seed=1, iteration=9, earlier=known,
        workers=_core.Workers(1),
    )  # fmt: skip
    assert ages_of(again) == (0, 3)


def test_an_identification_with_a_rival_goes_on_from_every_step_to_the_same_bits():
    runs, kept = logged((0, 3)), []
    whole = learnt(runs, keep=kept.append)
    assert kept[0].late == ((0, 0), (0, 3))
    for step in kept[:: len(kept) // 4]:
        read = UnderWay.from_record(through_json(step.to_record()), SIGNALS)
        assert same(learnt(runs, under_way=read), whole)


def test_a_delay_is_said_in_seconds_where_it_is_one_or_more():
    said = [str(remark) for remark in late_sensors(np.array([0.0, 120.0]), [0, 1], SIGNALS)]
    assert len(said) == 1 and "Readings of share come 120 s later than those of heat;" in said[0]


def test_late_readings_are_said_and_kept_with_what_is_slow():
    slow = (Held(4, 2), None)
    assert old(slow, (3, 2)) == (Held(4, 2, 3), None)
    assert with_late(slow, (1, 2)) == (Held(4, 2), Held(1, 1, 2)) and with_late((), (0, 0)) == ()
    assert in_words((Held(4, 2, 3), Held(1, 1, 2)), SIGNALS) == [
        "heat is read once in 4 periods (0.4 s), and given 0.3 s later",
        "share is given 0.2 s later",
    ]
    assert reports_of(learnt(logged((0, 0), (0,))).model, 2) == ()
