"""The command `twinloop`: one JSON object, the same bits, exit codes 0, 1, 2 and 130."""

import json
import os
import re
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest
from click.testing import CliRunner

import twinloop
from twinloop.cli import main

PAPER = ["run", "quadrotor", "--preset", "paper"]
SMALL = [*PAPER, "--generations", "30", "--experiments", "2", "--set", "model_population=40"]


def twinloop_command(*arguments, **how):
    return subprocess.run(
        [sys.executable, "-m", "twinloop", *arguments], capture_output=True, text=True, timeout=120, **how
    )


def invoke(*arguments):
    return CliRunner().invoke(main, list(arguments))


def same_but_for_run_info(a, b):
    a, b = json.loads(a), json.loads(b)
    assert a.pop("run_info") and b.pop("run_info")
    assert a == b
    return a


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
    "an unknown setting": ["run", "quadrotor", "--set", "pagez=3"],
    "a setting without a value": ["run", "quadrotor", "--set", "pages"],
    "a setting of another type": ["run", "quadrotor", "--set", "pages=three"],
    "a setting that the engine refuses": ["run", "quadrotor", "--set", "operations=+,pow"],
    "unknown signs": ["run", "quadrotor", "--gyroscopic", "metric"],
    "no generations": ["run", "quadrotor", "--generations", "0"],
    "generations in words": ["run", "quadrotor", "--generations", "many"],
    "no experiments": ["run", "quadrotor", "--experiments", "0"],
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
    assert done.stderr == "twinloop: Unknown option 'pagez': did you mean 'pages'?\n"


@pytest.mark.parametrize(
    ("failure", "code"),
    [
        (twinloop.SystemFailure("The motor cut out."), 1),
        (OSError(28, "No space left on device"), 1),
        (KeyboardInterrupt(), 130),
    ],
)
def test_a_failure_exits_with_its_code_and_one_line(monkeypatch, failure, code):
    def fail(*arguments):
        raise failure

    monkeypatch.setattr("twinloop.campaign.Campaign.run", fail)
    done = invoke(*PAPER, "--json")
    assert done.exit_code == code and done.stdout == ""
    assert re.fullmatch(r"twinloop: [^\n]+", done.stderr.strip())  # click ends the line of a ^C first


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
def test_ctrl_c_ends_with_130_and_the_best_so_far(tmp_path):
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
        # A shell may have started us with SIGINT ignored, which children inherit.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        for line in working.stderr:  # until the models are being learnt
            if "generation of models" in line:
                break
        working.send_signal(signal.SIGINT)
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
