"""What speaks against a flight that a system flew is said as it lands, as `tell` says it of one that a person flew."""

import re
import shutil
import sys
import threading
import time
from pathlib import Path

import pytest

import twinloop as tl
from command import invoke
from conftest import pendulum_step
from lives import SMALL
from twinloop.campaign.campaign_file import _toml, read_file, template
from twinloop.logs import write_columns

pytest.importorskip("sqlalchemy")

OPTIONS = "[options]\n" + "".join(f"{name} = {_toml(value)}\n" for name, value in SMALL.items())
PENDULUM = template("rig.db").partition("# [system]")[0]
RIGS = """
import twinloop as tl
from conftest import pendulum_step

class Radians:
    def __init__(self, signals):
        self.signals = signals

    def run(self, test):
        return tl.systems.Simulated(self.signals, pendulum_step).run(test)

class Degrees(Radians):
    def run(self, test):
        run = super().run(test)
        return tl.Trajectory(run.t, run.states * [57.3, 1.0], run.commands)
"""
AGAINST = "Against this flight: "


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "rigs", raising=False)
    (tmp_path / "rigs.py").write_text(RIGS, encoding="utf-8")
    return tmp_path


def described(*system):
    Path("rig.toml").write_text("\n".join([PENDULUM, *system, OPTIONS]), encoding="utf-8")


def against(done):
    return [line for line in done.stderr.splitlines() if line.startswith(AGAINST)]


def by_index(line):
    return re.sub(r"\bline (\d+)", lambda found: f"row {int(found[1]) - 2}", line)


def log_of(run, file, *, missing=None):
    columns = {"t": run.t, "angle": run.states[:, 0], "rate": run.states[:, 1], "torque": run.commands[:, 0]}
    if missing is not None:
        columns["angle"] = columns["angle"].copy()
        columns["angle"][missing] = float("nan")
    write_columns(file, columns)


def test_a_run_says_of_each_flight_what_tell_says_and_that_flights_go_on(folder):
    described('[system]\nuse = "rigs:Degrees"')
    done = invoke("run", "rig.toml", "--experiments", "2", "--threads", "1")
    assert done.exit_code == 0, done.output
    flown = tl.Campaign.load("rig.db", read_only=True).experiments
    shutil.copy("rig.toml", "hand.toml")
    assert invoke("ask", "hand.db").exit_code == 0
    log_of(flown[0].trajectory, Path("flight.csv"))
    # Without a file a row is called by its index; in a file the header is line 1.
    told = [by_index(line) for line in against(invoke("tell", "hand.db", "0", "flight.csv"))]
    assert any("controller gives" in line for line in told)
    said = against(done)
    assert said[: len(told)] == told and len(said) > len(told)
    lines = done.stderr.splitlines()
    assert [line for line in lines if line.startswith("Flights go on after test")] == [
        "Flights go on after test 0, whatever speaks against it; Ctrl-C stops them. To take this one back: twinloop"
        " withdraw rig.db 0 --reason WHY"
    ]
    # Before the second flight, and not with the report.
    assert lines.index(told[-1]) < lines.index(said[len(told)])
    assert AGAINST not in done.stdout


def test_what_speaks_against_a_log_of_a_drop_folder_is_said_by_its_lines(folder):
    described('[system]\nuse = "folder"\n[system.arguments]\npath = "drop"\nsettled = 0.05')

    def fly():
        for number in range(2):
            while not Path(f"drop/test-{number:04d}.json").exists():
                time.sleep(0.02)
            test = tl.Campaign.load("rig.db", read_only=True, progress=None).tests[number]
            plant = tl.systems.Simulated(test.family.signals, pendulum_step)
            log_of(plant.run(test), Path(f"drop/flight-{number:04d}.csv"), missing=7 if number == 0 else None)

    rig = threading.Thread(target=fly, daemon=True)
    rig.start()
    done = invoke("run", "rig.toml", "--experiments", "2", "--threads", "1")
    rig.join(10.0)
    assert done.exit_code == 0, done.output
    shutil.copy("rig.toml", "hand.toml")
    assert invoke("ask", "hand.db").exit_code == 0
    told = against(invoke("tell", "hand.db", "0", "drop/flight-0000.csv"))
    assert told and against(done) == told


def test_a_run_without_faults_says_nothing(folder):
    described('[system]\nuse = "rigs:Radians"')
    done = invoke("run", "rig.toml", "--experiments", "2", "--threads", "1")
    assert done.exit_code == 0 and AGAINST not in done.stderr and "go on" not in done.stderr


def test_how_a_flight_is_taken_back_names_its_campaign_where_the_store_holds_several(folder):
    described('[system]\nuse = "rigs:Degrees"')
    read_file("rig.toml").campaign(store="rig.db", name="other", threads=1).close()
    done = invoke("run", "rig.toml", "--experiments", "2", "--threads", "1", "--name", "degrees")
    assert "To take this one back: twinloop withdraw rig.db 0 --reason WHY --name degrees\n" in done.stderr
