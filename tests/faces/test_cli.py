"""The command `twinloop`: one JSON object, the same bits, exit codes 0, 1, 2 and 130."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import click
import numpy as np
import pytest

import twinloop
from command import hearing_ctrl_c, invoke, same_but_for_run_info, twinloop_command
from twinloop.faces.cli import main
from twinloop.logs import write_columns

PAPER = ["run", "quadrotor", "--preset", "paper"]
SMALL = [*PAPER, "--generations", "30", "--experiments", "2", "--set", "model_population=40"]

QUICK = [
    "run", "quadrotor", "--noise", "0.001", "--experiments", "2", "--set", "moves=1000", "--set", "generations=0",
    "--set", "lags=false", "--set", "libraries=linear,quadratic", "--set", "evaluations=200", "--set", "passes=1",
    "--set", "committee_size=3", "--set", "tuning_steps=5", "--set", "candidates=8",
]  # fmt: skip
"""The preset `default` with little work."""


@pytest.fixture(scope="module")
def answer():
    """What the small run answers, from a process of its own."""
    done = twinloop_command(*SMALL, "--json")
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_answer_is_exactly_one_json_object(answer):
    result = json.loads(answer)
    assert isinstance(result, dict)
    assert len(result["experiments"]) == 2
    assert [r["iteration"] for r in result["iterations"]] == [0, 1, 2]
    assert result["interrupted"] is False
    assert result["seed"] == 0 and result["system"]["name"] == "quadrotor"
    assert len(result["controller"]["gains"]) == 9
    assert result["run_info"]["versions"]["twinloop"] == twinloop.__version__


def test_every_command_takes_json():
    def verbs(command, context):
        if not isinstance(command, click.Group):
            return {context.command_path: command}
        inside = [command.get_command(context, name) for name in command.list_commands(context)]
        contexts = [click.Context(each, parent=context, info_name=each.name) for each in inside]
        return {k: v for each, of in zip(inside, contexts, strict=True) for k, v in verbs(each, of).items()}

    found = verbs(main, click.Context(main, info_name="twinloop"))
    assert len(found) > 20 and "twinloop bench power" in found
    assert [
        name for name, verb in found.items() if not any("--json" in each.opts for each in verb.params)
    ] == []


def test_the_page_names_every_key_of_the_answer(answer):
    text = (Path(__file__).parents[2] / "docs" / "command-line.md").read_text(encoding="utf-8")
    section = text.partition("## The result as JSON")[2].partition("\n## ")[0]

    def keys(value):
        """Those of a value and of what it holds; options, gains and packages are named elsewhere."""
        inside = value.items() if isinstance(value, dict) else [("", each) for each in value]
        for key, held in inside:
            yield key
            if isinstance(held, dict | list) and key not in ("options", "gains", "versions"):
                yield from keys(held)

    assert {key for key in keys(json.loads(answer)) if key and f"`{key}`" not in section} == set()


def test_the_program_in_the_answer_is_the_twin(answer):
    twin = json.loads(answer)["twin"]
    program = twinloop._core.Program.parse("\n".join(twin["program"]))
    assert program.intron_share == twin["intron_share"]
    assert any(line.startswith("roll[k+1] = ") for line in twin["equations"])


def test_two_runs_give_the_same_answer_but_for_run_info(answer):
    again = invoke(*SMALL, "--json")
    assert again.exit_code == 0
    same_but_for_run_info(answer, again.stdout)


@pytest.mark.parametrize("threads", ["1", "2"])
def test_the_answer_does_not_depend_on_the_threads(answer, threads):
    done = invoke(*SMALL, "--json", "--threads", threads)
    same_but_for_run_info(answer, done.stdout)
    assert json.loads(done.stdout)["run_info"]["threads"] == int(threads)


def test_another_seed_gives_another_answer(answer):
    other = json.loads(invoke(*SMALL, "--json", "--seed", "1").stdout)
    assert other["twin"]["program"] != json.loads(answer)["twin"]["program"]


def test_options_reach_the_campaign():
    changes = [
        "--set", "model_population=20", "--set", "form=increment", "--set", "operations=+,*,sin",
        "--set", "control_quality=true", "--set", "test_population=10", "--test-generations", "2",
        "--gyroscopic", "print", "--noise", "0.001",
    ]  # fmt: skip
    done = invoke(*PAPER, "--generations", "3", "--experiments", "2", "--json", *changes)
    result = json.loads(done.stdout)
    options = result["options"]
    assert (options["model_population"], options["form"]) == (20, "increment")
    assert options["operations"] == ["+", "*", "sin"]
    assert options["control_quality"] is True and options["test_generations"] == 2
    assert (result["system"]["gyroscopic"], result["system"]["noise"]) == ("print", 0.001)
    assert len(result["iterations"][1]["asked"][0]["objectives"]) == 3


def test_a_term_with_a_comma_inside_brackets_is_one_term():
    done = invoke(
        *QUICK, "--set", "seed_terms=max(roll, 0.1), min(roll, max(yaw, 0))", "--experiments", "1", "--json"
    )
    assert json.loads(done.stdout)["options"]["seed_terms"] == ["max(roll, 0.1)", "min(roll, max(yaw, 0))"]


def test_the_result_is_written_where_it_was_asked_for(tmp_path):
    file = tmp_path / "result.json"
    done = invoke(*SMALL, "--json", "--output", str(file))
    assert file.read_text(encoding="utf-8") == done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]


def test_pictures_are_drawn_as_svg_and_png(tmp_path):
    vector, raster = tmp_path / "runs.svg", tmp_path / "runs.png"
    fast = [*PAPER, "--generations", "2", "--experiments", "1"]
    assert invoke(*fast, "--plot", str(vector)).exit_code == 0
    assert invoke(*fast, "--plot", str(raster)).exit_code == 0
    assert ElementTree.parse(vector).getroot().tag.endswith("svg")
    assert "test 0" in vector.read_text(encoding="utf-8")
    assert raster.read_bytes().startswith(b"\x89PNG\r\n")


def test_equal_runs_draw_equal_pictures(tmp_path):
    fast = [*PAPER, "--generations", "2", "--experiments", "1", "--plot"]
    one, two = tmp_path / "one.svg", tmp_path / "two.svg"
    invoke(*fast, str(one))
    invoke(*fast, str(two))
    assert one.read_bytes() == two.read_bytes()


def test_a_person_gets_equations_gains_and_errors():
    done = invoke(*PAPER, "--generations", "2", "--experiments", "1")
    assert done.exit_code == 0
    for words in ("roll[k+1]", "roll.kp", "closed loop"):
        assert words in done.stdout


def test_progress_goes_to_standard_error_alone():
    done = twinloop_command(*PAPER, "--generations", "3", "--experiments", "1", "--json")
    json.loads(done.stdout)
    assert "quadrotor" in done.stderr


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """What the preset `default` answers: standard output, standard error, the picture."""
    picture = tmp_path_factory.mktemp("identified") / "runs.svg"
    done = twinloop_command(*QUICK, "--json", "--plot", str(picture))
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr, picture


def test_the_preset_default_is_what_runs_by_default(identified):
    result = json.loads(identified[0])
    assert (result["preset"], result["goal"], result["quality"]["kind"]) == ("default", "both", "iae")
    assert len(result["experiments"]) == 2 and [r["iteration"] for r in result["iterations"]] == [1, 2]
    assert any(line.startswith("d roll_rate / dt = ") for line in result["twin"]["equations"])
    assert result["iterations"][0]["asked"][0]["flown"] == result["experiments"][1]["measured"]


def test_predictions_stand_beside_what_was_flown(identified):
    flight = json.loads(identified[0])["experiments"][1]
    assert flight["predicted_minus_measured"] == pytest.approx(flight["predicted"] - flight["measured"])
    assert flight["spread"] >= 0.0 and 0.0 < flight["risk"] < 1.0 and flight["why"]


def test_advice_compares_what_is_gained_with_what_can_be_measured(identified):
    advice = json.loads(identified[0])["advice"]
    assert advice["before_test"] == 1 and advice["scatter"] > 0.0
    assert advice["stop"] is (advice["gain"] <= advice["scatter"])


def test_equal_runs_of_default_are_equal_and_say_it_in_words(identified, tmp_path):
    file = tmp_path / "result.json"
    again = invoke(*QUICK, "--output", str(file), "--threads", "1")
    same_but_for_run_info(identified[0], file.read_text(encoding="utf-8"))
    for words in (
        "CONTROLLER TO FLY",
        "predicted − flown",
        "noise of the sensor",
        "ANOTHER EXPERIMENT?",
        "rad s",
    ):
        assert words in again.stdout


def test_progress_of_default_is_plain_lines_where_there_is_no_terminal(identified):
    assert "quadrotor: flying experiment 1 of 2" in identified[1]
    assert "\x1b" not in identified[1]


def test_the_picture_of_default_shows_the_band(identified):
    text = identified[2].read_text(encoding="utf-8")
    assert "90 % band of the twin" in text and "of the readings inside the band" in text


def test_goal_quality_and_the_harsh_vehicle_reach_the_campaign():
    done = invoke(
        *QUICK[:2],
        *QUICK[6:],
        "--experiments",
        "1",
        "--harsh",
        "--goal",
        "model",
        "--quality",
        "ise",
        "--weight",
        "roll=2",
        "--json",
    )
    result = json.loads(done.stdout)
    measure = result["quality"]
    assert (result["goal"], measure["kind"], measure["unit"]) == ("model", "ise", "")
    assert [(each["name"], each["weight"]) for each in measure["counts"]] == [
        ("roll", 2.0),
        ("pitch", 1.0),
        ("yaw", 1.0),
    ]
    assert result["system"]["motor_lag"] == 0.03 and result["system"]["noise"] == 1e-3
    assert result["advice"]["gain"] is None  # nobody was asked for a flight


def test_generations_belong_to_the_preset_paper():
    done = invoke("run", "quadrotor", "--generations", "30")
    assert done.exit_code == 2 and "choose --preset paper" in done.stderr
    other = invoke("run", "quadrotor", "--set", "pages=3")
    assert other.exit_code == 2 and "--preset paper" in other.stderr


def test_help_and_version_are_answers():
    assert "run" in invoke().stdout and "reproduce" in invoke("--help").stdout
    version = invoke("--version")
    assert version.stdout.strip() == f"twinloop {twinloop.__version__}" and version.exit_code == 0


MISUSE = {
    "an unknown verb": ["fly"],
    "an unknown system": ["run", "quadrotr"],
    "no system": ["run"],
    "an unknown option": ["run", "quadrotor", "--generation", "3"],
    "an unknown preset": ["run", "quadrotor", "--preset", "papr"],
    "an unknown goal": ["run", "quadrotor", "--goal", "controll"],
    "an unknown quality": ["run", "quadrotor", "--quality", "itae"],
    "a quality that the paper does not have": [*PAPER, "--quality", "iae"],
    "generations of another preset": ["run", "quadrotor", "--generations", "3"],
    "generations of tests of another preset": ["run", "quadrotor", "--test-generations", "3"],
    "the harsh vehicle with other signs": ["run", "quadrotor", "--harsh", "--gyroscopic", "print"],
    "a setting of another preset": ["run", "quadrotor", "--set", "pages=3"],
    "a setting of default that is unknown": ["run", "quadrotor", "--set", "movez=3"],
    "a setting of default of another type": ["run", "quadrotor", "--set", "lags=perhaps"],
    "an unknown library": ["run", "quadrotor", "--set", "libraries=quartic"],
    "an unknown setting": [*PAPER, "--set", "pagez=3"],
    "a setting without a value": [*PAPER, "--set", "pages"],
    "a setting of another type": [*PAPER, "--set", "pages=three"],
    "a setting that the engine refuses": [*PAPER, "--set", "operations=+,pow"],
    "unknown signs": ["run", "quadrotor", "--gyroscopic", "metric"],
    "no generations": [*PAPER, "--generations", "0"],
    "generations in words": [*PAPER, "--generations", "many"],
    "no experiments": ["run", "quadrotor", "--experiments", "0"],
    "a risk that is none": ["run", "quadrotor", "--max-risk", "2", "--store", "rig.db"],
    "no threads": ["run", "quadrotor", "--threads", "0"],
    "a negative seed": ["run", "quadrotor", "--seed", "-1"],
    "a seed of 65 bits": ["run", "quadrotor", "--seed", str(2**64)],
    "negative noise": ["run", "quadrotor", "--noise", "-1"],
    "noise that is NaN": ["run", "quadrotor", "--noise", "nan"],
    "a result that is no JSON": ["run", "quadrotor", "--output", "result.txt"],
    "a folder that is not there": ["run", "quadrotor", "--output", "nowhere/result.json"],
    "a picture of another kind": ["run", "quadrotor", "--plot", "runs.gif"],
    "an unknown study": ["reproduce", "table9"],
    "no study": ["reproduce"],
    "no runs": ["reproduce", "table2", "--runs", "0"],
    "no generations of a study": ["reproduce", "table2", "--generations", "0"],
    "a negative seed of a study": ["reproduce", "table2", "--seed", "-1"],
    "a picture of a table": ["reproduce", "table2", "--plot", "table2.svg"],
}


@pytest.mark.parametrize("case", MISUSE)
def test_misuse_exits_with_2_and_one_line_that_says_why(tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    done = invoke(*MISUSE[case])
    assert done.exit_code == 2
    assert done.stdout == ""
    assert re.fullmatch(r"twinloop: [^\n]+\n", done.stderr), done.stderr
    assert [*tmp_path.iterdir()] == []


def test_misuse_in_a_process_of_its_own_leaves_no_traceback():
    done = twinloop_command(*PAPER, "--set", "pagez=3")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == "twinloop: Unknown option of the preset 'paper' 'pagez': did you mean 'pages'?\n"


@pytest.mark.parametrize(
    ("failure", "code"),
    [
        (twinloop.SystemFailure("The motor cut out."), 1),
        (OSError(28, "No space left on device"), 1),
        (KeyboardInterrupt(), 130),
    ],
)
def test_a_failure_exits_with_its_code_and_one_line(monkeypatch, failure, code):
    def fail(*arguments, **options):
        raise failure

    monkeypatch.setattr("twinloop.campaign.Campaign.run", fail)
    done = invoke(*PAPER, "--json")
    assert done.exit_code == code and done.stdout == ""
    assert re.fullmatch(r"twinloop: [^\n]+", done.stderr.strip())  # click ends the line of a ^C first


def test_where_no_controller_is_fit_to_fly_it_is_said_and_the_command_exits_with_1(monkeypatch):
    def none(campaign):
        _ = campaign.twin
        raise twinloop.NotAvailable("No controller to fly: every flight tumbled.")

    monkeypatch.setattr("twinloop.campaign.Campaign.best_test", property(none))
    done = invoke(*QUICK, "--experiments", "1")
    assert done.exit_code == 1 and "NO CONTROLLER TO FLY\nevery flight tumbled." in done.stdout
    assert "CONTROLLER TO FLY: TEST" not in done.stdout and "Controller: none to fly" in done.stdout


TINY = [*PAPER, "--generations", "2", "--experiments", "1"]


@pytest.mark.parametrize("encoding", ["ascii", "ascii:strict", "latin-1", "cp1252:strict"])
def test_an_output_that_cannot_print_every_letter_shows_the_result(encoding):
    done = twinloop_command(*TINY, env={**os.environ, "PYTHONIOENCODING": encoding}, errors="replace")
    assert done.returncode == 0 and "Traceback" not in done.stderr
    assert "BEST CONTROLLER FLOWN" in done.stdout and "measured" in done.stdout
    # An output in ASCII gets UTF-8 all the same, others hyphens for what they cannot print.
    assert ("─" in done.stdout) == encoding.startswith("ascii")
    answer = twinloop_command(*TINY, "--json", env={**os.environ, "PYTHONIOENCODING": encoding})
    assert answer.stdout.isascii()
    assert json.loads(answer.stdout)["experiments"][0]["test"] == 0


def closed(*arguments, streams):
    """The command with standard streams closed, as by `2>&-`."""

    def close():
        for stream in streams:
            os.close(stream)

    return subprocess.run(
        [sys.executable, "-m", "twinloop", *arguments], preexec_fn=close, text=True, timeout=120,
        **{name: subprocess.PIPE for name, stream in (("stdout", 1), ("stderr", 2)) if stream not in streams},
    )  # fmt: skip


@pytest.mark.skipif(os.name == "nt", reason="Windows has no way to close a stream of a child")
def test_closed_streams_end_with_the_result_and_its_exit_code(tmp_path):
    silent = closed(*TINY, "--json", streams=[2])
    assert silent.returncode == 0 and len(json.loads(silent.stdout)["experiments"]) == 1
    file = tmp_path / "result.json"
    written = closed(*TINY, "--output", str(file), streams=[1, 2])
    assert written.returncode == 0 and len(json.loads(file.read_text(encoding="utf-8"))["experiments"]) == 1
    assert closed(*PAPER, "--set", "pagez=3", streams=[2]).returncode == 2
    # Nobody flies for a result that nobody can see.
    nowhere = closed(*TINY, streams=[1])
    assert nowhere.returncode == 2 and "pass --output" in nowhere.stderr


def test_a_file_that_a_full_disk_refuses_is_named(monkeypatch, tmp_path):
    def full(*arguments, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    file = tmp_path / "my rig.toml"
    done = invoke("new", str(file))
    assert done.exit_code == 1 and f"No space left on device: {str(file)!r}" in done.stderr
    if Path("/dev/full").exists():
        with pytest.raises(OSError, match="/dev/full"):
            write_columns(Path("/dev/full"), {"t": np.zeros(2)})


def test_a_result_that_cannot_be_written_is_printed(monkeypatch, tmp_path):
    def full(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("twinloop.faces.working.write_whole", full)
    done = invoke(*TINY, "--json", "--output", str(tmp_path / "result.json"))
    assert done.exit_code == 1 and "No space left" in done.stderr
    assert len(json.loads(done.stdout)["experiments"]) == 1


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)])
def test_ctrl_c_and_sigterm_end_with_130_and_the_best_so_far(tmp_path, sent):
    file = tmp_path / "result.json"
    command = [
        sys.executable, "-m", "twinloop", *PAPER, "--json", "--experiments", "2",
        "--generations", "1000000", "--set", "model_population=40", "--threads", "1", "--output", str(file),
    ]  # fmt: skip
    working = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=hearing_ctrl_c,
    )
    try:
        for line in working.stderr:  # until the models are being learnt
            if "generation of models" in line:
                break
        working.send_signal(sent)
        answer, complaint = working.communicate(timeout=60)
    finally:
        working.kill()
    assert working.returncode == 130, complaint
    assert "Traceback" not in complaint
    result = json.loads(answer)
    assert result["interrupted"] is True
    assert len(result["experiments"]) == 1
    assert 0 < result["iterations"][-1]["generations"] < 1_000_000
    assert file.read_text(encoding="utf-8") == answer


HOT_CAMPAIGN = """
dt = 0.1
states.temperature = { unit = "degC", scale = 100.0 }
commands.heater = { unit = "%", bounds = [0.0, 100.0] }
task = { initial_state = [20.0], target_state = [60.0], duration = 3.0 }
system.use = "hot:Hot"
first = { "temperature.kp" = 1.0, "temperature.ki" = 0.0, "temperature.kd" = 0.0 }

