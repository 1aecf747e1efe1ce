"""The commands for people: a campaign file, test sheets, logs, failures; from an empty folder with a CSV."""

import csv
import json
import shlex
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import lives
import twinloop as tl
from conftest import TINY, pendulum_step
from lives import SIGNALS, SMALL
from sameness import same
from twinloop.campaign.campaign_file import _toml, read_file, read_signals, template
from twinloop.campaign.examination import checking
from twinloop.faces.about_test import foretold
from twinloop.faces.cli import main
from twinloop.faces.sheet import Sheet
from twinloop.faces.telling import numbered
from twinloop.logs import write_columns
from twinloop.planning.leaving import risk_words
from twinloop.store import StoredAs

PENDULUM = template("rig.db").partition("[options]")[0]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder with the campaign file of a pendulum that is learnt in no time."""
    monkeypatch.chdir(tmp_path)
    options = "\n".join(f"{name} = {_toml(value)}" for name, value in SMALL.items())
    (tmp_path / "rig.toml").write_text(f"{PENDULUM}[options]\n{options}\n", encoding="utf-8")
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(main, list(arguments))


def flown(test, file="flight.csv"):
    """The log of a test, as a person would record it."""
    run = tl.systems.Simulated(SIGNALS, pendulum_step).run(test)
    columns = {"t": run.t, "torque": run.commands[:, 0], "rate": run.states[:, 1], "angle": run.states[:, 0]}
    write_columns(Path(file), columns)
    return run


def look():
    return tl.Campaign.load("rig.db", read_only=True)


# The loop


def test_a_campaign_is_flown_by_hand_as_from_python(folder):
    for number in range(3):
        asked = json.loads(run("ask", "rig.db", "--json").stdout)
        assert asked["test"] == number
        flown(look().tests[number])
        told = run("tell", "rig.db", str(number), "flight.csv")
        assert told.exit_code == 0 and f"test {number} flown" in told.stdout, told.output
    by_hand = look()
    plant = tl.systems.Simulated(SIGNALS, pendulum_step)
    other = read_file("rig.toml").campaign(threads=1)
    tests = [other.test(read_file("rig.toml").first)]
    for number in range(3):
        other.tell(tests[-1], plant.run(tests[-1]))
        tests.append(other.ask()) if number < 2 else None
    assert same(*([run.trajectory.states for run in c.experiments] for c in (by_hand, other)))
    assert same([t.genes for t in by_hand.tests], [t.genes for t in other.tests])


def test_show_lists_the_tests_whose_flight_is_awaited(folder):
    def waiting():
        listed = json.loads(run("show", "rig.db", "--json").stdout)["store"]["waiting"]
        numbers = ", ".join(map(str, listed))
        said = f"Test{'s' * (len(listed) > 1)} waiting to be flown: {numbers}.\n" if listed else "waiting"
        assert (said in run("show", "rig.db").stdout) == bool(listed)
        return listed

    run("ask", "rig.db")
    assert waiting() == [0]
    flown(look().tests[0])
    run("tell", "rig.db", "0", "flight.csv")
    assert waiting() == []
    # Somebody's own test, to look at.
    with closing(tl.Campaign.load("rig.db")) as campaign:
        own = campaign.test({name: 1.1 * value for name, value in campaign.tests[0].parameters.items()})
        assert own.number == 1
    assert waiting() == []
    run("ask", "rig.db")
    assert waiting() == [2]
    run("abandon", "rig.db", "2")
    assert waiting() == []
    run("withdraw", "rig.db", "0", "--reason", "another rig")
    assert 0 in waiting()
    run("abandon", "rig.db", "0")
    assert 0 not in waiting()


def test_the_sheet_says_what_to_set_and_the_file_what_to_add_and_expect(folder):
    first = run("ask", "rig.db").stdout
    assert "angle.kp" in first and "N m/rad" in first and "twinloop tell rig.db 0 FLIGHT.csv" in first
    assert "The controller that you already trust, with an excitation" in first
    assert "nothing is known of the system before it" in first
    said = json.loads(run("ask", "rig.db", "--json").stdout)
    assert said["risk"] is None and f"Risk of leaving the envelope: {said['risk_unknown']}\n" in first
    # What can be said of it: how much is added, by the file's own numbers, and what holds it back.
    with open("rig-test-0.csv", encoding="utf-8") as file:
        most = max(abs(float(row["excitation_torque"] or 0.0)) for row in csv.DictReader(file))
    (torque,) = SIGNALS.commands
    share = f"{100 * most / (torque.bounds[1] - torque.bounds[0]):.2g} %"
    assert (
        f"at most {share} of a command's range; it fades out as angle or rate approaches"
        in said["risk_unknown"]
    )
    flown(look().tests[0])
    run("tell", "rig.db", "0", "flight.csv")
    sheet = run("ask", "rig.db").stdout
    assert "Predicted quality, integrated absolute error (rad s): " in sheet
    # Of four members under two draws each, or of fewer members.
    test = look().tests[1]
    assert f"Risk of leaving the envelope: {risk_words(test.risk, 8)}.\n" in sheet
    test = look().tests[1]
    with open("rig-test-1.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == test.steps + 1
    assert [float(row["excitation_torque"]) for row in rows[:-1]] == test.excitation[:, 0].tolist()
    assert all(float(row["low_angle"]) <= float(row["high_angle"]) for row in rows)
    # What was asked for is shown again, and not planned anew.
    assert run("ask", "rig.db").stdout == sheet and len(look().tests) == 2
    assert json.loads(run("ask", "rig.db", "--again", "--json").stdout)["test"] == 2


def test_the_last_test_is_shown_again_while_it_waits(folder):
    run("ask", "rig.db")
    flown(look().tests[0])
    run("tell", "rig.db", "0", "flight.csv")
    explores = run("ask", "rig.db").stdout
    last = run("ask", "rig.db", "--last").stdout
    assert "TEST 2 of" in last and "Excitation of the commands: none." in last
    assert run("ask", "rig.db", "--last").stdout == last and len(look().tests) == 3
    # Each kind of question has its own answer, and that no one else has given up.
    assert run("ask", "rig.db").stdout == explores
    assert look().waiting_last.number == 2
    assert "TEST 3 of" in run("ask", "rig.db", "--again", "--last").stdout
    assert run("abandon", "rig.db", "2").exit_code == 0 and look().waiting_last is None
    again = run("ask", "rig.db", "--last").stdout
    assert "TEST 4 of" in again and "Excitation of the commands: none." in again
    flown(look().tests[4])
    run("tell", "rig.db", "4", "flight.csv")
    assert look().waiting_last is None and "TEST 5 of" in run("ask", "rig.db", "--last").stdout


@pytest.mark.parametrize("how", ['[campaign]\npreset = "paper"\n', "exploit_last = false\n"])
def test_where_no_test_is_the_last_the_one_that_waits_is_shown_again(folder, how):
    text = Path("rig.toml").read_text(encoding="utf-8")
    if "paper" in how:
        options = "".join(f"{name} = {_toml(value)}\n" for name, value in TINY.items())
        text = f"{PENDULUM.partition('[campaign]')[0]}{how}[options]\n{options}"
    else:
        text += how
    Path("rig.toml").write_text(text, encoding="utf-8")
    run("ask", "rig.db")
    flown(look().tests[0])
    run("tell", "rig.db", "0", "flight.csv")
    asked = run("ask", "rig.db")
    assert asked.exit_code == 0, asked.output
    assert run("ask", "rig.db", "--last").stdout == asked.stdout
    assert "TEST 2 of" in run("ask", "rig.db", "--again", "--last").stdout


@pytest.mark.parametrize(
    ("preset", "options"),
    [("paper", TINY), ("default", {**SMALL, "tests": "random"})],
    ids=["paper", "random"],
)
def test_gains_that_no_committee_judged_are_not_called_those_of_a_trusted_controller(folder, preset, options):
    campaign = lives.stored("arm.db", preset, options=options)
    lives.flown(campaign, lives.PLANT)
    campaign.ask()
    own = campaign.test(lives.OTHER_GAINS)
    campaign.close()
    text, said = run("ask", "arm.db").stdout, json.loads(run("ask", "arm.db", "--json").stdout)
    assert said["test"] == 1 and said["risk"] is None
    assert f"Risk of leaving the envelope: {said['risk_unknown']}\n" in text
    assert "no committee has judged this test" in said["risk_unknown"]
    assert said["why"] in text and ("not vouched" in said["why"] or "without a committee" in said["why"])
    assert "first flight" not in text and "already trust" not in text
    assert "already trust" in Sheet(StoredAs("arm.db"), own, "rig-test-2.csv", campaign.setup).text
    assert [test.number for test in tl.Campaign.load("arm.db", read_only=True).asked] == [1]


def test_a_target_that_varies_with_time_has_its_ends_on_the_sheet_and_its_rows_in_the_file(folder):
    campaign = lives.stored("arm.db", "default", target_state=lambda t: [0.5 + 0.5 * t, 0.0])
    lives.flown(campaign, lives.PLANT)
    campaign.close()
    asked = run("ask", "arm.db")
    assert asked.exit_code == 0, asked.output
    words = [line.split() for line in asked.stdout.splitlines()]
    assert ["angle", "0", "0.5", "1", "rad"] in words and ["rate", "0", "0", "0", "rad/s"] in words
    assert "arm-test-1.csv has a row of it a period (target_angle)" in asked.stdout
    test = tl.Campaign.load("arm.db", read_only=True).tests[1]
    with open("arm-test-1.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    expected = [0.5 + 0.5 * SIGNALS.dt * k for k in range(test.steps + 1)]
    assert [float(row["target_angle"]) for row in rows] == pytest.approx(expected, abs=1e-12)
    assert "target_rate" not in rows[0]
    said = json.loads(run("ask", "arm.db", "--json").stdout)["target_state"]
    assert said["angle"] == pytest.approx(expected) and said["rate"] == 0.0


def test_commands_that_are_advised_quote_names_with_blanks(folder):
    begun = run("new", "my rig.toml")
    assert "twinloop ask 'my rig.db'" in begun.stdout
    written = Path("my rig.toml").read_text(encoding="utf-8")
    assert "twinloop ask 'my rig.db'\n" in written and "twinloop run 'my rig.toml';" in written
    Path("rig.toml").replace("my rig.toml")
    assert "twinloop tell 'my rig.db' 0 FLIGHT.csv" in run("ask", "my rig.db").stdout
    flown(tl.Campaign.load("my rig.db", read_only=True).tests[0])
    assert run("tell", "my rig.db", "0", "flight.csv").exit_code == 0
    assert "twinloop withdraw 'my rig.db' 0" in run("tell", "my rig.db", "0", "--failed", "motor").stderr
    assert "twinloop learn 'my rig.db'." in run("show", "my rig.db").stdout
    assert "twinloop show 'my rig.db'\n" in run("learn", "my rig.db").stdout
    taken = run("withdraw", "my rig.db", "0", "--reason", "degrees")
    assert "twinloop tell 'my rig.db' 0 FLIGHT.csv" in taken.stdout


def test_rows_after_the_twin_has_diverged_say_so():
    campaign = lives.new("default")
    test = campaign.test(lives.PENDULUM_GAINS)
    predicted = lives.cut(lives.PLANT.run(test), 7, ended="diverged")
    shown = Sheet(StoredAs("rig.db"), test, "rig-test-0.csv", campaign.setup, predicted).text
    rows = [line.split() for line in shown.splitlines()]
    rows = {round(float(row[0]) / SIGNALS.dt): row[1:] for row in rows if row and row[0][0].isdigit()}
    assert set(rows) >= {0, 6, 8, 20}
    for step, row in rows.items():
        assert (row[-2:] == ["diverged", "diverged"]) == (step > 7), row


def test_a_flight_without_its_excitation_is_noticed_at_once(folder):
    run("ask", "rig.db")
    flown(look().tests[0].quiet())
    told = run("tell", "rig.db", "0", "flight.csv", "--json")
    (remark,) = json.loads(told.stdout)["remarks"]
    assert remark.startswith(
        "The excitation of test 0 was not added to the commands: this flight tells less."
    )
    assert f"Against this flight: {remark}" in told.stderr


@pytest.mark.parametrize(("share", "said"), [(1.0, True), (0.4, False)])
@pytest.mark.parametrize("typed", [("tell", "rig.db", "0"), ("attach", "rig.db")], ids=["tell", "attach"])
def test_a_flight_that_was_outside_the_envelope_most_of_the_time_is_noticed_at_once(
    folder, typed, share, said
):
    """An offset of a turn and a half, as in K for degC; a flight that was outside for less than half of it may be."""
    run("ask", "rig.db")
    good = flown(look().tests[0])
    off = 9.0 * (np.arange(len(good.t)) < share * len(good.t))
    log = {"t": good.t, "angle": good.states[:, 0] + off, "rate": good.states[:, 1]}
    write_columns(folder / "flight.csv", {**log, "torque": good.commands[:, 0]})
    told = run(*typed, "flight.csv")
    assert told.exit_code == 0, told.stderr
    sentence = "Against this flight: angle was outside its envelope in 100 % of the rows"
    assert (sentence in told.stderr) == ("outside its envelope" in told.stderr) == said


def test_the_last_flight_is_learnt_when_that_is_asked_for_and_until_then_it_is_said(folder, monkeypatch):
    run("ask", "rig.db")
    early = run("learn", "rig.db")
    assert early.exit_code == 2 and "at least one recorded experiment" in early.stderr
    flown(look().tests[0])
    run("tell", "rig.db", "0", "flight.csv")
    shown = run("show", "rig.db")
    assert "Not learnt yet: 1 experiment; to learn now: twinloop learn rig.db." in shown.stdout
    assert json.loads(run("show", "rig.db", "--json").stdout)["store"]["learnt"] == 0
    assert "Learnt from 1 experiment" in run("learn", "rig.db").stdout
    shown = run("show", "rig.db")
    assert "Not learnt" not in shown.stdout and "learnt from 1 experiment" in shown.stdout
    flown(look().tests[0])
    assert len(look().tests) == 1  # nothing was asked for
    # Gains that no test was made of are called by no number.
    assert "Controller: do not fly it; tuned gains, not asked for yet, " in shown.stdout
    assert "To fly the tuned gains" not in shown.stdout
    # Eight predicted flights cannot show a risk below 6 %: where that is no reason against them, they may be flown.
    monkeypatch.setattr(checking, "RISK", 0.1)
    shown = run("show", "rig.db")
    assert "Controller: not on this twin's prediction; tuned gains, not asked for yet, " in shown.stdout
    assert shown.stdout.endswith("To fly the tuned gains: twinloop ask rig.db --last\n")
    assert json.loads(run("show", "rig.db", "--json").stdout)["result"]["controller"]["test"] is None
    # What was learnt so is what the next question learns.
    other = read_file("rig.toml").campaign(threads=1)
    test = other.test(read_file("rig.toml").first)
    other.tell(test, look().experiments[0].trajectory)
    run("ask", "rig.db")
    assert same([look().tests[1].genes], [other.ask().genes])


def test_a_batch_is_flown_in_any_order_and_what_is_abandoned_counts_nothing(folder):
    assert "fly the first test" in run("ask", "rig.db", "--batch", "3").stderr
    run("ask", "rig.db")
    flown(look().tests[0])
    run("tell", "rig.db", "0", "flight.csv")
    asked = json.loads(run("ask", "rig.db", "--batch", "3", "--json").stdout)["tests"]
    assert sorted(test["test"] for test in asked) == [1, 2, 3]
    plans = {plan.test: plan for plan in look().history[-1].asked}
    order = [(not plans[test["test"]].safe, -plans[test["test"]].bits) for test in asked]
    assert order == sorted(order)
    assert len({(*test["gains"].values(), Path(test["file"]).read_text()) for test in asked}) == 3
    for test in asked:
        assert Path(test["file"]).is_file()
    # Asked again, nothing is new; a sheet for each.
    text = run("ask", "rig.db", "--batch", "3").stdout
    assert [line for line in text.splitlines() if line.startswith("TEST ")] == [
        f"TEST {test['test']} of rig.db: 20 periods of 0.05 s" for test in asked
    ]
    assert len(look().tests) == 4
    best, abandoned = asked[-1]["test"], asked[0]["test"]
    run("abandon", "rig.db", str(abandoned))
    flown(look().tests[best])
    assert run("tell", "rig.db", str(best), "flight.csv").exit_code == 0
    campaign = look()
    assert [test.number for test in campaign.waiting] == [asked[1]["test"]]
    assert len(campaign.experiments) == 2 and [r.number for r in campaign.experiments] == [0, best]
    assert run("ask", "rig.db", "--batch", "2", "--last").exit_code == 2


def test_a_sheet_says_that_another_test_waits_with_its_gains(folder):
    run("ask", "rig.db")
    campaign = look()
    test = campaign.tests[0]
    near = replace(test, number=7, genes=test.genes * (1.0 + 1e-12))
    other = replace(test, number=8, genes=test.genes * 1.001)
    led, quiet = test.target_state + 0.1, {"excitation": None, "hold_back": None}
    elsewhere = replace(test, number=9, target_state=led, **quiet)
    waiting = (test, near, other, elsewhere)
    said = Sheet(StoredAs("rig.db"), test, "rig-test-0.csv", campaign.setup, waiting=waiting).text
    assert "Test 7, which waits too, has these gains with the same start, target and excitation." in said
    assert "Test 9, which waits too, has these gains with another target and another excitation." in said
    assert said.count("waits too") == 2


def test_what_is_learnt_from_a_batch_is_the_same_with_and_without_the_abandoned(folder):
    plant = tl.systems.Simulated(SIGNALS, pendulum_step)
    equations = []
    for size in (1, 3):
        campaign = read_file("rig.toml").campaign(threads=1)
        first = campaign.test(read_file("rig.toml").first)
        campaign.tell(first, plant.run(first))
        tests = sorted(campaign.ask_batch(size), key=lambda test: test.number)
        for test in tests[1:]:
            campaign.abandon(test)
        campaign.tell(tests[0], plant.run(tests[0]))
        equations.append(campaign.twin.equations(17))
    assert equations[0] == equations[1]


def test_after_old_logs_the_first_test_is_still_the_controller_that_is_trusted(folder):
    trusted = read_file("rig.toml").first
    other = read_file("rig.toml").campaign(threads=1)
    flown(other.test({"angle.kp": 1.0, "angle.ki": 0.5, "angle.kd": 0.2}), "old.csv")
    assert run("attach", "rig.db", "old.csv").stdout == "Saved: old.csv; 1 experiment in rig.db.\n"
    again = run("attach", "rig.db", "old.csv")
    assert again.exit_code == 2 and "recorded already" in again.stderr and len(look().experiments) == 1
    asked = json.loads(run("ask", "rig.db", "--json").stdout)
    assert asked["gains"] == dict(trusted) and asked["excited"]
    # With the twin of the old log, the sheet says what to expect of it all the same.
    assert "angle, rad" in run("ask", "rig.db").stdout


def flown_in_noise(test, file, seed, digits=None, steps=None):
    """The log of a test with noisy sensors, saved with some digits, and cut after some steps."""
    run = tl.systems.Simulated(SIGNALS, pendulum_step, noise=[2e-3, 1e-2], seed=seed).run(test)
    columns = {"t": run.t, "torque": run.commands[:, 0], "rate": run.states[:, 1], "angle": run.states[:, 0]}
    if digits is not None:
        columns = {name: np.round(values, digits) for name, values in columns.items()}
    if steps is not None:
        rows = {name: steps + (name != "torque") for name in columns}
        columns = {name: values[: rows[name]] for name, values in columns.items()}
    write_columns(Path(file), columns)


def test_a_copy_with_fewer_digits_is_no_flight_that_the_twin_has_not_seen(folder):
    longer = (folder / "rig.toml").read_text().replace("duration = 1.0", "duration = 2.0")
    (folder / "rig.toml").write_text(longer)
    run("ask", "rig.db")
    test = look().tests[0]
    flown_in_noise(test, "flight.csv", 0)
    flown_in_noise(test, "copy.csv", 0, digits=4)
    flown_in_noise(test, "other.csv", 1, digits=4)
    flown_in_noise(test, "part.csv", 0, digits=4, steps=35)
    assert run("tell", "rig.db", "0", "flight.csv").exit_code == 0
    for again in (run("attach", "rig.db", "copy.csv"), run("tell", "rig.db", "0", "copy.csv")):
        assert again.exit_code == 2 and len(look().experiments) == 1
        assert "copy.csv: expected a new flight, found a copy of one that is recorded already" in again.stderr
    # The same controller from the same start, but another flight.
    other = run("attach", "rig.db", "other.csv")
    assert other.exit_code == 0 and "count twice" not in other.output
    part = run("attach", "rig.db", "part.csv")
    assert part.exit_code == 0, part.output
    assert "the same first 35 steps but for digits far below the noise" in " ".join(part.output.split())


def test_a_copy_that_is_told_as_another_test_is_said_at_once(folder):
    run("ask", "rig.db")
    flown_in_noise(look().tests[0], "flight.csv", 0)
    flown_in_noise(look().tests[0], "copy.csv", 0, digits=4)
    run("tell", "rig.db", "0", "flight.csv")
    run("ask", "rig.db")
    told = " ".join(run("tell", "rig.db", "1", "copy.csv").output.split())
    assert "but for digits far below the noise, which no two flights share, so that they count twice" in told


def test_a_log_that_was_told_is_not_told_twice_and_what_was_expected_stands_beside_what_was_flown(folder):
    for number in range(2):
        sheet = run("ask", "rig.db").stdout
        flown(look().tests[number])
        told = run("tell", "rig.db", str(number), "flight.csv").stdout
        again = run("tell", "rig.db", str(number), "flight.csv")
        assert (
            again.exit_code == 2
            and "recorded already" in again.stderr
            and len(look().experiments) == number + 1
        )
    assert "add to torque, N m" in sheet and "rate, rad/s" in sheet
    test, flight = look().tests[1], look().experiments[1]
    assert f"quality {flight.quality:.4g}, predicted {test.predicted:.4g} ± {test.spread:.3g} rad s;" in told
    last = next(line for line in sheet.splitlines() if line.startswith("1 "))
    predicted = look().twin.simulate(test)  # of now; the sheet's was of before, near it
    assert float(last.split()[1].strip("(")) == pytest.approx(predicted.states[-1, 0], abs=0.2)


def test_a_gain_that_is_fixed_stands_on_the_sheet_with_its_unit(folder):
    text = (folder / "rig.toml").read_text(encoding="utf-8")
    fixed = text.replace('"angle.ki" = [0.0, 6.0]', '"angle.ki" = 0.0').replace('"angle.ki" = 2.0\n', "")
    (folder / "rig.toml").write_text(fixed, encoding="utf-8")
    asked = run("ask", "rig.db")
    assert asked.exit_code == 0 and "N m/(rad s)" in asked.stdout and fixed != text
    assert json.loads(run("ask", "rig.db", "--json").stdout)["gains"]["angle.ki"] == 0.0


def test_rows_that_are_missing_within_a_flight_are_no_flight_that_was_stopped(folder):
    run("ask", "rig.db")
    flown(look().tests[0])
    lines = Path("flight.csv").read_text(encoding="utf-8").splitlines()
    Path("flight.csv").write_text("\n".join(lines[:8] + lines[10:]), encoding="utf-8")
    refused = run("tell", "rig.db", "0", "flight.csv")
    assert refused.exit_code == 2 and "found 0.15 s after line 8" in refused.stderr
    assert "--aborted" not in refused.stderr


def test_an_attached_flight_that_wraps_is_said_to_at_its_line(folder):
    t = SIGNALS.dt * np.arange(121)
    angle, rate = 3.0 + 0.5 * np.sin(3.0 * t), 1.5 * np.cos(3.0 * t)
    row = int(np.argmax(angle > np.pi))
    columns = {"t": t, "angle": np.angle(np.exp(1j * angle)), "rate": rate, "torque": np.sin(t[:-1])}
    write_columns(Path("wraps.csv"), columns)
    said = run("attach", "rig.db", "wraps.csv")
    assert said.exit_code == 0
    assert f"Against this flight: angle jumps by a whole turn at line {row + 2}, {t[row]:g} s" in said.stderr
    withdraw = "withdraw rig.db wraps.csv --reason WHY"
    assert f"twinloop {withdraw}" in said.stderr and run(*withdraw.split()).exit_code == 0


def test_what_speaks_against_a_flight_is_said_when_it_is_told(folder):
    run("ask", "rig.db")
    flight = flown(look().tests[0])
    lines = Path("flight.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    turned = [",".join([t, str(-float(u)) if u else u, *rest]) for t, u, *rest in rows]
    Path("turned.csv").write_text("\n".join([lines[0], *turned]), encoding="utf-8")
    told = run("tell", "rig.db", "0", "turned.csv")
    assert told.exit_code == 0 and told.stdout.startswith("Saved: test 0 flown")
    assert (
        "Against this flight: The commands recorded of test 0 are none that its controller gives"
        in told.stderr
    )
    withdraw = "withdraw rig.db 0 --reason WHY"
    assert f"take it back, and tell the right one: twinloop {withdraw}" in told.stderr
    assert flight.steps == look().experiments[0].trajectory.steps
    again = run("tell", "rig.db", "0", "flight.csv", "--json")
    assert json.loads(again.stdout)["remarks"] == [] and again.stderr == ""


def test_failures_aborted_flights_strangers_and_abandoned_tests_are_kept(folder):
    run("ask", "rig.db")
    test = look().tests[0]
    flown(test)
    assert run("attach", "rig.db", "flight.csv").exit_code == 0
    lines = (folder / "flight.csv").read_text(encoding="utf-8").splitlines()
    (folder / "short.csv").write_text("\n".join(lines[:12]), encoding="utf-8")
    refused = run("tell", "rig.db", "0", "short.csv")
    assert refused.exit_code == 2
    written = "twinloop tell rig.db 0 --aborted short.csv --reason"
    assert written in refused.stderr
    # The log stands behind the option, wherever one begins.
    other = run("tell", "rig.db", "0", "short.csv", "--aborted", "a gust")
    assert other.exit_code == 2 and f"{written} 'a gust'." in other.stderr
    told = shlex.split(f"{written} 'a gust'")[1:]
    assert "aborted" in run(*told).stdout
    run_ = look().experiments[-1].trajectory
    assert (run_.ended, run_.reason) == ("aborted", "a gust")
    run("ask", "rig.db")
    assert "failed" in run("tell", "rig.db", "1", "--failed", "motor cut out").stdout
    twice = run("tell", "rig.db", "1", "--failed", "motor cut out")
    assert twice.exit_code == 2 and "'motor cut out' recorded already" in twice.stderr
    assert look().failures[0].reason == "motor cut out"
    run("ask", "rig.db")
    assert run("abandon", "rig.db", "2").exit_code == 0
    campaign = look()
    assert [campaign.status(t) for t in campaign.tests] == ["aborted", "failed", "abandoned"]
    shown = run("show", "rig.db")
    assert "Test failed: 1.\nTest abandoned: 2.\n" in shown.stdout
    assert (
        "learnt from" in shown.stdout and "interrupted" not in shown.stdout and "finished" not in shown.stdout
    )


def test_a_test_that_failed_once_and_was_flown_since_does_not_fail_any_more(folder):
    run("ask", "rig.db")
    assert run("tell", "rig.db", "0", "--failed", "motor cut out").exit_code == 0
    flown(look().tests[0])
    assert run("tell", "rig.db", "0", "flight.csv").exit_code == 0
    refused = run("tell", "rig.db", "0", "--failed", "cable")
    assert refused.exit_code == 2 and "without a recorded flight, found one that was flown" in refused.stderr
    assert [failure.reason for failure in look().failures] == ["motor cut out"]


def test_a_flight_may_be_told_as_aborted_without_a_reason(folder):
    run("ask", "rig.db")
    flown(look().tests[0])
    lines = Path("flight.csv").read_text(encoding="utf-8").splitlines()
    Path("short.csv").write_text("\n".join(lines[:12]), encoding="utf-8")
    told = run("tell", "rig.db", "0", "--aborted", "short.csv")
    assert told.exit_code == 0 and told.stdout.startswith("Saved: test 0 aborted")
    flight = look().experiments[0].trajectory
    assert (flight.ended, flight.reason, flight.steps) == ("aborted", "stopped early", 10)


def test_a_range_of_numbers_is_named_only_where_there_are_several_tests():
    campaign = lives.new("default")
    with pytest.raises(tl.InvalidInput, match="expected one that was made, found 0; ask for one first"):
        numbered(campaign, 0)
    campaign.test(lives.PENDULUM_GAINS)
    with pytest.raises(tl.InvalidInput, match="expected 0, the only test so far, found 1; ask for one first"):
        numbered(campaign, 1)
    campaign.test(lives.OTHER_GAINS)
    with pytest.raises(tl.InvalidInput, match="expected a number from 0 to 1, found 2; ask for one first"):
        numbered(campaign, 2)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("tell", "rig.db", "0"), "--failed REASON"),
        (("tell", "rig.db", "0", "--failed", "a", "--aborted", "x.csv"), "found both"),
        (("tell", "rig.db", "0", "--aborted", "x.csv"), "check its name"),
        (("tell", "rig.db", "0", "--aborted", "x.csv", "--reason", "a gust"), "check its name"),
        (("tell", "rig.db", "0", "--aborted", "x.csv", "--reason", " "), "a few words"),
        (("tell", "rig.db", "0", "x.csv", "--reason", "a gust"), "beside --aborted FLIGHT"),
        (("tell", "rig.db", "0", "--failed", "a", "--reason", "b"), "--failed REASON"),
        (("tell", "rig.db", "7", "--failed", "a"), "ask for one first"),
        (("tell", "rig.db", "0", "x.csv"), "check its name"),
        (("ask", "other.db"), "twinloop new other.toml"),
        (("ask", "rig"), "expected rig.db, which has the campaign of rig.toml"),
        (("attach", "rig.sqlite", "x.csv"), "expected rig.db, which has the campaign of rig.toml"),
        (("ask", "rig.toml"), "name its store, by default rig.db"),
        (("show", "rig.toml"), "name its store, by default rig.db"),
        (("new", "rig.toml"), "found one"),
        (("new", "rig.txt"), "end in .toml"),
    ],
)
def test_misuse_is_one_sentence_with_what_to_do(folder, arguments, word):
    run("ask", "rig.db")
    refused = run(*arguments)
    assert refused.exit_code == 2 and word in refused.stderr and refused.stderr.count("\n") == 1
    assert not Path("rig").exists() and not Path("rig.sqlite").exists()


def test_a_changed_campaign_file_is_refused(folder):
    run("ask", "rig.db")
    file = folder / "rig.toml"
    file.write_text(file.read_text(encoding="utf-8").replace("seed = 0", "seed = 1"), encoding="utf-8")
    refused = run("ask", "rig.db")
    assert refused.exit_code == 2 and "seed: 0 in the store, 1 now" in refused.stderr


@pytest.mark.parametrize("value", ["3.0", "40.0"])  # within its bounds, and outside of them
def test_changed_gains_of_the_first_test_are_refused(folder, value):
    run("ask", "rig.db")
    file = folder / "rig.toml"
    before = file.read_text(encoding="utf-8")
    file.write_text(before.replace('"angle.kp" = 2.0', f'"angle.kp" = {value}'), encoding="utf-8")
    refused = run("ask", "rig.db")
    assert refused.exit_code == 2 and f"first: angle.kp: 2.0 in the store, {value} now" in refused.stderr
    file.write_text(before, encoding="utf-8")
    assert run("ask", "rig.db").exit_code == 0


def test_a_first_test_that_failed_or_was_abandoned_gives_way_to_other_gains(folder):
    run("ask", "rig.db")
    assert run("abandon", "rig.db", "0").exit_code == 0
    assert "TEST 1" in run("ask", "rig.db").stdout, "not the one that is not to be flown"
    assert run("tell", "rig.db", "1", "--failed", "gearbox broken").exit_code == 0
    refused = run("ask", "rig.db")
    assert refused.exit_code == 2 and "found those of test 1 (gearbox broken)" in refused.stderr
    file = folder / "rig.toml"
    before = file.read_text(encoding="utf-8")
    file.write_text(before.replace('"angle.kp" = 2.0', '"angle.kp" = 1.5'), encoding="utf-8")
    said, known = run("ask", "rig.db").stdout, json.loads(run("ask", "rig.db", "--json").stdout)
    assert "TEST 2" in said and "before the first flight" not in said
    assert "this test is your own, and no committee has judged it" in known["risk_unknown"]
    assert f": {known['risk_unknown']}\n" in said and known["why"] in said
    (*_, test) = look().tests
    assert test.parameters["angle.kp"] == 1.5
    flown(test)
    assert run("tell", "rig.db", "2", "flight.csv").exit_code == 0
    assert "TEST 3" in run("ask", "rig.db").stdout and look().trusted.number == 2


def test_a_first_test_that_failed_for_another_cause_than_its_gains_is_flown_after_the_advised_command(folder):
    run("ask", "rig.db")
    run("tell", "rig.db", "0", "--failed", "no power")
    refused = run("ask", "rig.db")
    written = "twinloop withdraw rig.db 0 --reason"
    assert refused.exit_code == 2 and f"withdraw the failure: {written} WHY." in refused.stderr
    assert run(*shlex.split(f"{written} 'no power'")[1:]).exit_code == 0
    assert "TEST 0" in run("ask", "rig.db").stdout


@pytest.mark.parametrize("attached", [False, True])
def test_before_the_first_flight_there_is_no_other_test_and_the_reason_is_said(folder, attached):
    assert "TEST 0" in run("ask", "rig.db", "--again").stdout, "nothing waits yet"
    if attached:
        flown(look().tests[0], "old.csv")
        assert run("attach", "rig.db", "old.csv").exit_code == 0
    refused = run("ask", "rig.db", "--again")
    assert refused.exit_code == 2 and refused.stdout == "" and refused.stderr.count("\n") == 1
    assert "--again: expected the flight of a test" in refused.stderr
    assert "fly test 0, which twinloop ask rig.db shows" in refused.stderr
    assert "twinloop abandon rig.db 0." in refused.stderr and len(look().tests) == 1
    assert run("abandon", "rig.db", "0").exit_code == 0
    assert "TEST 1" in run("ask", "rig.db", "--again").stdout


def test_another_duration_is_named_as_the_file_does(folder):
    run("ask", "rig.db")
    file = folder / "rig.toml"
    before = file.read_text(encoding="utf-8")
    file.write_text(before.replace("duration = 1.0 ", "duration = 1.5 "), encoding="utf-8")
    assert "found another: duration: 1.0 in the store, 1.5 now;" in run("ask", "rig.db").stderr
    file.write_text(before.replace("dt = 0.05 ", "dt = 0.1 "), encoding="utf-8")
    assert "found another: signals: dt: 0.05 in the store, 0.1 now;" in run("ask", "rig.db").stderr


def test_of_equal_periods_other_steps_are_another_campaign_however_short_they_are(tmp_path):
    def campaign(steps):
        return tl.Campaign(
            tl.Signals([tl.State("x", "m", 1.0)], [tl.Command("u", "N", (-1.0, 1.0))], 1e-10), duration=steps * 1e-10,
            controller=tl.controllers.StateFeedback(None, (-1.0, 1.0)), initial_state=[0.5], target_state=[0.0],
            store=tmp_path / "quick.db", threads=1, progress=None,
        )  # fmt: skip

    campaign(100).close()
    campaign(100).close()
    with pytest.raises(tl.InvalidInput, match=r"duration: 1e-08 in the store, 1\.04e-08 now"):
        campaign(104)


def test_what_differs_between_a_store_and_its_file_is_named_where_long_lists_begin_alike(folder):
    run("ask", "rig.db")
    file = folder / "rig.toml"
    before = file.read_text(encoding="utf-8")
    file.write_text(before.replace('derivative_of = "angle"\n', ""), encoding="utf-8")
    refused = run("ask", "rig.db")
    assert refused.exit_code == 2
    assert "signals: state rate: derivative_of: 'angle' in the store, none now" in refused.stderr


# The campaign file


def test_the_file_that_is_written_is_a_campaign_with_every_default(tmp_path):
    assert run("new", str(tmp_path / "rig.toml")).exit_code == 0
    text = (tmp_path / "rig.toml").read_text(encoding="utf-8")
    plain = read_file(tmp_path / "rig.toml").campaign()
    # The comments are the defaults: without their signs it is the same campaign.
    head, _, options = text.partition("[options]")
    uncommented = head + "[options]" + options.replace("\n# ", "\n")
    (tmp_path / "all.toml").write_text(uncommented, encoding="utf-8")
    assert read_file(tmp_path / "all.toml").campaign().setup.to_record() == plain.setup.to_record()


def test_the_body_that_stands_in_the_file_as_a_comment_can_be_declared(tmp_path):
    _, block, rest = template("rig.db").partition("# [kinematics]")
    lines = (block + rest).split("\n\n")[0]
    states = "".join(
        f'[states.{name}]\nunit = "{unit}"\nscale = 1.0\n'
        for name, unit in [*((n, "rad") for n in ("roll", "pitch", "yaw")), *((n, "rad/s") for n in "pqr")]
    )
    commands = '[commands.u]\nunit = "N m"\nbounds = [-1.0, 1.0]\n'
    file = tmp_path / "rig.toml"
    file.write_text(
        "dt = 0.01\n" + states + "\n".join(line[2:] for line in lines.split("\n")) + "\n" + commands,
        encoding="utf-8",
    )
    assert read_signals(file)[0].kinematics == tl.RigidBody(("roll", "pitch", "yaw"), ("p", "q", "r"))


@pytest.mark.parametrize("alone", ['"angle"', '["angle"]'])
def test_an_axis_may_be_an_angle_alone(tmp_path, alone):
    file = tmp_path / "rig.toml"
    file.write_text(PENDULUM.replace('["angle", "rate"]', alone, 1), encoding="utf-8")
    assert read_file(file).arguments["controller"].axes == (("angle", None),)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("dt = 0.05", "dtt = 0.05", "did you mean 'dt'"),
        ("duration", "duraton", "did you mean 'duration'"),
        ("derivative_of", "derivate_of", "did you mean 'derivative_of'"),
        ("[first]", "[frist]", "did you mean 'first'"),
        ('"pid"', '"pit"', "did you mean 'pid'"),
        ('"angle.kp" = [0.0, 6.0]', '"angle.kq" = [0.0, 6.0]', "angle.k"),
        (
            '"angle.kd" = [0.0, 1.0]\n',
            "",
            r"\[controller\]: PID, gains: .* none for angle.kd; add them, or a number",
        ),
        ('["angle", "rate"]', "7", r"\[controller\]: .*axes\[0\]: expected a list, found 7"),
        ("seed = 0", "sed = 0", "did you mean 'seed'"),
        ("seed = 0", "seed = -1", "seed"),
        ("scale = 3.14", 'scale = "3.14"', "number"),
        ("[task]", "[task", "expected TOML"),
        ("[states.angle]", "[states.'angle; rm']", "rename"),
        ("dt = 0.05", "dt = 0.05\nkinematics = 'x'", r"write a section \[kinematics\] with angles = \["),
        ("[first]", "[kinematics]\nangle = []\n[first]", "did you mean 'angles'"),
        (
            "[first]",
            '[log]\ntorqe = "Out 1"\n[first]',
            r"signal under \[log\] of .*'torqe': did you mean 'torque'",
        ),
        (
            "[first]",
            '[kinematics]\nangles = ["angle"]\n[first]',
            r"\[kinematics\]: expected rates, found none",
        ),
    ],
)
def test_a_file_with_a_mistake_is_refused_with_what_is_wrong(tmp_path, old, new, word):
    assert old in PENDULUM
    file = tmp_path / "rig.toml"
    file.write_text(PENDULUM.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(tl.InvalidInput, match=word):
        read_file(file).campaign()


@given(st.data())
def test_a_file_with_anything_in_it_is_a_campaign_or_refused(tmp_path_factory, data):
    lines = PENDULUM.splitlines()
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(lines) - 1))
        other = data.draw(
            st.sampled_from(["", "a = 1", "[x]", "[states]", "dt = inf", "unit = [nan]", lines[at] * 2])
        )
        lines[at] = data.draw(st.sampled_from([other, lines[at].partition("=")[0] + "= " + repr(other)]))
    file = tmp_path_factory.mktemp("file") / "rig.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    try:
        read_file(file).campaign()
    except tl.InvalidInput as refusal:
        assert len(str(refusal)) < 2000


# Logs


def test_a_log_comes_back_to_the_bit(tmp_path):
    stream = np.random.default_rng(1)
    run = tl.Trajectory(0.05 * np.arange(6), stream.standard_normal((6, 2)), stream.standard_normal((5, 1)))
    columns = {
        "torque": run.commands[:, 0],
        "note": run.t,
        "rate": run.states[:, 1],
        "angle": run.states[:, 0],
    }
    write_columns(tmp_path / "log.csv", {**columns, "t": run.t})
    assert same(tl.load(tmp_path / "log.csv", SIGNALS), run)
    text = (tmp_path / "log.csv").read_text(encoding="utf-8").replace(",", ";")
    (tmp_path / "log.csv").write_text("\ufeff" + text + "\n\n", encoding="utf-8")
    assert same(tl.load(tmp_path / "log.csv", SIGNALS), run)
    # A separator behind the last cell of each row is no number.
    (tmp_path / "log.csv").write_text(text.replace("\n", ";\n"), encoding="utf-8")
    assert same(tl.load(tmp_path / "log.csv", SIGNALS), run)
    full = np.vstack([run.commands, run.commands[-1:]])
    np.savez(tmp_path / "log.npz", t=run.t, states=run.states, commands=full)
    assert same(tl.load(tmp_path / "log.npz", SIGNALS), run)
    (tmp_path / "log.npz").rename(tmp_path / "LOG.NPZ")
    assert same(tl.load(tmp_path / "LOG.NPZ", SIGNALS), run)


def test_a_log_whose_columns_have_other_names_is_told_attached_checked_and_withdrawn_as_it_is(folder):
    run("ask", "rig.db")
    flight = flown(look().tests[0])
    theirs = {"t": "Time (s)", "angle": "IMU pitch", "rate": "wy", "torque": "Out 1"}
    log = folder / "flight.csv"
    text = log.read_text(encoding="utf-8")
    head, _, body = text.partition("\n")
    log.write_text(
        ",".join(theirs[name] for name in head.split(",")) + ",Out 2\n" + body.replace("\n", ",7\n"),
        encoding="utf-8",
    )
    refused = run("tell", "rig.db", "0", "flight.csv")
    assert refused.exit_code == 2 and "under [log] of the campaign file" in refused.output

    # It may be said at any time: nothing that is known of the campaign changes.
    lines = ["[log]", *(f'{name} = "{column}"' for name, column in theirs.items())]
    with open("rig.toml", "a", encoding="utf-8") as file:
        file.write("\n".join(["", *lines, ""]))
    assert run("check", "flight.csv", "rig.toml", "-o", "own.csv").exit_code == 0
    assert same(tl.load("own.csv", SIGNALS).states, flight.states)
    told = run("tell", "rig.db", "0", "flight.csv")
    assert told.exit_code == 0, told.output
    assert same(look().experiments[0].trajectory.states, flight.states)
    assert same(look().experiments[0].trajectory.commands, flight.commands)
    assert run("withdraw", "rig.db", "flight.csv", "--reason", "a test").exit_code == 0
    assert run("attach", "rig.db", "flight.csv").exit_code == 0 and look().experiments[0].attached
    assert run("withdraw", "rig.db", "flight.csv", "--reason", "a test").exit_code == 0
    assert not look().experiments
    said = run("ask", "rig.db").stdout
    assert "Record t ('Time (s)'), angle ('IMU pitch'), rate ('wy'), torque ('Out 1'), then:" in said
    # One with the signals' own names needs no others.
    assert run("tell", "rig.db", "0", "own.csv").exit_code == 0


@pytest.mark.parametrize("mark", ["\v", "\f", "\x1c", "\x85", "\u2028"])
def test_a_note_may_hold_any_mark_and_a_line_end_in_quotes(tmp_path, mark):
    text = f't,angle,rate,torque,note\n0,1,0,0,"two\nlines"\n0.05,2,0,0,a{mark}b\n0.1,3,0,,c\n'
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    assert tl.load(tmp_path / "log.csv", SIGNALS).states[:, 0].tolist() == [1.0, 2.0, 3.0]
    (tmp_path / "log.csv").write_text(text.replace("0.1,3", "0.1,x"), encoding="utf-8")
    with pytest.raises(tl.InvalidInput, match="line 5: expected a number for angle, found 'x'"):
        tl.load(tmp_path / "log.csv", SIGNALS)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "column"),
        ("t,angle,rate,torqe\n0,0,0,0\n", "did you mean 'torqe'"),
        ("t,angle,rate,torque,rate\n0,0,0,0,0\n0.05,0,0,0,9\n", "one column called rate, found 2; rename"),
        ("t,angle,rate,torque\n0,0,x,0\n0.05,0,0,0\n", "line 2: expected a number for rate, found 'x'"),
        (
            "t,angle,rate,torque\n0,0,0,0\n0.05,0\n",
            "line 3: expected a number for rate, found a row of 2 cells that ends before it; complete",
        ),
        ("\nt,angle,rate,torque\n\n0,0,0,0\n\n0.05,0,x,0\n", "line 6: expected a number for rate, found 'x'"),
        (
            "t,angle,rate,torque\n0,0,1,0,0\n0,05,0,0,0,0\n",
            "line 2: expected 4 cells, .*found 5; write decimals",
        ),
        ("t;angle;rate;torque\n0;0,1;0;0\n0,05;0;0;0\n", "for t, found '0,05'; write decimals with a point"),
        (
            "t,angle,rate,torque\n25.10.2026 00:30:00,0,0,0\n",
            "line 2: .*; write times in s from any start, such as that of the first row, not as dates",
        ),
        (
            "t,angle,rate,torque\n0,0,0,0\n0.05,0,,0\n0.1,0,,0\n0.15,0,0,0\n",
            "for rate in each row, found nan in line 3, t = 0.05 s .2 such rows.; fill it in, or cut",
        ),
        ("t,angle,rate,torque\n0.05,0,0,0\n0,0,0,0\n", "log.csv: .*times that grow.* at line 3; sort"),
        (
            "t,angle,rate,torque\n0,0,0,0\n0.05,0,nan,0\n",
            "log.csv: .*for rate in each row, found nan in line 3, t = 0.05 s",
        ),
        (
            "t,angle,rate,torque\n0,1_000,0,0\n0.05,0,0,0\n",
            "line 2: expected a number for angle, found '1_000'",
        ),
        ("t,angle,rate,torque\n0,0,٣,0\n0.05,0,0,0\n", "line 2: expected a number for rate, found '٣'"),
        ("t,angle,rate,torque\n0,0,0,inf\n0.05,0,0,0\n", "for torque in each row, found inf in line 2"),
        ("t,angle,rate,torque\n", "log.csv: .*record the run"),
    ],
)
def test_a_log_with_a_mistake_is_refused_with_its_place(tmp_path, text, word):
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    with pytest.raises(tl.InvalidInput, match=word):
        tl.load(tmp_path / "log.csv", SIGNALS)


def test_no_log_and_an_archive_of_something_else_are_refused(tmp_path):
    with pytest.raises(tl.InvalidInput, match="check its name"):
        tl.load(tmp_path / "log.csv", SIGNALS)
    np.savez(tmp_path / "log.npz", t=np.arange(3.0))
    with pytest.raises(tl.InvalidInput, match="no states, commands"):
        tl.load(tmp_path / "log.npz", SIGNALS)
    np.savez(tmp_path / "log.npz", t=np.array([object()], dtype=object), states=[0], commands=[0])
    with pytest.raises(tl.InvalidInput, match="file of NumPy"):
        tl.load(tmp_path / "log.npz", SIGNALS)
    arrays = {"t": np.arange(3.0), "states": np.zeros((3, 2)), "commands": np.zeros((2, 1))}
    for name in arrays:
        np.savez(tmp_path / "log.npz", **{**arrays, name: np.float64(1.0)})
        with pytest.raises(tl.InvalidInput, match=f"an array {name} .*a single value"):
            tl.load(tmp_path / "log.npz", SIGNALS)


@pytest.mark.parametrize(
    ("predicted", "spread", "words"),
    [
        (0.16604, 0.006641, "0.166 ± 0.00664"),
        (0.5, None, "0.5"),
        (float("inf"), float("inf"), "diverges on the twin"),
    ],
)
def test_a_prediction_is_said_in_words_where_there_is_no_number(predicted, spread, words):
    signals = tl.Signals([tl.State("x", "m", 1.0)], [tl.Command("u", "N", (-1.0, 1.0))], 0.1)
    family = tl.controllers.PID([("x", None)], {"x.kp": (0.0, 1.0), "x.ki": 0.0, "x.kd": 0.0}).bind(signals)
    test = tl.Test(family, family.genes({"x.kp": 0.5}), [0.0], [1.0], 5, predicted=predicted, spread=spread)
    assert words in foretold(test) and "inf" not in foretold(test)
