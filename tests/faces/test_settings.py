"""A test as an autopilot takes it: gains, commands over time, and a chirp where the test asks for one."""

import csv
from contextlib import closing

import numpy as np
import pytest
from click.testing import CliRunner

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from lives import CONTROLLER, SIGNALS, SMALL
from twinloop.autopilots import Sweep
from twinloop.faces.cli import main

DECLARED = """
[autopilot]
kind = "ardupilot"
[autopilot.parameters]
"angle.kp" = "ATC_ANG_PIT_P"
"angle.ki" = "ATC_RAT_PIT_I"
"angle.kd" = "ATC_RAT_PIT_D"
[autopilot.sweep]
command = "torque"
axis = "mixer pitch"
amplitude = 0.05
first = 2.1
last = 2.5
duration = 1.0
"""
SWEEP = Sweep("torque", "mixer pitch", 0.05, 2.1, 2.5, 1.0)


@pytest.fixture
def kept(tmp_path):
    """A store with one flight, a planned test and one that is excited by the sweep."""
    pytest.importorskip("sqlalchemy")
    store = tmp_path / "rig.db"
    campaign = tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options=SMALL, store=store,
    )  # fmt: skip
    campaign.run(tl.systems.Simulated(SIGNALS, pendulum_step, default_gains=PENDULUM_GAINS), experiments=1)
    campaign.test({**PENDULUM_GAINS, "angle.kp": 1.5}, excitation=SWEEP.excitation("ardupilot", SIGNALS, 20))
    campaign.ask()
    tests, twin = campaign.tests, campaign.twin
    campaign.close()
    return store, tests, twin


def settings(store, number, folder, *options, declared=DECLARED):
    file = store.with_name("declared.toml")
    file.write_text(declared, encoding="utf-8")
    arguments = ["settings", str(store), str(number), "-o", str(folder), "--mapping", str(file), *options]
    return CliRunner().invoke(main, arguments)


def rows(path):
    return dict(line.split(",") for line in path.read_text().splitlines() if not line.startswith("#"))


def test_a_test_of_the_sweep_is_written_with_its_chirp(kept, tmp_path):
    store, tests, twin = kept
    done = settings(store, 1, tmp_path / "sheet")
    assert done.exit_code == 0 and done.stdout.startswith("Wrote "), done.output
    folder = tmp_path / "sheet"
    assert {path.name for path in folder.iterdir()} == {
        "restore.param", "test-1.param", "test-1-sweep.param", "test-1-commands.csv",
    }  # fmt: skip
    assert float(rows(folder / "restore.param")["ATC_ANG_PIT_P"]) == PENDULUM_GAINS["angle.kp"]
    assert float(rows(folder / "test-1.param")["ATC_ANG_PIT_P"]) == 1.5
    assert rows(folder / "test-1-sweep.param")["SID_AXIS"] == "11"
    with (folder / "test-1-commands.csv").open() as file:
        table = list(csv.DictReader(file))
    np.testing.assert_array_equal(
        [float(row["excitation_torque"]) for row in table], tests[1].excitation[:, 0]
    )
    sent = twin.simulate(tests[1]).commands[:, 0]
    np.testing.assert_array_equal([float(row["predicted_torque"]) for row in table], sent)


def test_a_planned_test_is_written_without_and_a_sentence_says_why(kept, tmp_path):
    done = settings(kept[0], 2, tmp_path / "sheet")
    assert done.exit_code == 0 and "sweeps one axis" in done.stdout
    assert not (tmp_path / "sheet" / "test-2-sweep.param").exists()
    assert (tmp_path / "sheet" / "test-2-commands.csv").exists()
    done = settings(kept[0], 2, tmp_path / "other", declared=DECLARED.partition("[autopilot.sweep]")[0])
    assert "expected [autopilot.sweep]" in done.stdout
    done = settings(kept[0], 1, tmp_path / "third", "--autopilot", "px4")
    assert done.exit_code == 0 and "sweep one axis" in done.stdout
    assert (tmp_path / "third" / "test-1.params").exists()


@pytest.mark.parametrize(
    ("number", "options", "said"),
    [
        (9, (), "Test"),
        (1, ("--autopilot", "betaflight"), "cannot have"),
        (1, ("--name", "other"), "other"),
    ],
)
def test_what_cannot_be_written_writes_nothing(kept, tmp_path, number, options, said):
    done = settings(kept[0], number, tmp_path / "sheet", *options)
    assert done.exit_code == 2 and said in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "sheet").exists()


def test_without_an_autopilot_there_is_the_table_of_commands(kept, tmp_path):
    done = CliRunner().invoke(main, ["settings", str(kept[0]), "2", "-o", str(tmp_path / "sheet")])
    assert done.exit_code == 0
    assert [path.name for path in (tmp_path / "sheet").iterdir()] == ["test-2-commands.csv"]
    assert CliRunner().invoke(main, ["settings", "nowhere.db", "0", "-o", "x"]).exit_code == 2


def test_only_gains_that_are_known_to_fly_are_gone_back_to(tmp_path):
    """Before any flight, those of the test that waits; then the first one that flew to its end, and no failed one."""
    pytest.importorskip("sqlalchemy")
    store, folder = tmp_path / "rig.db", tmp_path / "sheet"
    restore = folder / "restore.param"
    rig = tl.systems.Simulated(SIGNALS, pendulum_step, default_gains=PENDULUM_GAINS)

    def entered(change):
        with closing(
            tl.Campaign(
                SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0,
                threads=1, options=SMALL, store=store,
            )
        ) as campaign:  # fmt: skip
            return change(campaign)

    def told(campaign):
        test = campaign.test({**PENDULUM_GAINS, "angle.kp": 1.5})
        campaign.tell(test, rig.run(test))

    entered(lambda campaign: campaign.abandon(campaign.test({**PENDULUM_GAINS, "angle.kp": 5.0})))
    entered(lambda campaign: campaign.test({**PENDULUM_GAINS, "angle.kp": 4.0}))
    assert settings(store, 1, folder).exit_code == 0
    assert float(rows(restore)["ATC_ANG_PIT_P"]) == 4.0
    entered(lambda campaign: campaign.tell_failed(campaign.tests[1], "gearbox broken"))
    done = settings(store, 1, folder)
    assert done.exit_code == 0 and "no test is known to fly" in done.stdout and not restore.exists()
    entered(told)
    assert settings(store, 1, folder).exit_code == 0
    assert float(rows(restore)["ATC_ANG_PIT_P"]) == 1.5
    assert entered(lambda campaign: campaign.certificate().old.number) == 2
