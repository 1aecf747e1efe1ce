"""A campaign file that was changed since its campaign began: refused where something is granted or flown, else said."""

import json
import shutil
from pathlib import Path

import pytest

from command import invoke
from dashboards import call, flight, look, served
from lives import PLANT, SMALL
from twinloop.campaign.campaign_file import _toml, read_file, template

OPTIONS = "[options]\n" + "".join(f"{name} = {_toml(value)}\n" for name, value in SMALL.items())
PENDULUM = template("rig.db").partition("[options]")[0]
AUTOPILOT = """
[autopilot]
kind = "json"
[autopilot.parameters]
"angle.kp" = "KP"
"angle.ki" = "KI"
"angle.kd" = "KD"
"""
GRANTED = [
    ("certify", "rig.db", "-o", "cert"),
    ("settings", "rig.db", "1", "-o", "sheet"),
    ("export", "rig.db", "controller", "--to", "c", "-o", "controller.c", "--force"),
]
SHOWN = [
    ("learn", "rig.db"),
    ("show", "rig.db"),
    ("report", "rig.db", "-o", "report.html"),
    ("report", "rig.db", "--format", "svg", "-o", "figures"),
    ("compare", "rig.db", "rig.db"),
    ("export", "rig.db", "twin", "--to", "latex", "--force"),
]
CHANGES = {
    # A target beyond it is refused by itself; a narrower one beside it differs from the store.
    "envelope = [-2.5, 2.5]": "envelope = [-2.5, 1.1]",
    "scale = 3.14": "scale = 3.0",
    "duration = 1.0": "duration = 1.5",
    "seed = 0": "seed = 1",
    '"angle.kp" = 2.0': '"angle.kp" = 1.5',
    "bounds = [-2.0, 2.0]": "bounds = [-1.5, 2.0]",
}


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A folder with a campaign that was begun from its file: a recorded flight, and a test that waits."""
    pytest.importorskip("sqlalchemy")
    folder = tmp_path_factory.mktemp("flown")
    (folder / "rig.toml").write_text(PENDULUM + OPTIONS, encoding="utf-8")
    file = read_file(folder / "rig.toml")
    campaign = file.campaign(store=folder / "rig.db", threads=1)
    first = campaign.test(file.first)
    campaign.tell(first, PLANT.run(first))
    campaign.ask()
    campaign.close()
    return folder


@pytest.fixture
def folder(flown, tmp_path, monkeypatch):
    for file in flown.iterdir():
        shutil.copy(file, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def changed(one, other):
    text = Path("rig.toml").read_text(encoding="utf-8")
    assert one in text
    Path("rig.toml").write_text(text.replace(one, other, 1), encoding="utf-8")


@pytest.mark.parametrize("change", CHANGES.items(), ids=list(CHANGES))
def test_what_is_granted_or_flown_is_refused_in_the_words_of_ask(folder, change):
    changed(*change)
    asked = invoke("ask", "rig.db")
    assert asked.exit_code == 2
    for command in GRANTED:
        done = invoke(*command)
        assert (done.exit_code, done.stderr) == (2, asked.stderr), command
    assert not any(Path(name).exists() for name in ("cert", "sheet", "controller.c"))


def test_where_results_are_only_shown_it_is_said_in_a_line(folder):
    quiet = {command: invoke(*command) for command in SHOWN}
    assert not any("was changed since" in done.stderr for done in quiet.values())
    changed("seed = 0", "seed = 1")
    reason = invoke("ask", "rig.db").stderr.removeprefix("twinloop: ")
    for command, before in quiet.items():
        done = invoke(*command)
        line = f"The campaign file rig.toml was changed since, and is not used here: {reason}"
        assert done.stderr.count(line) == (2 if command[0] == "compare" else 1), command
        assert done.exit_code == before.exit_code and done.stdout == before.stdout, command


def test_a_file_that_agrees_or_only_names_an_autopilot_changes_nothing(folder):
    for text in (PENDULUM + OPTIONS + AUTOPILOT, AUTOPILOT, None):
        Path("rig.toml").unlink(missing_ok=True)
        if text is not None:
            Path("rig.toml").write_text(text, encoding="utf-8")
        done = invoke("settings", "rig.db", "1", "-o", "sheet")
        assert done.exit_code == 0 and not done.stderr, done.output
        assert Path("sheet/test-1.json").exists() == (text is not None)
        shutil.rmtree("sheet")


def test_signals_of_a_file_that_is_no_whole_campaign_file_are_compared_too(folder):
    Path("rig.toml").write_text(PENDULUM.partition("[controller]")[0], encoding="utf-8")
    assert invoke("settings", "rig.db", "1", "-o", "sheet").exit_code == 0
    changed("[-2.5, 2.5]", "[-2.5, 1.5]")
    refused = invoke("settings", "rig.db", "1", "-o", "sheet")
    assert refused.exit_code == 2 and "state angle: envelope: 2: 2.5 in the store, 1.5 now" in refused.stderr


def test_a_system_that_a_file_names_is_not_made_to_look_at_its_campaign(folder):
    """Making it may open the port of a rig."""
    system = '[system]\nuse = "port:Rig"\n'
    (folder / "port.py").write_text("raise RuntimeError('opened')\n", encoding="utf-8")
    described = PENDULUM.partition("[controller]")[0]
    Path("rig.toml").write_text(f"{described}\n{system}\n{OPTIONS}", encoding="utf-8")
    assert invoke("settings", "rig.db", "1", "-o", "sheet").exit_code == 0
    changed("[-2.5, 2.5]", "[-2.5, 1.5]")
    refused = invoke("settings", "rig.db", "1", "-o", "sheet")
    assert refused.exit_code == 2 and "1.5 now" in refused.stderr and "opened" not in refused.output


def test_the_dashboard_says_it_and_sends_nothing_to_a_rig(folder):
    pytest.importorskip("starlette", reason="twinloop[dashboard] is not installed")
    pytest.importorskip("uvicorn", reason="twinloop[dashboard] is not installed")
    log = flight(folder / "flight.csv", look(folder / "rig.db").tests[1])
    changed("seed = 0", "seed = 1")
    with served(folder / "rig.db") as address:
        shown = json.loads(call(address, "GET", "/c/1/tests")[2])
        assert "rig.toml was changed since" in shown["unlearnt"]
        assert "seed: 0 in the store, 1 now" in call(address, "GET", "/c/1/tests/1/sheet")[2]
        for act in ("tests/1/approve", "tests/1/log?file=flight.csv", "tests/1/abandon"):
            status, _, said = call(address, "POST", f"/c/1/{act}", log if "log" in act else None)
            assert status == 422 and "seed: 0 in the store, 1 now" in said, act
        assert call(address, "GET", "/c/1/report")[0] == 200
        taken = call(address, "POST", "/c/1/flights/0/withdraw", json.dumps({"reason": "degrees"}))
        assert taken[0] == 200, taken
