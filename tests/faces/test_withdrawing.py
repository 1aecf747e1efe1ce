"""The command `withdraw`: by the number of a test, by a log, by the place of an attached flight; and what shows it."""

import json
import re
from contextlib import closing

import pytest
from click.testing import CliRunner

import twinloop as tl
from conftest import pendulum_step
from lives import SIGNALS, SMALL, by_hand
from twinloop.campaign.campaign_file import _toml, template
from twinloop.faces.cli import main
from twinloop.faces.withdrawing import recorded
from twinloop.logs import write_columns


def run(*arguments):
    return CliRunner().invoke(main, list(arguments))


def look():
    return tl.Campaign.load("rig.db", read_only=True)


def written(flight, file):
    """A flight as a person would record it."""
    columns = {"t": flight.t, "angle": flight.states[:, 0], "rate": flight.states[:, 1]}
    write_columns(file, {**columns, "torque": flight.commands[:, 0]})


def flown(test, file):
    written(tl.systems.Simulated(SIGNALS, pendulum_step).run(test), file)


@pytest.fixture
def flights(tmp_path, monkeypatch):
    """An attached flight, a test with a flight, and a test that was planned with both."""
    monkeypatch.chdir(tmp_path)
    options = "\n".join(f"{name} = {_toml(value)}" for name, value in SMALL.items())
    text = f"{template('rig.db').partition('[options]')[0]}[options]\n{options}\n"
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    written(by_hand(30), tmp_path / "old.csv")
    for arguments in (("attach", "rig.db", "old.csv"), ("ask", "rig.db")):
        assert run(*arguments).exit_code == 0
    flown(look().tests[0], tmp_path / "flight0.csv")
    for arguments in (("tell", "rig.db", "0", "flight0.csv"), ("ask", "rig.db")):
        assert run(*arguments).exit_code == 0
    return tmp_path


def withdrawn(which, *more):
    return run("withdraw", "rig.db", which, "--reason", "columns exchanged", *more)


def test_a_flight_is_withdrawn_by_its_test_which_then_waits_for_its_log(flights):
    said = withdrawn("0")
    assert said.exit_code == 0, said.output
    assert "Saved: the flight of test 0 withdrawn; 1 experiment in rig.db." in said.stdout
    assert "Test 1 abandoned: planned with it." in said.stdout
    assert "twinloop tell rig.db 0 FLIGHT.csv" in said.stdout
    campaign = look()
    assert [campaign.status(test) for test in campaign.tests] == ["asked", "abandoned"]
    assert "TEST 0 of rig.db" in run("ask", "rig.db").stdout
    # The same log, with its mistake or without, may be told again.
    assert run("tell", "rig.db", "0", "flight0.csv").exit_code == 0
    assert look().cost.runs == 1


@pytest.mark.parametrize("which", ["0", "attached-1"])
def test_a_campaign_file_that_cannot_be_read_keeps_no_flight(flights, which):
    (flights / "rig.toml").write_text("[log\n", encoding="utf-8")
    said = withdrawn(which)
    assert said.exit_code == 0, said.output
    refused = withdrawn("old.csv")
    assert refused.exit_code == 2 and "rig.toml" in refused.output and "Traceback" not in refused.output


@pytest.mark.parametrize("which", ["old.csv", "attached-1"])
def test_an_attached_flight_is_withdrawn_by_its_log_or_its_place(flights, which):
    facts = json.loads(withdrawn(which, "--json").stdout)
    assert facts == {"test": None, "reason": "columns exchanged", "abandoned": [1], "experiments": 1}
    assert [run.number for run in look().experiments] == [0]


def test_an_attached_flight_is_withdrawn_by_the_name_of_its_log_once_that_is_elsewhere(flights):
    (flights / "old.csv").rename(flights / "moved.csv")
    assert "Saved: the attached log old.csv withdrawn" in withdrawn("old.csv").stdout


def test_a_part_of_a_flight_is_noticed_wherever_it_is_from(flights):
    head, *rows = (flights / "old.csv").read_text("utf-8").splitlines(keepends=True)
    (flights / "part.csv").write_text("".join([head, *rows[7:19]]), encoding="utf-8")
    said = run("attach", "rig.db", "part.csv")
    assert said.exit_code == 0, said.output
    assert "of 30 steps has the same 11 steps, from row 7 on, to the last digit" in said.stderr


