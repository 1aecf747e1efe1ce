"""What an engineer checks, beside slow formulas; and checks that tell a twin that lacks something from a whole one."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lives
import twinloop as tl
from conftest import TINY, pendulum_step
from twinloop.campaign.examination.check import Check, Checks
from twinloop.campaign.examination.checking import _damping, _delay, _of_controller, _of_following, _of_target
from twinloop.campaign.examination.correlation import autocorrelation, crosscorrelation, lags_of
from twinloop.campaign.examination.data import movements
from twinloop.campaign.examination.reaching import ending
from twinloop.campaign.examination.use import strongest_commands
from twinloop.law.linear.margins import LoopMargins
from twinloop.planning.proposal import Fared

STREAM = np.random.default_rng(7)


def slow_correlation(xs, us, lag):
    """The textbook formula, number by number, over runs: Σ (x_k − x̄)(u_{k−lag} − ū) over the root of both squares."""
    x_mean = sum(sum(x) for x in xs) / sum(len(x) for x in xs)
    u_mean = sum(sum(u) for u in us) / sum(len(u) for u in us)
    total = 0.0
    for x, u in zip(xs, us, strict=True):
        for k in range(lag, len(x)):
            total += (x[k] - x_mean) * (u[k - lag] - u_mean)
    squares = sum((v - x_mean) ** 2 for x in xs for v in x) * sum((v - u_mean) ** 2 for u in us for v in u)
    return total / math.sqrt(squares)


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(9, 30), min_size=1, max_size=3))
def test_correlations_are_those_of_the_textbook(seed, lengths):
    stream = np.random.default_rng(seed)
    xs = [stream.normal(size=(n, 2)) for n in lengths]
    us = [stream.normal(size=(n, 3)) for n in lengths]
    own = autocorrelation(xs, 4)
    assert own.values[:, 0] == pytest.approx(1.0)
    for i in range(2):
        column = [x[:, i].tolist() for x in xs]
        for lag in range(5):
            assert own.values[i, lag] == pytest.approx(slow_correlation(column, column, lag), abs=1e-12)
    both = crosscorrelation(xs, us, 4)
    for i in range(2):
        for j in range(3):
            for lag in range(1, 5):
                # Row k of a cause stands one period before row k.
                slow = slow_correlation(
                    [x[:, i].tolist() for x in xs], [u[:, j].tolist() for u in us], lag - 1
                )
                assert both.values[i, j, lag - 1] == pytest.approx(slow, abs=1e-12)


def test_white_noise_is_inside_its_limits_99_times_in_100_and_an_echo_is_not():
    white = [STREAM.normal(size=(400, 20)) for _ in range(3)]
    assert autocorrelation(white, 20).outside < 0.03
    echo = [x.copy() for x in white]
    for x in echo:
        x[3:] += 0.6 * x[:-3]
    found = autocorrelation(echo, 20)
    assert (np.abs(found.values[:, 3]) > found.limit).all()
    assert autocorrelation([np.zeros((50, 2))], 4).values[:, 1:] == pytest.approx(0.0)
    beside = autocorrelation([np.column_stack([run[:, 0], np.zeros(len(run))]) for run in echo], 20)
    assert beside.told.tolist() == [True, False]
    assert beside.outside == autocorrelation([run[:, :1] for run in echo], 20).outside


def test_what_a_command_moved_and_the_model_does_not_know_is_found_at_its_lag():
    commands = [STREAM.normal(size=(200, 2)) for _ in range(2)]
    innovations = [STREAM.normal(size=(200, 3)) for _ in range(2)]
    for e, u in zip(innovations, commands, strict=True):
        e[4:, 1] += 0.8 * u[:-4, 0]  # row k of a command is one period before row k of the innovations
    found = crosscorrelation(innovations, commands, 8)
    i, j, place = np.unravel_index(np.argmax(np.abs(found.values)), found.values.shape)
    assert (i, j, found.lags[place]) == (1, 0, 5.0)


def test_runs_that_are_short_bear_fewer_lags():
    assert [lags_of(lengths) for lengths in ([400, 300], [90, 400], [7], [])] == [20, 11, 0, 0]


@pytest.fixture(scope="module")
def good():
    return lives.learnt(pendulum_step, 4)


def test_flights_that_were_not_learnt_are_those_after_what_was_known(good):
    found = good.examine()
    assert [(flight.place, flight.learnt) for flight in found.unseen] == [(1, 1), (2, 2), (3, 3)]
    last = found.unseen[-1]
    run, asked = good.experiments[3], good._method.asked_model
    # By the formulas, on the engine's own free run.
    off = run.trajectory.states[1:] - last.predicted.states[1:]
    assert last.rmse == pytest.approx(np.sqrt((off**2).mean(axis=0)))
    spread = run.trajectory.states[1:] - run.trajectory.states[1:].mean(axis=0)
    assert last.fit == pytest.approx(100 * (1 - np.linalg.norm(off, axis=0) / np.linalg.norm(spread, axis=0)))
    low, high = last.predicted.band[:, 1:]
    read = run.trajectory.states[1:]
    assert last.inside == pytest.approx(((read >= low) & (read <= high)).mean())
    assert str(asked.program) == str(good._method.memory.asked.models[-1].program)
    assert last.error == pytest.approx(run.before / run.frozen)


def test_each_flight_stands_beside_the_free_run_of_today_and_its_readings_in_the_band(good):
    found = good.examine()
    assert [each.run for each in found.beside] == list(good.experiments)
    for each in found.beside:
        read, (low, high) = each.run.trajectory.states, each.simulated.band
        np.testing.assert_array_equal(each.flown.states, read)
        np.testing.assert_allclose(low + 0.5 * (each.places + 1.0) * (high - low), read, atol=1e-12)
        assert each.inside == pytest.approx(((read >= low) & (read <= high))[1:].mean())


def test_the_commands_that_are_shown_with_a_state_are_those_that_correlate_with_its_derivative():
    signals = tl.Signals(
        states=[tl.State("x", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="x")],
        commands=[tl.Command(name, "1", (-9.0, 9.0)) for name in "abcd"],
        dt=0.1,
    )
    sent = STREAM.normal(size=(50, 4))
    v = np.concatenate([[0.0], np.cumsum(3.0 * sent[:, 3] - 2.0 * sent[:, 1] + 0.1 * sent[:, 0])])
    flight = tl.Trajectory(0.1 * np.arange(51), np.stack([np.cumsum(v), v], axis=1), sent)
    assert strongest_commands(flight, signals, 0) == strongest_commands(flight, signals, 1) == [1, 3]
    by_numpy = np.abs([np.corrcoef(np.diff(v), u)[0, 1] for u in sent.T])
    assert set(np.argsort(by_numpy)[2:]) == {1, 3}


def test_looking_at_a_campaign_changes_nothing(good):
    before = good.to_record()
    good.checks()
    assert good.to_record() == before


def test_a_twin_of_a_pendulum_passes_and_says_how_sure_it_is(good):
    checks = good.checks()
    assert checks.twin_passed
    names = [check.name for check in checks]
    assert {"follows", "remarks", "unseen-flight", "band", "whiteness", "commands", "stable"} <= set(names)
    assert all(check.sentence and check.subject in ("twin", "controller") for check in checks)


def from_readings(readings, commands):
    """What the check `follows` says of a twin that was learnt from one log alone, and its serious remarks."""
    n = len(commands)
    log = tl.Trajectory(lives.SIGNALS.dt * np.arange(n + 1), readings, commands)
    campaign = lives.made(duration=n * lives.SIGNALS.dt)
    campaign.attach(log)
    remarks = {remark.code for remark in campaign.twin.remarks if remark.serious}
    return campaign, next(check for check in campaign.checks() if check.name == "follows"), remarks


def test_a_twin_that_stays_where_a_log_stays_follows_it_and_has_learnt_nothing():
    campaign, follows, remarks = from_readings(np.tile([0.3, 0.0], (61, 1)), np.full((60, 1), 0.5))
    assert (campaign.rmse == 0.0).all() and campaign.twin.follows
    assert follows.passed and follows.value == 0.0
    assert "Nothing moves in the 1 experiment" in str(follows) and "nothing can be learnt" in str(follows)
    assert "error" not in str(follows) and remarks == {"nothing-moved"}
    assert not campaign.checks().twin_passed


def test_what_never_answers_its_commands_is_followed_by_nothing():
    stream = np.random.default_rng(1)
    campaign, follows, remarks = from_readings(
        np.tile([0.3, 0.0], (61, 1)), stream.uniform(-1.0, 1.0, (60, 1))
    )
    assert not campaign.twin.follows and not follows.passed
    assert "No reading moves" in str(follows) and "error" not in str(follows)
    assert "never-moved" in remarks and "nothing-moved" not in remarks


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_not_said_to_be_followed(seed):
    stream = np.random.default_rng(seed)
    _, follows, remarks = from_readings(
        [0.3, 0.0] + 1e-2 * stream.normal(size=(151, 2)), stream.uniform(-1.0, 1.0, (150, 1))
    )
    assert "only-noise" in remarks and not follows.passed


@pytest.mark.parametrize(("errors", "passed"), [([0.1, 0.1, 1.1], True), ([0.1, 1.1, 1.1], False)])
def test_what_is_followed_no_better_than_by_a_model_that_never_moves_does_not_pass(good, errors, passed):
    rows = [SimpleNamespace(closed_loop=0.1, normalised=error) for error in errors]
    twin = SimpleNamespace(errors=rows, follows=True, remarks=())
    check = _of_following(SimpleNamespace(twin=twin, learnt=3, experiments=good.experiments))
    assert check.passed is passed and check.value == 1.1
    assert ("no better than a model that never moves" in str(check)) is not passed


def test_nothing_is_said_of_an_envelope_that_nobody_declared():
    states = [dataclasses.replace(state, envelope=None) for state in lives.SIGNALS.states]
    campaign = lives.learnt(
        pendulum_step, 2, signals=tl.Signals(states, lives.SIGNALS.commands, lives.SIGNALS.dt)
    )
    checks = {check.name: check for check in campaign.checks()}
    assert "envelope" not in checks and checks["no-envelope"].verdict == "look"
    assert "diverges" in checks["divergence"].sentence
    said = "\n".join(each.sentence for name, each in checks.items() if name != "no-envelope")
    assert "envelope" not in said


def test_what_was_known_is_kept_with_the_campaign(good):
    again = tl.Campaign.from_record(good.to_record(), threads=1)
    assert [str(check) for check in again.checks()] == [str(check) for check in good.checks()]


def test_an_older_record_without_earlier_models_is_read(good):
    record = good.to_record()
    for part in ("asked", "latest"):
        del record["memory"][part]["models"]
    again = tl.Campaign.from_record(record, threads=1)
    assert [flight.place for flight in again.examine().unseen] == [3]


def test_a_twin_that_was_never_tried_on_a_flight_it_had_not_learnt_does_not_pass():
    found = lives.lived(lives.new("default"), ("tell",)).checks()
    failed = {check.name: check for check in found.failed}
    assert not found.twin_passed and failed["unseen-flight"].value is None
    assert "Fly one more" in failed["unseen-flight"].sentence


def test_a_twin_without_an_end_stop_that_the_system_has_does_not_pass():
    checks = lives.learnt(lives.with_end_stop, 3).checks()
    assert not checks.twin_passed
    assert {check.subject for check in checks.failed} >= {"twin"}


def test_gains_have_flown_in_whichever_test_they_flew(good):
    run = good.experiments[0]
    stopped = dataclasses.replace(run, trajectory=lives.cut(run.trajectory, 9))
    for runs, sentence in (
        ((run,), "have completed a flight within"),
        ((stopped,), "have not completed a flight within"),
        (good.experiments[1:], "have not flown yet"),
    ):
        found = good.examine()
        found.best, found.experiments = dataclasses.replace(run.test.quiet(), number=99), runs
        (check,) = (check for check in _of_controller(found) if check.name == "flown")
        assert sentence in check.sentence and check.passed == (runs == (run,))
        assert check.binding == (runs != good.experiments[1:])  # what has not flown may still fly well


def test_the_least_movement_is_that_of_the_state_that_moved_least_in_its_best_flight(good):
    (check,) = (check for check in good.checks() if check.name == "movement")
    slow = []
    for state, sensor in enumerate(good.twin.noise.sensors):
        flights = [run.trajectory.states[:, state] for run in good.experiments]
        slow.append(max(np.sqrt(((x - x.mean()) ** 2).mean()) for x in flights) / sensor)
    assert check.value == pytest.approx(min(slow)) and check.value > 10.0
    assert check.verdict == "passed" and not check.binding
    states = good.experiments[0].trajectory.states
    assert movements(states, [0.5, 2.0] * states.std(axis=0)) == pytest.approx([2.0, 0.5])
    assert movements(states, np.array([0.1, 0.0]))[1] == np.inf and movements(states, np.zeros(2)) is None


@pytest.mark.parametrize(("delay", "verdict"), [(0.049, "failed"), (0.051, "passed"), (np.inf, "passed")])
def test_a_loop_that_bears_less_than_a_period_of_delay_is_not_flown(good, delay, verdict):
    (loop,) = good.examine().margins.worst
    check = _delay(dataclasses.replace(loop, delay=delay), 0.05, 20, True)
    assert check.verdict == verdict and check.binding
    assert (loop.loop in check.sentence) == np.isfinite(delay)


def test_a_binding_check_that_could_not_be_made_does_not_hold(good):
    found = good.examine()
    found._found_loops = "Linear analysis: expected a slope, found none."
    unmade = [check for check in Checks(_of_controller(found)).failed if "Not made" in check.sentence]
    assert [check.name for check in unmade] == ["stable", "sensitivity", "delay"]
    assert "expected a slope, found none" in unmade[0].sentence
    assert all(check.value is None and check.verdict == "failed" for check in unmade)


@pytest.mark.parametrize(
    ("fared", "planned", "verdict", "said"),
    [
        (Fared(0, 0), 11.9, "failed", "have not flown"),
        (Fared(1, 0), 11.9, "passed", "their only flight"),
        (Fared(3, 0), 11.9, "passed", "each of their 3 flights"),
        (Fared(3, 1), 11.9, "failed", "1 of their 3 flights"),
        (Fared(3, 0), 12.1, "failed", "the twin predicts that these gains leave it"),
    ],
)
def test_without_a_committee_flights_of_the_gains_decide_on_the_envelope(good, fared, planned, verdict, said):
    """Of a rate within ± 12 rad/s, on the twin, too."""
    found = good.examine()
    found.planned = tl.Trajectory([0.0, 0.05], [[0.0, 0.0], [0.0, planned]], [[0.0]])
    found.best = dataclasses.replace(found.best.quiet(), risk=None)
    found._fared = lambda genes: fared
    (check,) = (check for check in _of_controller(found) if check.name == "envelope")
    assert (check.verdict, check.value, check.binding) == (verdict, None, True) and said in check.sentence
    assert ("Not made" in check.sentence) == (verdict == "failed")


@pytest.mark.parametrize(("most", "kept"), [(5.0, True), (2.0, False)])
def test_gains_of_the_paper_are_certified_for_the_envelope_only_by_flights_inside(most, kept):
    """The swing turns at 3.7 rad/s, and nothing but its flights says so."""
    angle, rate = lives.SIGNALS.states
    states = [angle, dataclasses.replace(rate, envelope=(-most, most))]
    signals = tl.Signals(states, lives.SIGNALS.commands, lives.SIGNALS.dt)
    campaign = tl.Campaign(
        signals, controller=lives.CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0,
        threads=1, preset="paper", options=TINY,
    )  # fmt: skip
    lives.flown(campaign, lives.PLANT)
    assert campaign.experiments[0].kept_envelope == kept
    found = campaign.certificate()
    checks = {check.name: check for check in found.checks}
    assert found.best.risk is None
    for name in ("envelope", "flown"):
        assert checks[name].binding and checks[name].passed == kept
        assert (checks[name].sentence in found.refusals) != kept
    assert any("no committee that estimates it" in sentence for sentence in found.not_tested)


HEATED = tl.Signals(
    states=[tl.State("temp", "degC", 50.0), tl.State("level", "m", 1.0)],
    commands=[tl.Command("heater", "kW", (0.0, 20.0)), tl.Command("pump", "l/s", (0.0, 2.0))],
    dt=5.0,
)


def ended(temp, heater, weights=(0.02, 1.0), sensor=0.05):
    """The end of a flight from 20 to 40 degC at a level that stays, of 100 periods; the pump is used in part."""
    states = np.stack([np.linspace(20.0, temp, 101), np.full(101, 0.5)], axis=1)
    states[-10:, 0] = temp
    flight = tl.Trajectory(
        5.0 * np.arange(101), states, np.stack([np.full(100, heater), np.full(100, 0.8)], 1)
    )
    start, target = np.array([20.0, 0.5]), np.array([40.0, 0.5])
    return ending(flight, HEATED, start, target, np.array(weights), np.array([sensor, 0.002]))


def test_a_flight_that_ends_far_from_its_target_says_how_far_and_which_command_had_nothing_left():
    end = ended(20.2, 20.0)
    assert str(end) == "It ends 19.8 degC from temp's target of 40 degC, with heater at its bound of 20 kW."
    (miss,) = end.misses
    assert miss.share == pytest.approx(0.99)
    check = _of_target(end)
    assert check.verdict == "look" and str(end) in check.sentence
    for reached in (ended(39.0, 20.0), ended(20.2, 20.0, weights=(0.0, 1.0)), ended(37.0, 3.0, sensor=2.0)):
        assert not reached.misses and _of_target(reached).verdict == "passed" and not str(reached)
    assert not ended(20.2, 19.0).held


def test_a_target_that_moves_is_not_missed_at_its_end(good):
    found = good.examine()
    assert found.ending is not None
    moving = np.tile(found.setup.target_state, (found.setup.steps + 1, 1))
    again = good.examine()
    again.setup = dataclasses.replace(found.setup, target_state=moving)
    assert again.ending is None


def test_only_what_binds_decides():
    good = Check("a", "twin", 1.0, 2.0, True, True, "Fine.")
    look = dataclasses.replace(good, name="b", passed=False, binding=False)
    bad = dataclasses.replace(good, name="c", passed=False, subject="controller")
    assert Checks([good, look]).passed and not Checks([good, look, bad]).passed
    assert Checks([good, look, bad]).twin_passed
    assert [check.verdict for check in (good, look, bad)] == ["passed", "look", "failed"]
    assert str(Checks([good, bad])).splitlines()[1].startswith("failed")
    with pytest.raises(tl.InvalidInput, match="subject"):
        dataclasses.replace(good, subject="weather")


@pytest.mark.parametrize(("sensitivity", "verdict"), [(1.5, "passed"), (3.0, "look"), (5.0, "failed")])
def test_a_loop_near_the_edge_is_not_to_be_flown(sensitivity, verdict):
    loop = LoopMargins("roll", True, 2.0, 0.0, 0.5, 0.01, 10.0, sensitivity, 1.0)
    assert _damping(loop).verdict == verdict