[controller]
kind = "pid"
axes = ["temperature"]
gains = { "temperature.kp" = [0.0, 5.0], "temperature.ki" = 0.0, "temperature.kd" = 0.0 }
"""
HOT_RIG = """
import time
from pathlib import Path

import twinloop as tl


class Hot(tl.System):
    def __init__(self, signals):
        self.signals = signals

    def run(self, test):
        try:
            Path("heater").write_text("on")
            time.sleep(30)
        finally:
            print("coming to rest", flush=True)
            time.sleep(0.5)
            Path("heater").write_text("off")
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no terminals that hang up")
@pytest.mark.parametrize("ignored", [False, True])
def test_a_rig_comes_to_rest_where_its_terminal_is_closed_unless_it_is_to_go_on(tmp_path, ignored):
    fcntl, termios = pytest.importorskip("fcntl"), pytest.importorskip("termios")
    (tmp_path / "hot.py").write_text(HOT_RIG)
    (tmp_path / "rig.toml").write_text(HOT_CAMPAIGN)

    def on_its_terminal():
        hearing_ctrl_c()
        signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    ours, its = os.openpty()
    try:
        working = subprocess.Popen(
            [sys.executable, "-m", "twinloop", "run", "rig.toml", "--experiments", "1", "--threads", "1"],
            stdin=its, stdout=its, stderr=its, cwd=tmp_path, start_new_session=True, preexec_fn=on_its_terminal,
        )  # fmt: skip
    finally:
        os.close(its)
    try:
        heater = tmp_path / "heater"
        until = time.monotonic() + 60.0
        while not heater.exists() and working.poll() is None and time.monotonic() < until:
            time.sleep(0.05)
        assert heater.read_text() == "on"
        os.close(ours)
        if ignored:
            time.sleep(1.0)
            assert working.poll() is None and heater.read_text() == "on"
            return
        time.sleep(0.2)
        with contextlib.suppress(ProcessLookupError):
            working.send_signal(signal.SIGHUP)  # the shell sends one of its own
        assert working.wait(timeout=60) == 130
        assert heater.read_text() == "off"
    finally:
        working.kill()
        working.wait()


