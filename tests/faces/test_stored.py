"""The commands for campaigns that last: a run that is kept, resumed, shown, and refused where it is another one."""

import json

import pytest
from click.testing import CliRunner

from command import invoke, same_but_for_run_info
from twinloop.faces.cli import main

SMALL = (
    "run", "quadrotor", "--preset", "paper", "--generations", "6", "--test-generations", "3", "--noise", "0.001",
    "--set", "model_population=20", "--set", "test_population=10", "--set", "committee_size=5",
)  # fmt: skip


@pytest.fixture
def store(tmp_path):
    return str(tmp_path / "hover.db")


def run(*arguments):
    return CliRunner().invoke(main, list(arguments))


def test_a_run_that_stopped_after_any_experiment_ends_as_one_that_did_not(store):
    whole = run(*SMALL, "--experiments", "4", "--json").stdout
    for experiments in ("1", "3"):
        assert run(*SMALL, "--experiments", experiments, "--store", store).exit_code == 0
    again = run("resume", store, "--experiments", "4", "--json")
    assert again.exit_code == 0
    same_but_for_run_info(again.stdout, whole)
    # The same command on a store that is finished flies nothing, and answers the same.
    same_but_for_run_info(run(*SMALL, "--experiments", "4", "--store", store, "--json").stdout, whole)
    same_but_for_run_info(run("resume", store, "--json").stdout, whole)


def test_what_a_store_holds_is_shown(store):
    run(*SMALL, "--experiments", "2", "--store", store, "--name", "first")
    shown = run("show", store)
    assert "campaign 'first'" in shown.stdout and "Experiments recorded: 2 of 2." in shown.stdout
    assert "roll[k+1] = " in shown.stdout and "interrupted" not in shown.stdout
    answer = json.loads(run("show", store, "--json").stdout)
    assert answer["store"]["told"] == 2 and len(answer["result"]["experiments"]) == 2
    run(*SMALL, "--experiments", "1", "--store", store, "--name", "second")
    both = run("show", store)
    assert "first" in both.stdout and "second" in both.stdout
    assert [row["experiments"] for row in json.loads(run("show", store, "--json").stdout)["campaigns"]] == [
        2,
        1,
    ]
    assert json.loads(run("show", store, "--name", "second", "--json").stdout)["store"]["told"] == 1


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (("--seed", "1"), "seed: 0 in the store, 1 now"),
        (("--set", "mutants=4"), "options: mutants: "),
        (("--noise", "0.002"), "noise: 0.001 in the store, 0.002 now"),
        (("--experiments", "1"), "at least the 2 runs"),
    ],
)
def test_a_store_of_another_configuration_is_refused(store, change, word):
    run(*SMALL, "--experiments", "2", "--store", store)
    refused = run(*SMALL, "--experiments", "3", "--store", store, *change)
    assert refused.exit_code == 2 and word in refused.stderr


@pytest.mark.parametrize("command", ["resume", "show"])
def test_a_store_that_is_not_there_is_refused(store, command):
    refused = run(command, store)
    assert refused.exit_code == 2 and "no such file" in refused.stderr


def test_a_campaign_on_a_system_of_ones_own_is_resumed_from_python(store, new_campaign, pendulum):
    campaign = new_campaign()
    campaign.run(pendulum, 1)
    campaign.save(store)
    refused = run("resume", store)
    assert refused.exit_code == 2 and "from Python" in refused.stderr
    assert "Experiments recorded: 1 of 1." in run("show", store).stdout


def test_an_interruption_says_how_to_go_on(store, monkeypatch):
    from twinloop.systems import Quadrotor

    flown = []
    fly = Quadrotor.run

    def interrupted(self, test):
        flown.append(test)
        if len(flown) == 2:
            raise KeyboardInterrupt
        return fly(self, test)

    monkeypatch.setattr(Quadrotor, "run", interrupted)
    stopped = run(*SMALL, "--experiments", "2", "--store", store)
    assert stopped.exit_code == 130 and f"twinloop resume {store}" in stopped.stderr
    resumed = run("resume", store, "--json")
    same_but_for_run_info(resumed.stdout, run(*SMALL, "--experiments", "2", "--json").stdout)
    assert invoke("show", store).exit_code == 0


def test_neither_a_refusal_nor_the_facts_of_a_run_have_the_password_of_a_server(monkeypatch):
    refused = run("show", "postgres://me:s3cret@h/db")
    assert refused.exit_code == 2 and "postgres://me:***@h/db" in refused.stderr
    assert "s3cret" not in refused.stderr
    monkeypatch.setattr("sys.argv", ["twinloop", "run", "--store=postgresql://me:a/s3cret@h/db"])
    answer = json.loads(run(*SMALL, "--experiments", "1", "--json").stdout)
    assert answer["run_info"]["command"][-1] == "--store=postgresql://me:***@h/db"
