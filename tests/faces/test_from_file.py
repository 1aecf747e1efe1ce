"""A campaign file that names a system: run, resumed to the same bits, and refused where it is wrong."""

import subprocess
import sys

import pytest
from click.testing import CliRunner

import twinloop as tl
from lives import SMALL
from sameness import same
from twinloop.campaign.campaign_file import _toml, read_file, template
from twinloop.faces.cli import main

OPTIONS = "[options]\n" + "".join(f"{name} = {_toml(value)}\n" for name, value in SMALL.items())
PENDULUM = template("rig.db").partition("# [system]")[0]
SHORT = "[campaign]\nseed = 3\n"
RIG = """
import twinloop as tl
from math import sin

signals = tl.Signals(
    states=[
        tl.State("angle", "rad", scale=3.14, envelope=(-2.5, 2.5)),
        tl.State("rate", "rad/s", scale=8.0, derivative_of="angle", envelope=(-12.0, 12.0)),
    ],
    commands=[tl.Command("torque", "N m", bounds=(-2.0, 2.0))],
    dt=0.05,
)

def step(x, u):
    rate = x[1] + 0.05 * (u[0] - 1.2 * sin(x[0]) - 0.05 * x[1]) / 0.05
    return x[0] + 0.05 * rate, rate

def rig(noise=0.0, seed=0):
    return tl.systems.Simulated(signals, step, noise=noise, seed=seed)

def broken():
    from pathlib import Path

    return tl.systems.Simulated(signals, lambda x, u: step(x, u) if Path("mended").exists() else (float("nan"), 0.0))

def deaf(signals):
    return tl.systems.Simulated(signals, lambda x, u: x)

there = rig()
number = 3
"""


def section(use, timeout="", **arguments):
    lines = "".join(f"{name} = {_toml(value)}\n" for name, value in arguments.items())
    return f'[system]\nuse = "{use}"\n{timeout}\n[system.arguments]\n{lines}'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "rig", raising=False)
    (tmp_path / "rig.py").write_text(RIG, encoding="utf-8")
    return tmp_path


def written(folder, *parts, name="rig.toml"):
    (folder / name).write_text("\n".join([*parts, OPTIONS]), encoding="utf-8")


def run(*arguments):
    return CliRunner().invoke(main, list(arguments))


def flights(store):
    campaign = tl.Campaign.load(store, read_only=True)
    return [run.trajectory.states for run in campaign.experiments]


@pytest.mark.parametrize(
    ("use", "arguments"),
    [
        ("os:system", {"command": "echo > made"}),
        ("subprocess:run", {"args": ["touch", "made"]}),
        ("tl_beside:os.system", {"command": "echo > made"}),
    ],
)
def test_what_belongs_to_python_itself_is_not_called_as_a_system(folder, use, arguments):
    (folder / "tl_beside.py").write_text("import os\n", encoding="utf-8")
    written(folder, PENDULUM, section(use, **arguments))
    refused = run("run", "rig.toml")
    assert refused.exit_code != 0 and "one of Python's own modules" in refused.output
    assert not (folder / "made").exists()


def test_what_makes_a_system_may_be_partly_called_already(folder):
    (folder / "tl_partly.py").write_text(
        "import rig\nfrom functools import partial\nmake = partial(rig.rig, noise=0.01)\n"
    )
    written(folder, PENDULUM, section("tl_partly:make", seed=1))
    done = run("run", "rig.toml", "--experiments", "1", "--threads", "1")
    assert done.exit_code == 0, done.output


