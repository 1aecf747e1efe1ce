"""The life of a test: asked, flown, aborted, failed, abandoned; and flights that nobody asked for."""

import json
from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from lives import FULL_LIFE, PLANT, SIGNALS, begun, by_hand, cut, lived, made, outcome, plain
from lives import new as begin
from oracles import same_bits
from twinloop.campaign.examination import log_check
from twinloop.campaign.history import called
from twinloop.faces.result import summary, to_json
from twinloop.faces.text import render

GAINS = {"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3}


def in_scales(off):
    """Mean square, each state in units of its scale."""
    return np.mean((off / [state.scale for state in SIGNALS.states]) ** 2)


# Flights that nobody asked for


def test_an_attached_flight_is_learnt_from_and_judged_under_its_recorded_commands():
    campaign, record = made(), by_hand(55)
    campaign.attach(record)
    (run,) = campaign.experiments
    assert run.test is None and run.number is None and run.quality is None and run.complete
    twin = campaign.twin
    assert campaign.history[0].tests == (None,) and campaign.history[0].readings == 2 * 56
    (row,) = twin.errors
    # As they were sent, beyond a bound too: so were they learnt from.
    assert same_bits(run.replayed.commands, record.commands)
    free = twin.simulate(twin.as_flown(run.replayed, record))
    assert row.test is None
    assert row.closed_loop == pytest.approx(in_scales(free.states[1:] - record.states[1:]), rel=1e-9)
    states = twin.model.states_of(record.states)
    one_step = twin.predict(states[:-1], record.commands)
    assert row.open_loop == pytest.approx(in_scales(one_step - states[1:]), rel=1e-9)
    assert row.normalised < 0.05


def test_an_attached_flight_is_called_by_its_log_or_by_its_number():
    campaign = begun()
    for seed, log in enumerate(("", "a.csv", "b.csv", "b.csv", "two\nlines")):
        campaign.attach(by_hand(30, seed), log)
    names = ("test 0", "log 1", "a.csv", "b.csv (log 3)", "b.csv (log 4)", "two lines")
    assert called(campaign.experiments) == names
    again = tl.Campaign.from_record(json.loads(to_json(campaign.to_record())), threads=1)
    assert called(again.experiments) == names
    with pytest.raises(tl.InvalidInput, match=r"Campaign\.attach, log: expected a text"):
        campaign.attach(by_hand(30, seed=9), 7)


def test_commands_beyond_a_bound_are_flown_as_they_were_sent():
    record = by_hand(55)
    beyond = replace(record, commands=record.commands * np.where(np.abs(record.commands) > 1.0, 2.0, 1.0))
    assert np.abs(beyond.commands).max() > 2.0
    campaign = made()
    campaign.attach(beyond)
    (run,), twin = campaign.experiments, campaign.twin
    assert same_bits(run.replayed.commands, beyond.commands)
    free = twin.simulate(twin.as_flown(run.replayed, beyond))
    assert same_bits(free.commands, beyond.commands)
    (row,) = twin.errors
    assert row.closed_loop == pytest.approx(in_scales(free.states[1:] - beyond.states[1:]), rel=1e-9)
    assert [state.rmse for state in twin.fit(beyond)] == pytest.approx(
        np.sqrt(np.mean((free.states[1:] - beyond.states[1:]) ** 2, axis=0)), rel=1e-9
    )
    clipped = twin.simulate_commands(twin.as_flown(run.replayed, beyond).initial_state, beyond.commands)
    assert not same_bits(clipped.states, free.states)


def test_attached_flights_and_tests_are_learnt_together_in_the_order_they_came():
    campaign = begun()
    campaign.attach(by_hand(31))
    asked = campaign.ask()
    campaign.tell(asked, PLANT.run(asked))
    campaign.attach(by_hand(12, seed=1))
    assert [row.test for row in campaign.twin.errors] == [0, None, 1, None]
    assert [row.attached for row in campaign.twin.errors] == [None, 1, None, 2]
    printed = str(campaign.twin.errors).splitlines()
    assert [line.split()[0] for line in printed] == ["test", "0", "attached-1", "1", "attached-2"]
    assert len({len(line) for line in printed}) == 1
    assert [run.before is None for run in campaign.experiments] == [True, True, False, False]
    ignorant = campaign.experiments[3].before
    assert ignorant is not None and ignorant < campaign.experiments[3].frozen
    assert campaign.best_test.number in (0, 1, 2)
    # They are no runs of tests: a budget does not count them.
    campaign.run(PLANT, 3)
    assert len(campaign.experiments) == 5


def test_logs_alone_are_enough_to_ask_and_to_name_a_controller():
    campaign = made()
    for seed in range(2):
        campaign.attach(by_hand(60, seed))
    best = campaign.best_test
    assert best.measured is None and "no gains have completed a flight" in best.reason
    assert PLANT.run(best).ended == "completed"
    test = campaign.ask()
    campaign.tell(test, PLANT.run(test))
    assert campaign.experiments[-1].quality is not None
    result = json.loads(to_json(summary(campaign, {"name": "pendulum"}, {})))
    assert result["experiments"][0]["test"] is None and result["first_controller"]["test"] == 0
    assert "steps, attached." in render(result)


def in_noise(test, seed, digits=None):
    """A flight of a test with noisy sensors, saved with some digits."""
    run = tl.systems.Simulated(SIGNALS, pendulum_step, noise=[2e-3, 1e-2], seed=seed).run(test)
    if digits is None:
        return run
    return tl.Trajectory(run.t, np.round(run.states, digits), np.round(run.commands, digits))


@pytest.mark.parametrize("digits", [None, 4])
def test_a_copy_of_a_recorded_flight_is_not_attached_in_whatever_digits(digits):
    campaign = made(duration=2.0)
    first = campaign.test(GAINS)
    campaign.tell(first, in_noise(first, 0))
    campaign.attach(
        in_noise(first, 1), "tue.csv"
    )  # the same controller from the same start, but another flight
    before = plain(campaign)
    for seed, name in ((0, "test 0"), (1, "tue.csv")):
        found = rf"Campaign\.attach: expected a new flight, found a copy of .* already, {name}: .* nothing was changed"
        with pytest.raises(tl.InvalidInput, match=found):
            campaign.attach(in_noise(first, seed, digits), "wed.csv")
    assert plain(campaign) == before
    # The same noise again under a second test, as of a simulator that begins anew, is told as it was.
    campaign.tell(first, in_noise(first, 0))
    campaign.withdraw(campaign.experiments[1], "another machine")
    campaign.attach(in_noise(first, 1, digits))
    assert [run.number for run in campaign.experiments] == [0, 0, None]


def test_an_exact_simulator_may_fly_the_same_twice():
    campaign = begun()
    for _ in range(2):
        campaign.attach(campaign.experiments[0].trajectory)
    assert len(campaign.experiments) == 3


def test_a_useless_record_is_not_attached_and_the_paper_attaches_none(new_campaign):
    campaign = made()
    with pytest.raises(tl.InvalidInput, match="at least 2 steps"):
        campaign.attach(cut(by_hand(9), 1))
    with pytest.raises(tl.InvalidInput, match="found str"):
        campaign.attach("flight.csv")
    assert campaign.experiments == ()
    with pytest.raises(tl.NotAvailable, match="choose preset"):
        new_campaign().attach(by_hand(9))


# Tests that fail


def test_a_failed_test_is_a_run_without_a_quality_that_speaks_against_its_gains():
    campaign = begun()
    test = campaign.test({**GAINS, "angle.kp": 5.0})
    campaign.tell_failed(test, "the motor cut out")
    assert campaign.status(test) == "failed" and len(campaign.experiments) == 1
    (failure,) = campaign.failures
    assert (failure.test.number, failure.reason, failure.recorded) == (
        test.number,
        "the motor cut out",
        False,
    )
    flown = []
    campaign.run(tl.systems.Simulated(SIGNALS, lambda x, u: flown.append(1) or pendulum_step(x, u)), 3)
    assert len(flown) == 20  # one more flight: the failed one counts
    result = summary(campaign, {"name": "pendulum"}, {})
    assert result["failures"][0]["reason"] == "the motor cut out"
    assert f"Test {test.number} failed: the motor cut out." in render(result)


def test_gains_that_failed_are_never_proposed_again_nor_recommended():
    campaign = begun(goal="control", options={"evaluations": 512})
    tuned = campaign.best_test
    assert not same_bits(tuned.genes, campaign.experiments[0].test.genes)
    bad = campaign.ask(last=True)
    assert same_bits(bad.genes, tuned.genes)
    campaign.tell_failed(bad, "it hit the wall")
    ranges = np.array([gain.high - gain.low for gain in campaign.family.gains])

    def far(genes):
        return (np.abs(genes - bad.genes) / ranges).max() > 0.02

    # The twin, which has learnt nothing of it, still prefers them.
    assert far(campaign.best_test.genes)
    for last in (True, False, True):
        test = campaign.ask(last=last)
        assert far(test.genes)
        campaign.tell(test, PLANT.run(test))


@pytest.mark.parametrize("steps", [1, 2, 6])
def test_the_partial_run_of_a_failed_test_is_learnt_from(steps):
    campaign = begun()
    test = campaign.ask()
    campaign.tell_failed(test, "the wind took it", partial=cut(PLANT.run(test), steps, ended="completed"))
    run = campaign.experiments[1]
    assert (run.trajectory.ended, run.trajectory.reason) == ("aborted", "the wind took it")
    assert run.quality is None and not run.complete and not run.kept_envelope
    assert campaign.twin.errors[1].test == test.number
    assert campaign.history[-1].readings == 2 * (21 + steps + 1)
    assert campaign.ask().number > test.number


def test_a_failure_that_cannot_be_told_changes_nothing():
    campaign = begun()
    test = campaign.ask()
    for wrong in (
        {"reason": ""}, {"reason": 3}, {"reason": "x", "partial": "y"}, {"reason": "x", "partial": cut(by_hand(9), 0)},
    ):  # fmt: skip
        with pytest.raises(tl.InvalidInput):
            campaign.tell_failed(test, **wrong)
    stranger = made().test(GAINS)
    with pytest.raises(tl.InvalidInput, match="test of this campaign"):
        campaign.tell_failed(stranger, "x")
    assert campaign.failures == () and len(campaign.experiments) == 1 and campaign.status(test) == "asked"


def test_a_first_controller_that_failed_is_not_flown_again():
    campaign = made()
    campaign.tell_failed(campaign.test(GAINS), "it fell over at once")
    with pytest.raises(tl.NotAvailable, match="first test that has not failed"):
        campaign.run(PLANT, 2)
    other = campaign.test({**GAINS, "angle.kp": 1.0})
    campaign.run(PLANT, 2)
    assert campaign.experiments[0].test.number == other.number


def test_a_first_test_whose_failure_had_another_cause_is_withdrawn_as_the_refusal_says_and_flown():
    campaign = made()
    campaign.tell_failed(campaign.test(GAINS), "the plug was out")
    with pytest.raises(tl.NotAvailable, match=r"campaign\.withdraw\(number, why\)"):
        campaign.run(PLANT, 2)
    campaign.withdraw(0, "the plug was out")
    campaign.run(PLANT, 2)
    assert campaign.experiments[0].test.number == 0


# Tests that are not flown


def test_an_abandoned_test_is_not_flown():
    campaign = begun()
    one, two = campaign.ask(), campaign.ask()
    campaign.abandon(one)
    assert (campaign.status(one), campaign.status(two)) == ("abandoned", "asked")
    campaign.run(PLANT, 2)
    assert campaign.experiments[1].test.number == two.number
    with pytest.raises(tl.InvalidInput, match="there is nothing to abandon"):
        campaign.abandon(two)
    # Flown after all.
    campaign.tell(one, PLANT.run(one))
    assert campaign.status(one) == "flown"


def test_an_untold_test_never_switches_off_exploiting():
    campaign = begun()
    waiting = campaign.ask()
    last = campaign.ask(last=True)
    assert last.excitation is None and last.reason.startswith("The best gains found on the twin")
    # Two tests are two tests: once more the same is no second question.
    again = campaign.ask(last=True)
    assert not again.same_as(replace(last, number=again.number))
    assert campaign.status(waiting) == "asked"


def test_while_the_last_test_waits_another_one_is_planned_as_without_last():
    campaign, plain = begun(), begun()
    for each in (campaign, plain):
        each.run(PLANT, 2)
        last = each.ask(last=True)
        assert last.excitation is None and last.reason.startswith("The best gains found on the twin")
    again = campaign.ask(last=True)
    assert same_bits(again.genes, plain.ask().genes) and again.excitation is not None
    campaign.abandon(last := campaign.tests[last.number])
    anew = campaign.ask(last=True)
    assert anew.same_as(replace(last, number=anew.number))


# Runs that were cut


def test_a_run_that_was_cut_has_not_kept_the_envelope_and_is_not_known_to_fly():
    campaign = made(options={"candidates": 64})
    first = campaign.test(GAINS)
    campaign.tell(first, cut(PLANT.run(first), 12))
    run = campaign.experiments[0]
    assert campaign.status(first) == "aborted" and not run.left_envelope and not run.kept_envelope
    for _ in range(2):
        test = campaign.ask()
        assert "known to fly" not in test.reason and not same_bits(test.genes, first.genes)
    assert not same_bits(campaign.best_test.genes, first.genes)


def test_where_all_planned_flights_were_cut_the_twin_is_not_taken_at_its_word_once_more():
    campaign = made(options={"candidates": 64})
    first = campaign.test(GAINS)
    campaign.tell(first, cut(PLANT.run(first), 12, "diverged", "tumbled"))
    assert "no gains have completed a flight yet" in campaign.best_test.reason
    test = campaign.ask()
    campaign.tell(test, cut(PLANT.run(test), 12, "diverged", "tumbled"))
    with pytest.raises(tl.NotAvailable, match=r"No controller to fly: .* each of them was cut"):
        _ = campaign.best_test
    # One that comes to its end is worth more than any promise.
    again = campaign.ask()
    campaign.tell(again, PLANT.run(again))
    assert campaign.best_test.genes.size == first.genes.size


def test_where_all_flights_diverged_there_is_no_controller_to_fly():
    """Commands logged with the wrong sign, and every flight runs away: nothing is known, and it is said."""
    campaign = made()
    for kp in (1.0, 2.0, 3.0):
        test = campaign.test({**GAINS, "angle.kp": kp})
        run = cut(PLANT.run(test), 9, "diverged", "the angle ran away")
        stream = np.random.default_rng(int(kp))
        campaign.tell(test, tl.Trajectory(
            run.t, run.states, 0.5 * stream.normal(size=run.commands.shape), ended="diverged", reason=run.reason,
        ))  # fmt: skip
    with pytest.raises(tl.NotAvailable, match="No controller to fly: "):
        _ = campaign.best_test
    with pytest.raises(tl.NotAvailable):
        _ = campaign.controller
    result = summary(campaign, {"name": "pendulum"}, {})
    assert result["controller"] is None and result["no_controller"]
    report = render(result)
    assert "NO CONTROLLER TO FLY" in report and "CONTROLLER TO FLY: TEST" not in report
    assert "known to fly" not in campaign.ask().reason


def test_attached_failed_and_abandoned_flights_are_in_the_store(tmp_path):
    pytest.importorskip("sqlalchemy")
    campaign = made(store=tmp_path / "campaign.db")
    first = campaign.test(GAINS)
    campaign.tell(first, PLANT.run(first))
    campaign.attach(by_hand(25))
    failed, left = campaign.ask(), campaign.ask()
    campaign.tell_failed(failed, "the motor cut out", partial=cut(PLANT.run(failed), 5))
    campaign.abandon(left)
    asked = campaign.ask(last=True)
    campaign.close()
    again = tl.Campaign.load(tmp_path / "campaign.db", threads=1)
    assert [again.status(test) for test in (first, failed, left, asked)] == [
        "flown", "failed", "abandoned", "asked"
    ]  # fmt: skip
    assert [run.number for run in again.experiments] == [0, None, failed.number]
    assert again.failures[0].reason == "the motor cut out" and again.failures[0].recorded
    assert same_bits(again.best_test.genes, campaign.best_test.genes)
    again.close()


# Regulation


def test_to_stay_where_one_is_is_a_task(new_campaign):
    stream = np.random.default_rng(0)

    def pushed(x, u):
        angle, rate = pendulum_step(x, u)
        return angle, rate + 0.2 * stream.normal()

    plant = tl.systems.Simulated(SIGNALS, pushed, default_gains=PENDULUM_GAINS)
    campaign = made(target_state=[0.0, 0.0], duration=2.0).run(plant, 3)
    assert all(run.quality > 0.0 for run in campaign.experiments)
    assert campaign.best_test.reason and campaign.twin.errors
    assert render(summary(campaign, {"name": "pendulum"}, {}))
    with pytest.raises(tl.InvalidInput, match="choose preset"):
        new_campaign(target_state=[0.0, 0.0])


def test_a_campaign_with_attached_failed_and_abandoned_flights_is_rebuilt_from_its_record():
    def rebuilt(campaign, step):
        return tl.Campaign.from_record(json.loads(json.dumps(campaign.to_record())), threads=1)

    plain, moved = lived(begin("default"), FULL_LIFE), lived(begin("default"), FULL_LIFE, rebuilt)
    assert outcome(moved) == outcome(plain)
    assert [failure.reason for failure in moved.failures] == ["the motor cut out"]
    asked = [campaign.ask(last=True) for campaign in (plain, moved)]
    assert same_bits(asked[0].genes, asked[1].genes)


def test_telling_a_flight_compares_no_columns_whose_notes_nobody_would_see(monkeypatch):
    compared = []
    monkeypatch.setattr(log_check, "_of_columns", lambda *columns: compared.append(columns) or ())
    campaign, record = made(), by_hand(55)
    campaign.attach(record)
    assert not compared
    log_check.check_log(record.t, record.states, record.commands, SIGNALS)
    assert len(compared) == 1
