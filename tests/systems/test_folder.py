"""A rig that takes sheets out of a folder and puts logs into it: awaited, refused when wrong, and never lost."""

import json
import threading
import time

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS
from oracles import same_bits
from twinloop.campaign.campaign_file import read_file
from twinloop.contracts import check_system
from twinloop.logs import write_columns
from twinloop.systems.folder import LOOK


@pytest.fixture
def test(pendulum_signals, pendulum_controller):
    family = pendulum_controller.bind(pendulum_signals)
    added = np.outer(np.linspace(0.1, 0.0, 20), [1.0])
    return tl.Test(
        family, family.genes(PENDULUM_GAINS), np.zeros(2), np.array([1.0, 0.0]), 20, added, number=3
    )


@pytest.fixture
def make(tmp_path, pendulum_signals):
    return lambda **changes: tl.systems.Folder(
        tmp_path / "drop", pendulum_signals, **{"timeout": 0.3, "settled": 0.05, **changes}
    )


def write(path, run):
    signals = ("angle", "rate")
    columns = {
        "t": run.t,
        **{name: run.states[:, i] for i, name in enumerate(signals)},
        "torque": run.commands[:, 0],
    }
    write_columns(path, columns)


def as_a_rig(sheet, pendulum, controller):
    """Flies what a sheet says, knowing nothing else."""
    family, found = controller.bind(pendulum.signals), json.loads(sheet.read_text(encoding="utf-8"))
    start, target = (list(found[key].values()) for key in ("initial_state", "target_state"))
    added = found["excitation"] and np.column_stack(list(found["excitation"].values()))
    genes = family.genes(found["gains"])
    return pendulum.run(tl.Test(family, genes, start, target, found["steps"], added))