def test_a_system_of_ones_own_is_flown_and_resumed_with_the_same_bits(folder):
    written(folder, PENDULUM, section("rig:rig", "timeout = 60.0", noise=0.01, seed=1))
    done = run("run", "rig.toml", "--experiments", "3", "--threads", "1")
    assert done.exit_code == 0, done.output
    assert "rig:rig" in done.stdout
    # Another campaign in another process is killed on its second run, and goes on here.
    killed = "rig.rig = (lambda make: lambda **k: killing(make(**k)))(rig.rig)"
    script = f"""
import os, signal, rig
from twinloop.faces.cli import main
def killing(system):
    plain = system.run
    system.run = lambda test: os.kill(os.getpid(), signal.SIGKILL) if system.runs == 1 else plain(test)
    return system
{killed}
main(["run", "rig.toml", "--experiments", "3", "--threads", "1", "--store", "rig2.db"])
"""
    died = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, check=False)
    assert died.returncode == -9, died.stderr
    assert len(flights("rig2.db")) == 1
    (folder / "rig2.toml").write_text((folder / "rig.toml").read_text(encoding="utf-8"), encoding="utf-8")
    again = run("resume", "rig2.db", "--threads", "1")
    assert again.exit_code == 0, again.output
    assert same(flights("rig.db"), flights("rig2.db"))


def test_where_all_flights_failed_it_is_said_why_and_how_to_go_on_and_nobody_was_interrupted(folder):
    written(folder, PENDULUM, section("rig:broken"))
    done = run("run", "rig.toml", "--experiments", "1", "--threads", "1")
    assert done.exit_code == 1 and done.stdout == "" and "Interrupted" not in done.stderr
    assert "test 0 failed: a state left" in done.stderr and "stopped being finite" in done.stderr
    withdraw, resume = "withdraw rig.db 0 --reason WHY", "resume rig.db --experiments 2"
    assert f"take that back: twinloop {withdraw}. Go on with more: twinloop {resume}" in done.stderr
    (folder / "mended").touch()
    assert run(*withdraw.split()).exit_code == 0
    # A run that was taken back is spent until its test is told anew.
    spent = run("resume", "rig.db", "--threads", "1")
    assert spent.exit_code == 1 and "its only run is spent" in spent.stderr and resume in spent.stderr
    done = run(*resume.split(), "--threads", "1")
    assert done.exit_code == 0 and len(flights("rig.db")) == 2, done.output


HANGS = """
import time
from pathlib import Path
import rig

def hanging():
    system = rig.rig()
    plain = system.run
    def run(test):
        while test.number == 1 and not Path("mended").exists():
            time.sleep(0.05)
        return plain(test)
    system.run = run
    return system
"""


@pytest.mark.parametrize("by", ["option", "file"])
def test_a_system_that_hangs_is_given_up_in_a_sentence_and_nothing_is_lost(folder, monkeypatch, by):
    monkeypatch.delitem(sys.modules, "hangs", raising=False)
    (folder / "hangs.py").write_text(HANGS, encoding="utf-8")
    written(
        folder, PENDULUM, section("hangs:hanging", "timeout = 0.5" if by == "file" else "timeout = 600.0")
    )
    words = ["run", "rig.toml", "--experiments", "2", "--threads", "1"]
    stopped = run(*words, *(["--timeout", "0.5"] if by == "option" else []))
    assert stopped.exit_code == 1
    assert "test 1 within 0.5 s; check it. The test still waits and nothing is lost" in stopped.stderr
    assert "Continue with: twinloop resume rig.db" in stopped.stderr
    assert "1 experiment" in stopped.stdout and len(flights("rig.db")) == 1
    (folder / "mended").touch()
    done = run("resume", "rig.db", "--threads", "1")
    assert done.exit_code == 0, done.output
    assert [run.number for run in tl.Campaign.load("rig.db", read_only=True).experiments] == [0, 1]


