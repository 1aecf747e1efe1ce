"""Rates that are computed of readings, and slow sensors: what is learnt is what a sensor of its own would give."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import twinloop as tl
from twinloop import _core
from twinloop.campaign.data.reports import reports_in
from twinloop.campaign.presets import options_of
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.sensors.reported import as_sensed
from twinloop.law.reports import Computed, Held, given

DT, STEPS = 0.02, 300
SIGNALS = tl.Signals(
    [
        tl.State("place", "m", 1.0),
        tl.State("speed", "m/s", 2.0, derivative_of="place"),
        tl.State("tilt", "rad", 0.5),
    ],
    [tl.Command("rate", "rad/s", (-2.0, 2.0))],
    DT,
)
FAST = {"moves": 2000, "starts": 2, "generations": 0, "lags": False, "committee_size": 3, "tuning_steps": 8}


def moving(seed, steps=STEPS):
    """True states of a cart on a plane that is tilted: d speed / dt = 9.81 tilt - 0.4 speed, and d tilt / dt = rate."""
    random = np.random.default_rng(seed)
    rates = np.repeat(random.uniform(-2.0, 2.0, -(-steps // 15)), 15)[:steps]
    states = np.zeros((steps + 1, 3))
    for k, rate in enumerate(rates):
        x = states[k].copy()
        for _ in range(20):
            x += DT / 20 * np.array([x[1], 9.81 * x[2] - 0.4 * x[1], rate - 0.8 * x[2]])
        states[k + 1] = x
    return states, rates[:, np.newaxis]


def logged(reports, seeds=(0, 1), noise=(2e-3, 2e-2, 1e-3)):
    """Records as machines give them that report so."""
    runs = []
    for seed in seeds:
        states, rates = moving(seed)
        read = states + np.array(noise) * np.random.default_rng([seed, 1]).normal(size=states.shape)
        runs.append((given(reports, read), rates))
    return runs


def trajectories(runs):
    return [tl.Trajectory(DT * np.arange(len(states)), states, commands) for states, commands in runs]


def speed_of(found, terms=("tilt", "speed")):
    """Factors of its law."""
    text = tl.Twin(found.model, SIGNALS).equations(6).split("d speed / dt =")[1].split("d tilt")[0]
    return {name: float(text.split(f"*{name}")[0].split()[-1].replace("+", "")) for name in terms}, text


@pytest.mark.parametrize("kept", [0.0, 0.8])
def test_a_computed_rate_is_found_and_its_law_is_that_of_a_sensor_of_its_own(kept):
    reports = (None, Computed(0, kept, (1.0 - kept) / DT), None)
    runs = logged(reports)
    found = reports_in(trajectories(runs), SIGNALS)
    assert found[0] is None and found[2] is None
    assert found[1] == pytest.approx(reports[1], rel=1e-6, abs=1e-9)
    options = options_of("default", FAST)
    learnt = identify_runs(
        [Run.of(*run) for run in runs], SIGNALS, options, reports=found, workers=_core.Workers()
    )
    factors, text = speed_of(learnt)
    assert factors["tilt"] == pytest.approx(9.81, rel=0.02), text
    assert learnt.model.reports[1] and not learnt.offsets.any()
    # Its noise is that of the place through the filter: of two readings' difference it is nearly all.
    sensors = learnt.sensors(3)
    assert sensors[0] == pytest.approx(2e-3, rel=0.3)
    assert sensors[1] == pytest.approx(2e-3 * np.sqrt(2.0 / (1.0 + kept)) * (1.0 - kept) / DT, rel=0.3)


def test_a_slow_sensor_is_found_with_how_old_its_readings_are():
    reports = (Held(10, 7, 6), Held(10, 7, 6), None)
    runs = logged(reports, seeds=(0, 1, 2))
    found = reports_in(trajectories(runs), SIGNALS)
    assert found == (Held(10, 7), Held(10, 7), None)
    options = options_of("default", FAST)
    learnt = identify_runs(
        [Run.of(*run) for run in runs], SIGNALS, options, reports=found, workers=_core.Workers()
    )
    ages = [age for _, _, _, age in learnt.model.reports[0]]
    assert ages[0] == ages[1] and abs(ages[0] - 6) <= 1
    factors, text = speed_of(learnt, ["tilt"])
    assert factors["tilt"] == pytest.approx(9.81, rel=0.05), text


def learnt_of(runs, reports, **changes):
    options = options_of("default", {**FAST, "moves": 300, "tuning_steps": 2})
    return identify_runs(
        [Run.of(*run) for run in runs], SIGNALS, options, reports=reports, workers=_core.Workers(), **changes
    )


def test_an_age_stays_once_it_is_settled_and_sensors_that_are_slow_no_more_have_none(monkeypatch):
    slow = (Held(10, 7), Held(10, 7), None)
    runs = logged((Held(10, 7, 6), Held(10, 7, 6), None), seeds=range(5))
    earlier = learnt_of(runs[:2], slow)
    ages = [age for _, _, _, age in earlier.model.reports[0]]
    monkeypatch.setattr("twinloop.identification.ages.briefly_described", None)  # nothing is searched again
    later = learnt_of(runs, slow, earlier=earlier, iteration=1)
    assert [age for _, _, _, age in later.model.reports[0]] == ages
    # One new flight may show that a sensor is not slow after all.
    assert learnt_of(logged((), seeds=range(5)), (), earlier=earlier, iteration=1).model.reports == ([], [])


def test_an_identification_that_an_earlier_version_began_goes_on_as_it_began():
    slow, kept = (Held(10, 10), Held(10, 10), None), []
    runs = logged(slow)
    whole = learnt_of(runs, slow, keep=kept.append)
    assert (
        whole.model.reports[0]
        and learnt_of(runs, slow, under_way=kept[0]).model.reports == whole.model.reports
    )
    begun = replace(kept[0], ages=(), runs=tuple(Run.of(*run) for run in runs))
    assert learnt_of(runs, slow, under_way=begun).model.reports == ([], [])


def test_readings_of_no_age_are_given_none():
    runs = logged((Held(10, 10), Held(10, 10), None), seeds=(0, 1, 2))
    learnt = identify_runs(
        [Run.of(*run) for run in runs], SIGNALS, options_of("default", FAST),
        reports=reports_in(trajectories(runs), SIGNALS), workers=_core.Workers(),
    )  # fmt: skip
    assert [age for _, _, _, age in learnt.model.reports[0]] == [0, 0]


def test_between_new_readings_is_a_cubic_and_only_they_count():
    states, rates = moving(3)
    reports = (Held(8, 5, 3), None, None)
    run = as_sensed(Run.of(given(reports, states), rates), reports, SIGNALS)
    fresh = np.array([0, *range(5, STEPS + 1, 8)])
    read = np.maximum(fresh - 3, 0)
    assert np.flatnonzero(run.weights[:, 0]).tolist() == read.tolist()
    assert run.weights[:, 1:].all() and np.array_equal(run.states[:, 1:], states[:, 1:])
    slopes = np.gradient(states[read, 0], read)
    spline = CubicHermiteSpline(read, states[read, 0], slopes)
    np.testing.assert_allclose(run.states[: read[-1], 0], spline(np.arange(read[-1])), rtol=1e-12, atol=1e-15)
    # Of what lies between readings their noise cannot be guessed.
    noisy = states + np.array([0.01, 0.0, 0.0]) * np.random.default_rng(0).normal(size=states.shape)
    slow = as_sensed(Run.of(given(reports, noisy), rates), reports, SIGNALS)
    guess = guessed_noise([slow], np.ones(3))[0]
    assert 0.005**2 < guess < 0.03**2


def test_runs_of_which_all_is_given_as_it_is_read_are_the_very_same():
    run = Run.of(*moving(0))
    assert as_sensed(run, (), SIGNALS) is run