class Rig(threading.Thread):
    """Watches the folder, and writes logs slowly, in two halves."""

    def __init__(self, folder, pendulum, controller):
        super().__init__(daemon=True)
        self.folder, self.pendulum, self.controller, self.over = folder, pendulum, controller, False
        self.start()

    def run(self):
        while not self.over:
            for sheet in sorted(self.folder.glob("test-*.json")):
                log = self.folder / f"flight-{sheet.stem[5:]}.csv"
                if log.exists():
                    continue
                write(self.folder / "draft", as_a_rig(sheet, self.pendulum, self.controller))
                text = (self.folder / "draft").read_text()
                with log.open("w") as file:
                    for part in (text[: len(text) // 2], text[len(text) // 2 :]):
                        file.write(part)
                        file.flush()
                        time.sleep(2.0 * LOOK)  # so that half of a log is looked at, and has to be waited for
            time.sleep(0.02)


def test_a_campaign_flies_through_a_folder_and_a_restart_asks_nothing_twice(
    make, tmp_path, pendulum, pendulum_controller, new_campaign
):
    system = make(timeout=20.0, settled=4.0 * LOOK, default_gains=PENDULUM_GAINS)
    rig = Rig(tmp_path / "drop", pendulum, pendulum_controller)
    check_system(
        make(timeout=20.0, settled=4.0 * LOOK, default_gains=PENDULUM_GAINS), pendulum_controller, steps=20
    )
    (tmp_path / "drop" / "test-0000.json").unlink()
    (tmp_path / "drop" / "flight-0000.csv").unlink()
    campaign = new_campaign(store=tmp_path / "x.db")
    campaign.run(system, 2)
    campaign.close()
    rig.over = True
    rig.join()
    direct = new_campaign().run(pendulum, 2)
    for a, b in zip(campaign.experiments, direct.experiments, strict=True):
        np.testing.assert_allclose(a.trajectory.states, b.trajectory.states, rtol=1e-12, atol=1e-12)
    # A crash before the tell: the test still waits, its log is there, the rig is switched off.
    again = make()
    assert same_bits(again.run(campaign.tests[1]).states, campaign.experiments[1].trajectory.states)
    assert len(list((tmp_path / "drop").glob("test-*"))) == 2


def test_no_log_in_time_is_said_and_a_later_one_is_read(make, tmp_path, test, pendulum):
    with pytest.raises(tl.SystemFailure, match=r"expected flight-0003\.csv or \.npz within 0\.3 s"):
        make().run(test)
    write(tmp_path / "drop" / "flight-0003.csv", pendulum.run(test))
    run = make().run(test)
    assert run.ended == "completed" and run.steps == 20
    sheet = json.loads((tmp_path / "drop" / "test-0003.json").read_text())
    assert (
        sheet["gains"] == PENDULUM_GAINS and sheet["excitation"]["torque"] == test.excitation[:, 0].tolist()
    )


def test_half_written_and_wrong_logs_are_refused_and_kept(make, tmp_path, test, pendulum):
    system, log = make(), tmp_path / "drop" / "flight-0003.csv"
    with pytest.raises(tl.SystemFailure):
        system.run(test)
    write(log, pendulum.run(test))
    text = log.read_text()
    rows = text.splitlines(keepends=True)
    for content, sentence in (
        ("".join(rows[:10]), r"expected 21 rows of states, found 9.*flight-0003\.txt"),
        (text[:-40], "expected a number|expected 21 rows"),
        (text.rstrip() + "0.0\n1.05,0,0,\n", "found 22.*cut it"),
        (text.replace("rate", "speed"), "column.*rate.*go on"),
        ("", "column"),
        ("\x00\x01", "column"),
    ):
        log.write_text(content)
        with pytest.raises(tl.SystemFailure, match=sentence):
            system.run(test)
        assert log.read_text() == content
    (tmp_path / "drop" / "flight-0003.txt").write_text("too close\nto the wall\n")
    log.write_text("".join(rows[:10]))
    run = system.run(test)
    assert (run.ended, run.reason, run.steps) == ("aborted", "too close to the wall", 8)


def test_logs_and_sheets_of_others_are_refused(make, tmp_path, test, pendulum, pendulum_signals):
    system, log = make(), tmp_path / "drop" / "flight-0003.csv"
    write(log, pendulum.run(test))
    with pytest.raises(tl.InvalidInput, match="before its test was asked for"):
        system.run(test)
    log.unlink()
    (tmp_path / "drop" / "test-0003.json").write_text("{}")
    with pytest.raises(tl.InvalidInput, match="of another test or campaign"):
        system.run(test)
    with pytest.raises(tl.InvalidInput, match="expected a folder"):
        tl.systems.Folder(tmp_path / "drop" / "test-0003.json", pendulum_signals)


def test_two_logs_of_one_test_are_refused(make, tmp_path, test, pendulum):
    with pytest.raises(tl.SystemFailure):
        make().run(test)
    for suffix in (".csv", ".npz"):
        (tmp_path / "drop" / f"flight-0003{suffix}").write_text("")
    with pytest.raises(tl.SystemFailure, match="expected one log"):
        make().run(test)


def test_columns_of_other_names_are_read_where_they_are_named(make, tmp_path, test, pendulum):
    log = tmp_path / "drop" / "flight-0003.csv"
    with pytest.raises(tl.SystemFailure):
        make().run(test)
    write(log, pendulum.run(test))
    own = make().run(test)
    log.write_text(log.read_text().replace("angle", "IMU roll", 1))
    named = make(columns={"angle": "IMU roll"}).run(test)
    np.testing.assert_array_equal(named.states, own.states)


def test_the_columns_that_a_campaign_file_names_are_those_of_the_folders_logs(tmp_path, pendulum):
    file = tmp_path / "rig.toml"
    file.write_text(
        """
dt = 0.05
states.angle = { unit = "rad", scale = 3.0 }
commands.torque = { unit = "N m", bounds = [-1.0, 1.0] }
controller = { kind = "pid", axes = ["angle"], gains = { "angle.kp" = [0.0, 1.0], "angle.ki" = 0.0, "angle.kd" = 0.0 } }
task = { initial_state = [0.0], target_state = [1.0], duration = 0.2 }
first = { "angle.kp" = 0.5 }
log = { angle = "IMU roll" }
system = { use = "folder", arguments = { path = "drop", timeout = 1.0, settled = 0.05 } }
"""
    )
    described = read_file(file)
    system = described.system()
    test = described.campaign(progress=None).test({"angle.kp": 0.5})
    with pytest.raises(tl.SystemFailure):
        system.run(test)
    rows = "".join(f"{0.05 * k:.2f},{0.1 * k:.1f},0.2\n" for k in range(5))
    (tmp_path / "drop" / f"flight-{test.number:04d}.csv").write_text("t,IMU roll,torque\n" + rows)
    np.testing.assert_allclose(system.run(test).states[:, 0], 0.1 * np.arange(5))