@pytest.mark.parametrize("finished", [0, 1])
def test_ctrl_c_under_default_shows_the_best_so_far_if_there_is_any(monkeypatch, finished):
    learn, calls = twinloop.campaign.identify_and_plan.learning.identify_runs, []

    def interrupted(*arguments, **how):
        calls.append(1)
        if len(calls) > finished:
            raise KeyboardInterrupt
        return learn(*arguments, **how)

    monkeypatch.setattr("twinloop.campaign.identify_and_plan.learning.identify_runs", interrupted)
    done = invoke(*QUICK, "--json")
    assert done.exit_code == 130
    if not finished:
        assert done.stdout == "" and "Interrupted before there was a result." in done.stderr
        return
    result = json.loads(done.stdout)
    assert result["interrupted"] is True and len(result["experiments"]) == 2
    assert [lesson["tests"] for lesson in result["iterations"]] == [[0]]


def test_a_test_that_is_too_risky_is_not_flown_and_the_command_fails(monkeypatch):
    def refused(self, system, experiments=4, *, timeout=None, max_risk=None):
        plain(self, system, 1)
        raise twinloop.TooRisky(f"Campaign.run: expected at most {max_risk:g}, found 0.4; it waits.")

    plain = twinloop.Campaign.run
    monkeypatch.setattr(twinloop.Campaign, "run", refused)
    small = [
        "--set",
        "moves=1500",
        "--set",
        "generations=0",
        "--set",
        "evaluations=256",
        "--set",
        "lags=false",
    ]
    answer = invoke("run", "quadrotor", "--max-risk", "0.1", "--threads", "1", *small)
    assert answer.exit_code == 1
    assert "twinloop: Campaign.run: expected at most 0.1, found 0.4" in answer.stderr