def test_a_campaign_that_stopped_is_named_where_its_store_holds_several(folder, monkeypatch):
    monkeypatch.delitem(sys.modules, "hangs", raising=False)
    (folder / "hangs.py").write_text(HANGS, encoding="utf-8")
    written(folder, PENDULUM, section("hangs:hanging"))
    read_file("rig.toml").campaign(store="rig.db", name="other", threads=1).close()
    words = ["run", "rig.toml", "--experiments", "2", "--threads", "1", "--timeout", "0.5"]
    for name, said in (("campaign", "--name campaign"), ("my rig", "--name 'my rig'")):
        stopped = run(*words, "--name", name)
        assert f"Continue with: twinloop resume rig.db {said}\n" in stopped.stderr
        assert run("resume", "rig.db", "--name", name, "--timeout", "0.5").exit_code == 1


def test_a_first_flight_that_hangs_leaves_one_sentence(folder, monkeypatch):
    monkeypatch.delitem(sys.modules, "hangs", raising=False)
    (folder / "hangs.py").write_text(HANGS.replace("== 1", "== 0"), encoding="utf-8")
    written(folder, PENDULUM, section("hangs:hanging"))
    stopped = run("run", "rig.toml", "--timeout", "0.3")
    assert stopped.exit_code == 1 and stopped.stdout == ""
    assert "did not answer test 0 within 0.3 s" in stopped.stderr and "Interrupted" not in stopped.stderr


RAISES = """
import rig

def broken():
    system = rig.rig()
    plain = system.run
    def run(test):
        if test.number == {number}:
            open("/dev/no-such-port")
        return plain(test)
    system.run = run
    return system
"""


def test_a_rig_whose_code_raises_is_answered_with_the_line_that_did(folder, monkeypatch):
    monkeypatch.delitem(sys.modules, "raises", raising=False)
    (folder / "raises.py").write_text(RAISES.format(number=1), encoding="utf-8")
    written(folder, PENDULUM, section("raises:broken", "timeout = 60.0"))
    stopped = run("run", "rig.toml", "--experiments", "2", "--threads", "1")
    assert stopped.exit_code == 1 and "1 experiment" in stopped.stdout
    said = "expected a run, found FileNotFoundError in raises.py, line 9: [Errno 2] No such file or directory"
    assert said in stopped.stderr and "Continue with: twinloop resume rig.db" in stopped.stderr
    monkeypatch.delitem(sys.modules, "raises", raising=False)
    (folder / "raises.py").write_text(RAISES.format(number=99), encoding="utf-8")
    done = run("resume", "rig.db", "--threads", "1")
    assert done.exit_code == 0, done.output
    assert [flight.number for flight in tl.Campaign.load("rig.db", read_only=True).experiments] == [0, 1]


def test_a_rig_whose_code_raises_in_its_first_flight_leaves_a_sentence_and_no_traceback(folder, monkeypatch):
    monkeypatch.delitem(sys.modules, "raises", raising=False)
    (folder / "raises.py").write_text(RAISES.format(number=0), encoding="utf-8")
    written(folder, PENDULUM, section("raises:broken"))
    stopped = run("run", "rig.toml")
    assert stopped.exit_code == 1 and stopped.stdout == "" and isinstance(stopped.exception, SystemExit)
    assert "found FileNotFoundError in raises.py, line 9" in stopped.stderr
    assert "Test waiting to be flown: 0." in run("show", "rig.db").stdout


USELESS = """
import rig

def useless():
    system = rig.rig()
    plain = system.run
    def run(test):
        flight = plain(test)
        return None if test.number == {number} else flight
    system.run = run
    return system
"""


@pytest.mark.parametrize("number", [0, 1])
def test_a_rig_that_answers_with_nothing_is_named_and_its_test_waits(folder, monkeypatch, number):
    monkeypatch.delitem(sys.modules, "useless", raising=False)
    (folder / "useless.py").write_text(USELESS.format(number=number), encoding="utf-8")
    written(folder, PENDULUM, section("useless:useless"))
    stopped = run("run", "rig.toml", "--experiments", "2", "--threads", "1")
    assert stopped.exit_code == 1 and isinstance(stopped.exception, SystemExit)
    assert "System 'useless:useless': its answer cannot be entered. " in stopped.stderr
    assert "found None" in stopped.stderr
    assert "nothing is lost" in stopped.stderr and "Continue with: twinloop resume rig.db" in stopped.stderr
    assert f"Test waiting to be flown: {number}." in run("show", "rig.db").stdout
    assert ("1 experiment" in stopped.stdout) == (number == 1)