def test_the_answer_names_the_log_that_was_withdrawn_where_it_is_known(flights):
    with closing(tl.Campaign.load("rig.db")) as campaign:
        campaign.attach(by_hand(25))
    assert list(recorded(look()).values()) == [
        "the flight of test 0", "attached flight 2 (25 steps)", "attached flight 1 (old.csv, 30 steps)",
    ]  # fmt: skip
    assert "Saved: the attached log old.csv withdrawn; 2 experiments" in withdrawn("attached-1").stdout
    assert "Saved: an attached flight withdrawn; 1 experiment" in withdrawn("attached-1").stdout
    assert withdrawn("0").exit_code == 0
    assert look().withdrawn_logs == ("old.csv", "", "")
    shown = run("show", "rig.db").stdout
    assert ": an attached flight (columns exchanged)." in shown and ": the flight of test 0 (" in shown


@pytest.mark.parametrize(
    ("which", "number", "taken", "left"),
    [
        ("0", 2, "20 steps, completed", "9 steps, aborted: wind"),
        ("cut.csv", 1, "9 steps, aborted: wind", "20 steps, completed"),
    ],
)
def test_a_flight_that_is_the_beginning_of_another_record_is_noticed_and_withdrawn(
    flights, which, number, taken, left
):
    withdrawn("0")
    rows = (flights / "flight0.csv").read_text("utf-8").splitlines(keepends=True)
    (flights / "cut.csv").write_text("".join(rows[:11]), encoding="utf-8")
    cut = run("tell", "rig.db", "0", "--aborted", "cut.csv", "--reason", "wind")
    assert cut.exit_code == 0 and "count twice" not in cut.stderr
    whole = run("tell", "rig.db", "0", "flight0.csv")
    assert "A flight of test 0 of 9 steps has the same first 9 steps" in whole.stderr
    assert "It is flight 2 of this test" in whole.stdout and "It is flight" not in cut.stdout
    assert "twinloop withdraw rig.db LOG --reason WHY" in whole.stderr
    said = withdrawn(which).stdout
    assert f"Saved: the flight of test 0 (number {number} of the 2 told: {taken}) withdrawn; 2 exp" in said
    assert f"Still recorded of test 0: {left}." in said and "Its right log" not in said


def test_show_says_what_was_withdrawn_when_and_why(flights):
    withdrawn("attached-1")
    shown = run("show", "rig.db").stdout
    assert ": the attached log old.csv (columns exchanged)." in shown and "Withdrawn at 20" in shown
    assert run("learn", "rig.db").exit_code == 0
    assert "The attached log old.csv was withdrawn: columns exchanged." in run("show", "rig.db").stdout
    facts = json.loads(run("show", "rig.db", "--json").stdout)
    assert facts["store"]["withdrawn"][0]["reason"] == "columns exchanged"
    assert facts["result"]["cost"]["withdrawn"] == 1
    assert facts["result"]["withdrawn"] == [{"test": None, "reason": "columns exchanged", "log": "old.csv"}]
    assert run("report", "rig.db", "-o", "rig.html").exit_code == 0
    assert "<li>The attached log old.csv: columns exchanged</li>" in (flights / "rig.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("which", "sentence"),
    [
        ("7", "number of a test with a recorded flight, one of 0, found 7"),
        ("attached-2", r"or attached-1 \(old.csv, 30 steps\), found attached-2"),
        ("other.csv", "found other.csv"),
        ("flight1.csv", "found flight1.csv"),
    ],
)
def test_a_flight_that_there_is_not_is_refused(flights, which, sentence):
    flown(look().tests[1], flights / "flight1.csv")
    said = withdrawn(which)
    assert said.exit_code == 2
    assert re.search(sentence, said.stderr), said.stderr
    assert look().withdrawals == ()


def test_a_test_with_a_flight_has_not_failed_until_that_is_withdrawn(flights):
    said = run("tell", "rig.db", "0", "--failed", "oops")
    assert said.exit_code == 2 and "withdraw it first: twinloop withdraw rig.db 0 --reason WHY" in said.stderr
    withdrawn("0")
    assert run("tell", "rig.db", "0", "--failed", "oops").exit_code == 0
    assert look().status(look().tests[0]) == "failed"


def test_a_wrong_log_that_was_told_after_a_failure_is_taken_back_and_then_the_failure(flights):
    assert withdrawn("0").exit_code == 0
    assert run("tell", "rig.db", "0", "--failed", "the motor cut out").exit_code == 0
    assert run("tell", "rig.db", "0", "flight0.csv").exit_code == 0
    said = withdrawn("0").stdout
    assert "Saved: the flight of test 0 withdrawn; 1 experiment in rig.db." in said
    assert "Still recorded of test 0: its failure: the motor cut out." in said
    assert "twinloop withdraw rig.db 0 --reason WHY" in said
    campaign = look()
    assert [each.reason for each in campaign.failures] == ["the motor cut out"]
    assert not [each for each in campaign.experiments if each.number == 0]
    said = withdrawn("0").stdout
    assert "Saved: the failure of test 0 withdrawn" in said and "Still recorded" not in said
    assert look().failures == () and look().status(look().tests[0]) == "asked"
