"""Ctrl-C while the package is being imported: quiet in the command, and a KeyboardInterrupt everywhere else."""

import os
import signal
import subprocess
import sys

import pytest

from command import hearing_ctrl_c

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
SLOW = "import time\nprint('loading', flush=True)\ntime.sleep(60)\n"
COMMAND = "from twinloop.faces.cli import main\nmain()\n"


@pytest.fixture
def interrupted(tmp_path):
    """How a process ends that hears Ctrl-C while it imports a package, which takes long here."""

    def run(package, *words):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text(SLOW)
        path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
        process = subprocess.Popen(
            [sys.executable, *map(str, words)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=hearing_ctrl_c,
            env={**os.environ, "PYTHONPATH": path},
        )  # fmt: skip
        assert process.stdout.readline() == "loading\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
        return process.returncode, said

    return run


QUIET = (130, "twinloop: Interrupted before there was a result.\n")


@pytest.mark.parametrize("package", ["numpy", "click"])
def test_the_command_ends_with_a_sentence_and_130(interrupted, package):
    assert interrupted(package, "-m", "twinloop", "--version") == QUIET


def test_so_it_does_by_the_name_that_is_installed(interrupted, tmp_path):
    script = tmp_path / "bin" / "twinloop"
    script.parent.mkdir()
    script.write_text(COMMAND)
    assert interrupted("numpy", script, "show", "rig.db") == QUIET


@pytest.mark.parametrize("words", [["script.py", "twinloop"], ["-c", "import twinloop", "twinloop"]])
def test_a_script_hears_ctrl_c_itself(interrupted, words, tmp_path):
    script = tmp_path / "script.py"
    script.write_text("import twinloop\n")
    code, said = interrupted("numpy", *[script if word == "script.py" else word for word in words])
    assert code == -signal.SIGINT and "KeyboardInterrupt" in said