FAILS = """
import twinloop as tl
from pathlib import Path
import rig

def failing():
    system = rig.rig()
    plain = system.run
    def run(test):
        if not Path("plugged").exists():
            raise tl.SystemFailure("no motor")
        return plain(test)
    system.run = run
    return system
"""


@pytest.mark.parametrize("way", ["other gains", "withdrawn", "abandoned"])
def test_after_a_first_flight_that_failed_a_campaign_can_go_on_from_the_shell(folder, monkeypatch, way):
    monkeypatch.delitem(sys.modules, "fails", raising=False)
    (folder / "fails.py").write_text(FAILS, encoding="utf-8")
    written(folder, PENDULUM, section("fails:failing"))
    words = ["run", "rig.toml", "--experiments", "2", "--threads", "1"]
    failed = run(*words)
    assert failed.exit_code == 1 and "no motor" in failed.stderr
    again = run(*words)
    assert again.exit_code == 2 and "found those of test 0 (no motor)" in again.stderr
    assert "twinloop withdraw rig.db 0 --reason WHY" in again.stderr
    (folder / "plugged").touch()
    first = 0
    if way == "other gains":
        written(folder, PENDULUM.replace('"angle.kp" = 2.0', '"angle.kp" = 1.5'), section("fails:failing"))
        first = 1
    else:
        assert run("withdraw", "rig.db", "0", "--reason", "no motor").exit_code == 0
    if way == "abandoned":
        assert run("abandon", "rig.db", "0").exit_code == 0
        first = 1
    done = run(*words)
    assert done.exit_code == 0, done.output
    flown = tl.Campaign.load("rig.db", read_only=True).experiments
    assert flown[0].number == first
    assert flown[0].test.parameters["angle.kp"] == (1.5 if way == "other gains" else 2.0)


@pytest.mark.parametrize("seconds", ["0", "-1", "nan"])
def test_a_timeout_is_seconds_above_nothing(folder, seconds):
    refused = run("run", "quadrotor", "--timeout", seconds)
    assert refused.exit_code == 2 and "--timeout (s)" in refused.stderr


def test_the_risk_that_is_allowed_holds_for_a_file_too(folder):
    written(folder, PENDULUM, section("rig:rig"))
    stopped = run("run", "rig.toml", "--experiments", "2", "--threads", "1", "--max-risk", "0")
    assert stopped.exit_code == 1 and "risk" in stopped.stderr and len(flights("rig.db")) == 1
    assert "was not flown and still waits" in stopped.stderr


def test_a_built_in_system_needs_no_other_section(folder):
    written(folder, SHORT, section("quadrotor", noise=0.001, seed=3), name="hover.toml")
    file = read_file("hover.toml")
    plain = tl.systems.Quadrotor(noise=0.001, seed=3)
    assert file.system().to_record() == plain.to_record()
    campaign = file.campaign(threads=1)
    assert campaign.setup.seed == 3 and campaign.setup.steps == 100
    assert dict(file.first) == plain.default_gains


def test_a_system_that_asks_for_signals_is_given_those_of_the_file(folder):
    written(folder, PENDULUM, section("rig:deaf"))
    assert read_file("rig.toml").system().signals.state_names == ("angle", "rate")
    written(folder, PENDULUM, section("folder", path="drop"))
    assert read_file("rig.toml").system().path == folder / "drop"


