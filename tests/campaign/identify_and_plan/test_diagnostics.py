"""What is said against data: units and signs that contradict what was declared, copies, runs that were cut."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS
from logged_flights import of_quadrotor
from twinloop.campaign.data.readings import froze, ratio
from twinloop.campaign.data.reports import derived, repeats
from twinloop.campaign.data.sent import change_that_rights, exchanged, other_commands
from twinloop.campaign.examination.log_check import against
from twinloop.campaign.identify_and_plan.diagnostics import Findings, diagnostics_of, distinct
from twinloop.campaign.identify_and_plan.elsewhere import Elsewhere
from twinloop.campaign.identify_and_plan.misses import Miss, unexplained

DT, STEPS = 0.02, 200
SIGNALS = tl.Signals(
    [
        tl.State("height", "m", scale=2.0),
        tl.State("angle", "rad", scale=1.0),
        tl.State("rate", "rad/s", scale=5.0, derivative_of="angle"),
    ],
    [tl.Command("torque", "N m", bounds=(-1.0, 1.0))],
    dt=DT,
)


def flown(seed=0, size=0.5, noise=0.003, change=lambda x: x, cut=False, commands=None):
    """A record of an angle that swings, with its rate, both read with noise."""
    stream, t = np.random.default_rng(seed), DT * np.arange(STEPS + 1)
    angle = size * np.sin(3.0 * t + 0.3 * seed) + 0.2 * size * np.cos(7.0 * t)
    rate = size * 3.0 * np.cos(3.0 * t + 0.3 * seed) - 1.4 * size * np.sin(7.0 * t)
    states = np.column_stack([0.1 * t, angle, rate]) + noise * stream.normal(size=(STEPS + 1, 3))
    trajectory = tl.Trajectory(
        t, change(states), 0.1 * np.sin(5.0 * t[:-1, None]) if commands is None else commands
    )
    return SimpleNamespace(
        trajectory=trajectory, complete=not cut, test=None, off_start=(), attached=True, log="", number=None
    )


def said(*runs, follows=True):
    return [remark.sentence for remark in diagnostics_of(runs, SIGNALS, STEPS, Findings(follows))]


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.1])
def test_nothing_is_said_of_states_that_do_as_declared(noise):
    assert said(flown(noise=noise), flown(1, noise=noise)) == []


def test_nothing_is_said_of_a_state_that_does_not_move():
    assert said(flown(size=0.0), flown(1, size=0.0)) == []


def test_a_biased_rate_is_no_other_unit():
    assert said(flown(change=lambda x: x + np.array([0.0, 0.0, 0.1]))) == []


def test_an_angle_that_wraps_is_said_to_with_its_run_and_nothing_that_follows_from_it():
    def wrapped(states):
        turned = states + np.array([0.0, 3.0, 0.0])
        turned[:, 1] = np.angle(np.exp(1j * turned[:, 1]))
        return turned

    (remark,) = said(flown(), flown(1, change=wrapped))
    assert remark.startswith("angle jumps by a whole turn in run 2 of 2 at ")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x: x * [1.0, 180.0 / np.pi, 1.0], r"angle changes 57\.\d times as fast as rate"),
        (lambda x: x * [1.0, 1.0, 180.0 / np.pi], r"angle changes 0\.017\d times as fast as rate"),
        (lambda x: x * [1.0, -1.0, 1.0], r"angle changes -(1|1\.0\d|0\.9\d*) times as fast as rate"),
        (lambda x: x[:, [0, 2, 1]], "angle does not change as rate|angle changes"),
        (lambda x: x[:, [1, 0, 2]], "angle does not change as rate|angle changes"),
    ],
    ids=["angle in degrees", "rate in degrees", "sign", "exchanged", "another column"],
)
def test_a_state_that_contradicts_its_declared_derivative_is_named(change, words):
    (sentence,) = said(flown(change=change), flown(1, change=change))
    assert re.search(words, sentence) and "check their units" in sentence


def test_copies_of_a_record_count_once_and_are_told():
    first, second = flown(), flown(1)
    assert distinct([first, second, flown(), second]) == [first, second]
    (sentence,) = said(first, second, flown(), second)
    assert sentence.startswith("2 of 4 records are exact copies of an earlier one")


def test_runs_that_were_all_cut_and_a_twin_that_does_not_follow_are_told():
    assert "No run was complete" in said(flown(cut=True))[0]
    assert said(flown(cut=True), flown(1)) == []
    assert "does not follow" in said(flown(), follows=False)[0]


def test_where_nothing_answered_the_commands_no_other_effect_is_looked_for():
    (remark,) = diagnostics_of([flown(size=0.0)], SIGNALS, STEPS, Findings(False, unanswered=True))
    assert remark.sentence.endswith("the remarks before this one say why.")


def test_where_the_records_show_no_wrong_sign_none_is_looked_for():
    (sentence,) = said(flown(), flown(1), follows=False)
    assert "check the signs" not in sentence and "contact" in sentence
    wrong = said(flown(change=lambda x: x * [1.0, -1.0, 1.0]), follows=False)
    assert "check their units and signs" in wrong[0] and "contact" not in wrong[1]


def test_where_no_rate_is_logged_and_no_law_follows_it_is_said_what_to_log():
    alone = tl.Signals([tl.State("angle", "rad", 1.0)], SIGNALS.commands, DT)
    run = flown()
    run.trajectory = tl.Trajectory(run.trajectory.t, run.trajectory.states[:, 1:2], run.trajectory.commands)
    for found in (Findings(False), Findings(True, misses=[Miss(0, (0,), 0.2, 4.5, False)])):
        (remark,) = diagnostics_of([run], alone, STEPS, found)
        assert "No rate of angle is logged" in remark.sentence and "lags=1" in remark.sentence
    assert "lags=1" not in said(flown(), follows=False)[0]


def remarked(*runs, **found):
    return [
        (remark.code, remark.serious)
        for remark in diagnostics_of(runs, SIGNALS, STEPS, Findings(True, **found))
    ]


def test_a_free_run_that_noise_does_not_explain_is_a_serious_remark():
    assert remarked(flown(), misses=[]) == []
    assert remarked(flown(), misses=[Miss(1, (0,), 0.2, 4.5, False)]) == [("free-run", True)]
    assert remarked(flown(), flown(1), misses=[Miss(1, (1,), np.inf, np.inf, False)]) == [("free-run", True)]
    assert remarked(flown(), unmoved=["yaw_rate"]) == [("unmoved", True)]
    assert remarked(flown(), recurring=["yaw_rate"]) == [("model-error", False)]
    assert remarked(flown(), others=[3]) == [("other-commands", True)]


def test_the_states_that_a_free_run_misses_are_named():
    angle, rate = Miss(1, (0,), 0.25, 4.5, False), Miss(2, (1, 0), 0.04, 9.0, True)
    (remark,) = diagnostics_of([flown(), flown(1)], SIGNALS, STEPS, Findings(True, misses=[angle, rate]))
    assert (
        "over the 2 runs so far" in remark.sentence  # a twin of before has not learnt the last
        and "There is an effect that no term describes." in remark.sentence
    )
    assert (
        "rate on 2 of them, most on log 2 (up to 4 % of its range, 9 times what noise and disturbances explain),"
        " angle on log 1 (up to 25 %" in remark.sentence
    )
    rate = Miss(2, (0,), 0.04, 9.0, True)
    (remark,) = diagnostics_of([flown()], SIGNALS, STEPS, Findings(True, misses=[rate]))
    assert "may be an external disturbance or a model error" in remark.sentence
    (remark,) = diagnostics_of(
        [flown()], SIGNALS, STEPS, Findings(True, misses=[Miss(2, (0,), 11.2, 9.0, True)])
    )
    assert "rate on log 1 (up to 11 times its range, 9 times what" in remark.sentence
    (remark,) = diagnostics_of(
        [flown()], SIGNALS, STEPS, Findings(True, misses=[Miss(0, (0,), np.inf, np.inf, False)])
    )
    assert "the twin diverges on log 1." in remark.sentence


def test_what_noise_and_disturbances_explain_is_held_against_no_twin():
    free, frozen = np.array([1e-4, 9.1e-4, 9.1e-4, 1e-2, np.inf]), np.full(5, 1.0)
    expected = np.array([1e-9, 1e-9, 1e-4, 1e-3, 1e-3])
    # Too small to matter, up to 3 % of how far the flight went; then beyond three times what is expected, or not.
    ratios = unexplained(free, frozen, expected, np.ones(5, bool))
    assert ratios[:3].tolist() == [0.0, pytest.approx(np.sqrt(9.1e5)), pytest.approx(np.sqrt(9.1))]
    assert ratios[3] == pytest.approx(np.sqrt(10.0)) and np.isposinf(ratios[4])
    steered, unsteered = np.array([True]), np.array([False])
    assert unexplained(np.array([8e-3]), np.ones(1), np.array([1e-3]), steered).tolist() == [0.0]
    # A flight that its controller kept from diverging did not; under recorded commands alone a twin may, if noise can.
    lost = np.array([np.inf])
    assert unexplained(lost, np.ones(1), lost, steered).tolist() == [np.inf]
    assert unexplained(lost, np.ones(1), lost, unsteered).tolist() == [0.0]


def test_commands_of_another_controller_are_found(new_campaign, pendulum):
    """Recorded in degrees, or with another sign, the states would have given other commands."""
    campaign = new_campaign()
    test = campaign.test(PENDULUM_GAINS)
    run = pendulum.run(test)
    flights = [SimpleNamespace(test=test, number=test.number, trajectory=run)]
    assert other_commands(flights) == []
    for states in (run.states * [57.3, 1.0], -run.states):
        wrong = SimpleNamespace(states=states, commands=run.commands)
        assert other_commands([SimpleNamespace(test=test, number=0, trajectory=wrong)]) == [0]


def test_two_commands_exchanged_among_four_are_found_and_named():
    test, run = of_quadrotor()

    def recorded(columns):
        commands = run.commands[:, columns]
        flight = tl.Trajectory(run.t, run.states, commands)
        return SimpleNamespace(test=test, replayed=test, number=0, trajectory=flight, off_start=())

    assert other_commands([recorded([0, 1, 2, 3])]) == []
    for columns in ([1, 0, 2, 3], [2, 1, 0, 3], [0, 3, 2, 1]):
        wrong = recorded(columns)
        assert other_commands([wrong]) == [0]
        pair = exchanged(wrong)
        assert [columns[i] for i in pair] == list(pair[::-1])
        names = [test.signals.commands[i].name for i in pair]
        (said_of_it,) = against(wrong, test, test.signals)
        assert said_of_it.sentence.endswith(f"They would be with {names[0]} and {names[1]} exchanged.")


@pytest.mark.parametrize("state", ["angle", "rate"])
def test_a_command_exchanged_with_a_state_is_found_and_both_are_named(new_campaign, pendulum, state):
    test = new_campaign().test(PENDULUM_GAINS)
    run = pendulum.run(test)
    i = test.signals.state_names.index(state)
    states, commands = run.states.copy(), run.commands.copy()
    states[:-1, i], commands[:, 0] = run.commands[:, 0], run.states[:-1, i]

    def flight(states, commands):
        found = tl.Trajectory(run.t, states, commands)
        return SimpleNamespace(test=test, replayed=test, number=0, trajectory=found, off_start=())

    assert other_commands([flight(run.states, run.commands)]) == []
    assert "exchanged" not in change_that_rights(flight(run.states, -run.commands))
    wrong = flight(states, commands)
    assert change_that_rights(wrong) == f"{state} and torque exchanged" and other_commands([wrong]) == [0]
    (sentence,) = (
        each.sentence for each in against(wrong, test, test.signals) if each.code == "other-commands"
    )
    assert sentence.endswith(f"They would be with {state} and torque exchanged.")


def codes(*runs):
    return [remark.code for remark in diagnostics_of(runs, SIGNALS, STEPS, Findings(True))]


def frozen(x, i=1, row=STEPS // 2):
    x = x.copy()
    x[row:, i] = x[row, i]
    return x


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_sensor_that_freezes_half_way_is_a_serious_remark(noise):
    found = diagnostics_of([flown(noise=noise, change=frozen)], SIGNALS, STEPS, Findings(True))
    assert ("frozen", True) in [(remark.code, remark.serious) for remark in found]
    assert "angle is constant over" in " ".join(remark.sentence for remark in found)
    back = flown(noise=noise, change=lambda x: np.concatenate([frozen(x, row=60)[:100], x[100:]]))
    assert "frozen" in codes(back)


def test_what_comes_to_rest_or_is_rounded_is_not_frozen():
    t = DT * np.arange(STEPS + 1)
    assert not froze(np.round(np.exp(-20.0 * t), 12)) and not froze(np.zeros(STEPS + 1))
    assert not froze(np.round(np.sin(3.0 * t), 1)) and not froze(np.round(0.5 * t, 2))
    stream = np.random.default_rng(0)
    assert not froze(stream.normal(size=STEPS + 1))


def test_a_coarse_encoder_that_creeps_to_rest_count_by_count_is_not_frozen_but_one_that_stops_at_once_is():
    t = DT * np.arange(STEPS + 1)
    count = 2e-3
    creeps = 1.0 - np.exp(-8.0 * t / t[-1])
    assert not froze(count * np.round(creeps / count))
    turns = np.sin(3.0 * np.minimum(t, 0.7 * t[-1]) / t[-1])
    assert froze(count * np.round(turns / count))


@pytest.mark.parametrize("value", [0.0, 0.7])
def test_a_command_that_never_changes_is_named(value):
    constant = np.full((STEPS, 1), value)
    assert codes(flown(commands=constant)) == ["constant-command"]
    assert codes(flown(commands=constant), flown(1)) == []


def test_readings_of_nothing_but_noise_are_a_serious_remark():
    stream = np.random.default_rng(3)
    noise = flown(change=lambda x: 0.1 * stream.normal(size=x.shape))
    assert "only-noise" in codes(noise)
    assert ratio([stream.normal(size=5000)]) == pytest.approx(2.0, abs=0.1)
    # One state that is at rest, read with noise, beside others that move.
    assert "only-noise" not in codes(
        flown(change=lambda x: x * [1.0, 1.0, 0.0] + 0.01 * stream.normal(size=x.shape))
    )


@pytest.mark.parametrize("spike", [1e3, 1e6, -1e6])
def test_a_single_wrong_reading_makes_no_noise_of_a_log(spike):
    def wrong(x):
        x = x.copy()
        x[STEPS // 2] = spike
        return x

    assert "only-noise" not in codes(flown(change=wrong))


def test_what_no_controller_corrects_is_held_against_no_effect_alone():
    (remark,) = diagnostics_of([flown(), flown(1)], SIGNALS, STEPS, Findings(False, without_test=True))
    assert remark.code == "does-not-follow" and remark.serious
    assert "a right model of its stability" in remark.sentence and "backlash" not in remark.sentence


def test_logs_that_disturbances_take_a_replay_away_from_accuse_no_law():
    found = {"without_test": True, "disturbed": ["rate"]}
    (remark,) = diagnostics_of([flown(), flown(1)], SIGNALS, STEPS, Findings(False, **found))
    assert remark.code == "does-not-follow" and remark.serious
    assert "What seems to disturb rate would take a replay of the right law as far." in remark.sentence
    assert "Fly a test" in remark.sentence and "no term describes" not in remark.sentence


def test_flights_that_were_followed_in_pieces_are_named():
    runs, whole = [flown(), flown(1)], flown().trajectory.steps
    (remark,) = diagnostics_of(runs, SIGNALS, STEPS, Findings(True, pieces=[whole, whole // 2]))
    assert (
        remark.code == "in-pieces"
        and not remark.serious
        and "1 of the runs without a test was" in remark.sentence
    )
    assert diagnostics_of(runs, SIGNALS, STEPS, Findings(True, pieces=[whole, whole])) == []


def test_a_bias_that_outgrows_a_fast_swing_is_no_contradiction_and_a_small_swing_is_enough_for_a_unit():
    fast = {"size": 0.05, "noise": 0.001}
    assert said(flown(**fast, change=lambda x: x + np.array([0.0, 0.0, 0.1]))) == []
    small = {"size": 0.05, "noise": 0.004}
    assert said(flown(**small)) == []
    (sentence,) = said(flown(**small, change=lambda x: x * [1.0, 1.0, 180.0 / np.pi]))
    assert "times as fast as rate" in sentence


def judged(number, predicted, spread, measured):
    """A flight that says nothing but how its prediction fared."""
    run = flown(number)
    run.test, run.quality = SimpleNamespace(number=number, predicted=predicted, spread=spread), measured
    return run


@pytest.mark.parametrize(
    ("flights", "severity"),
    [
        ([(1.0, 0.05, 1.3), (0.9, 0.05, 1.2)], "serious"),
        ([(1.0, 0.05, 0.8), (0.9, 0.05, 0.7)], "serious"),
        ([(1.0, 0.05, 1.3), (0.9, 0.05, 0.7)], None),  # one too good, one too bad
        ([(1.0, 0.05, 1.3), (0.9, 0.05, 0.99)], None),  # the last one came true
        ([(1.0, 0.05, 1.3), (0.9, 0.05, 1.2), (0.9, 0.05, 0.91)], None),
        ([(1.0, 0.001, 1.3), (0.9, 0.001, 0.92)], "note"),  # two spreads, and hardly anything
        (
            [(1.0, 0.05, 1.3), (0.9, 0.05, None), (0.9, 0.05, 1.2)],
            "serious",
        ),  # one that was cut has no quality
        ([(1.0, 0.05, 1.3), (np.inf, np.inf, 1.0), (None, None, 1.0), (0.9, 0.05, 1.2)], "serious"),
        ([(0.9, 0.05, 1.2)], None),
    ],
)
def test_two_predictions_in_a_row_that_missed_to_one_side_are_named(flights, severity):
    runs = [judged(number, *flight) for number, flight in enumerate(flights)]
    found = [
        one
        for one in diagnostics_of(runs, SIGNALS, STEPS, Findings(True))
        if one.code == "missed-predictions"
    ]
    assert [one.severity for one in found] == ([] if severity is None else [severity])
    for one in found:
        (first, *_, last) = (
            f"test {number} ({predicted:.4g} ± {spread:.2g} predicted, {measured:.4g} measured)"
            for number, (predicted, spread, measured) in enumerate(flights)
            if predicted is not None and np.isfinite(predicted) and measured is not None
        )
        better = flights[-1][2] < flights[-1][0]
        assert f"{'better' if better else 'worse'} than predicted" in one.sentence
        assert f"{first} and {last}." in one.sentence


def every(periods, start=3):
    """Makes a sensor of the height give a new reading each so many periods."""

    def change(states):
        rows = start + (np.arange(len(states)) - start) // periods * periods
        states[:, 0] = states[np.maximum(rows, 0), 0]
        return states

    return change


@pytest.mark.parametrize("periods", [2, 10])
def test_a_slow_sensor_is_named_with_its_period(periods):
    runs = [flown(seed, change=every(periods)) for seed in range(2)]
    (said,) = [
        one for one in diagnostics_of(runs, SIGNALS, STEPS, Findings(True)) if one.code == "repeated-readings"
    ]
    assert said.sentence.startswith(
        f"height repeats every reading: it gives a new one each {periods} periods"
    )
    assert not said.serious


def test_readings_that_come_anew_or_now_and_then_are_no_slow_sensor():
    stream = np.random.default_rng(0)
    fresh = stream.normal(size=300)
    counted = np.round(3.0 * np.sin(0.02 * np.arange(300)) / 0.2) * 0.2
    now_and_then = np.repeat(fresh[:60], stream.integers(1, 9, 60))
    evenly = np.floor(0.1 * (np.arange(300) + 0.5) / 0.3 + 1e-9)
    assert np.array_equal(np.unique(np.diff(np.flatnonzero(np.diff(evenly)))), [3])
    assert [repeats([one]) for one in (fresh, counted, now_and_then, np.zeros(50), evenly)] == [None] * 5


@pytest.mark.parametrize("keeps", [0.0, 0.7])
def test_a_rate_that_is_computed_from_an_angle_is_named(keeps):
    def change(states):
        rate = states[0, 2] = 0.0
        for k in range(1, len(states)):
            rate = keeps * rate + (1.0 - keeps) * (states[k, 1] - states[k - 1, 1]) / DT
            states[k, 2] = rate
        return states

    runs = [flown(seed, change=change) for seed in range(2)]
    (said,) = [
        one for one in diagnostics_of(runs, SIGNALS, STEPS, Findings(True)) if one.code == "derived-rate"
    ]
    assert said.sentence.startswith("rate is computed from the readings of angle")


def test_sensors_of_their_own_and_exact_steps_are_not_computed_from_each_other():
    assert list(derived([flown(seed).trajectory.states for seed in range(2)])) == []
    # A step of Euler with the new rate: without noise the rate is the angle's difference, too.
    x, states = np.array([1.0, 0.0]), []
    for _ in range(300):
        rate = x[1] - DT * 9.0 * np.sin(x[0])
        x = np.array([x[0] + DT * rate, rate])
        states.append(x)
    assert list(derived([np.array(states)])) == []
    # In few coarse steps motion looks like noise, and at rest like a sensor that rounds.
    x, states = np.array([0.0, 0.0]), [np.zeros(2)] * 30
    for k in range(41):
        rate = x[1] + 0.05 * (20.0 * (np.sin(0.4 * k) + 0.5) - 24.0 * np.sin(x[0]) - x[1])
        x = np.array([x[0] + 0.05 * rate, rate])
        states = [*states, x]
    assert list(derived([np.array(states[30:])])) == list(derived([np.array(states)])) == []


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (Elsewhere(32, 8, 8), None),
        (
            Elsewhere(32, 9, 8),
            "Of 32 controllers .* under 9 laws of the committee differ by more than a fifth",
        ),
        (Elsewhere(20, 0, 6), "under 6 the law differs from that of before the last flight by more"),
        (Elsewhere(4, 2, 4), "under 2 laws of the committee differ and under 4 the law differs from"),
        (Elsewhere(24, 2, 2, 8), None),
        (
            Elsewhere(23, 2, 2, 9),
            "Under 9 of 32 controllers drawn from the whole box of gains all laws that are known",
        ),
        (Elsewhere(2, 1, 0, 30), "wrong there. Of the other 2, under 1 laws of the committee differ by more"),
        (Elsewhere(), None),
    ],
)
def test_it_is_said_where_much_of_the_box_of_gains_is_still_open(found, words):
    said = diagnostics_of([flown(), flown(1)], SIGNALS, STEPS, Findings(True, elsewhere=found))
    assert [remark.code for remark in said] == ["elsewhere"] * (words is not None)
    assert words is None or (re.search(words, said[0].sentence) and not said[0].serious)
    # Of a twin that does not even follow its own flights that is no news.
    assert "elsewhere" not in [
        remark.code for remark in diagnostics_of([flown()], SIGNALS, STEPS, Findings(False, elsewhere=found))
    ]