@pytest.mark.parametrize(
    ("parts", "word"),
    [
        ((PENDULUM,), "found none; add it, or fly yourself"),
        ((PENDULUM, section("quadroto")), "did you mean 'quadrotor'"),
        ((PENDULUM, section("rig:rigg")), "has no attribute"),
        ((PENDULUM, section("rigg:rig")), "No module named"),
        ((PENDULUM, section("unread:rig")), "SyntaxError: invalid syntax (unread.py, line 2); correct it"),
        (
            (PENDULUM, section("unmade:Rig", noise=0.1)),
            "found OSError in unmade.py, line 3: no port; correct it",
        ),
        ((PENDULUM, section("rig:number")), "expected a system, or a class"),
        ((PENDULUM, section("rig:there", noise=0.1)), "name a class or a function"),
        ((PENDULUM, section("rig:rig", nois=0.1)), "did you mean 'noise'"),
        ((PENDULUM, section("rig:rig", "timeot = 3.0")), "did you mean 'timeout'"),
        ((PENDULUM, section("rig:rig", "timeout = -3.0")), "above 0"),
        ((PENDULUM, section("quadrotor")), "expected its own states"),
        (
            (
                PENDULUM.replace("scale = 8.0", "scale = 9.0").replace("dt = 0.05 ", "dt = 0.1 "),
                section("rig:rig"),
            ),
            "found others: state rate: scale: 9.0 in the campaign file, 8.0 in the system; dt: 0.1 in the campaign"
            " file, 0.05 in the system; correct the file",
        ),
        ((SHORT, section("rig:rig")), "expected [task], found none"),
        (("dt = 0.1", SHORT, section("rig:rig")), "expected [states] beside dt"),
        ((PENDULUM, section("rig:rig", noise="much")), "expected a finite number"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_file_with_a_mistake_is_refused_with_what_to_do(folder, monkeypatch, parts, word):
    (folder / "unread.py").write_text("x = 1\ndef (\n", encoding="utf-8")
    unmade = "class Rig:\n    def __init__(self, signals, noise):\n        raise OSError('no port')\n"
    (folder / "unmade.py").write_text(unmade, encoding="utf-8")
    monkeypatch.delitem(sys.modules, "unmade", raising=False)
    written(folder, *parts)
    done = run("run", "rig.toml")
    assert done.exit_code == 2 and word in done.stderr, done.output


@pytest.mark.parametrize(
    ("right", "wrong", "word"),
    [
        ('"angle.kp" = 2.0', '"angle.kp" = 100.0', "expected 0 to"),
        (
            'axes = [["angle", "rate"]]',
            'axes = [["angel", "rate"]]',
            "state in the axes of [controller] 'angel'",
        ),
    ],
)
def test_a_file_with_a_mistake_begins_no_store_and_can_be_corrected(folder, right, wrong, word):
    assert right in PENDULUM
    written(folder, PENDULUM.replace(right, wrong))

    refused = run("ask", "rig.db")

    assert refused.exit_code == 2 and word in refused.stderr
    assert not (folder / "rig.db").exists()
    written(folder, PENDULUM)
    assert run("ask", "rig.db").exit_code == 0


def test_options_that_the_file_has_are_refused_beside_it(folder):
    written(folder, PENDULUM, section("rig:rig"))
    for option in (("--seed", "3"), ("--set", "lags=false"), ("--harsh",)):
        done = run("run", "rig.toml", *option)
        assert done.exit_code == 2 and f"expected {option[0]} in the campaign file" in done.stderr
    assert run("run", "nowhere.toml").exit_code == 2


def test_a_campaign_flown_by_hand_can_be_left_to_a_system(folder):
    written(folder, PENDULUM, section("rig:rig", noise=0.01))
    assert run("ask", "rig.db").exit_code == 0
    done = run("resume", "rig.db")
    assert done.exit_code == 2 and "--experiments N" in done.stderr
    done = run("resume", "rig.db", "--experiments", "1")
    assert done.exit_code == 0 and len(flights("rig.db")) == 1, done.output
