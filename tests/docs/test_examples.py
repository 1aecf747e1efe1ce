"""Every example runs as it stands, in a process and a folder of its own."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

NEEDS = {
    "gymnasium_pendulum": ("gymnasium", "pip install 'twinloop[gymnasium]'"),
    "gymnasium_mujoco": ("mujoco", "pip install 'twinloop[mujoco]'"),
    "rotorpy_vehicle": ("rotorpy", 'pip install --no-deps "rotorpy>=3,<4"'),
    "three_days": ("jinja2", "pip install 'twinloop[store,report]'"),
    "fmu": ("fmpy", "pip install 'twinloop[fmu]'"),
}
"""Packages of others that an example needs; the test set-up brings them."""
COMPILED = ("fmu",)
"""Examples that compile C; what builds the native module has a compiler, and so have the checks."""
DOCS = Path(__file__).parents[2] / "docs"
SHOWN = {"three_days": "three-days.md"}
"""Pages that show, line by line, what an example prints."""
EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))


def test_there_are_examples():
    assert EXAMPLES


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_shows_something(example, tmp_path):
    package, advice = NEEDS.get(example.stem, ("twinloop", ""))
    pytest.importorskip(package, reason=f"needs {advice}")
    if example.stem in COMPILED and shutil.which("cc") is None:
        pytest.skip("needs a C compiler")
    # What a twin of few flights misses is said as it goes, and is no fault of the example.
    expected = "ignore:In free run over the "
    done = subprocess.run(
        [sys.executable, "-W", "error", "-W", expected, str(example)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    if example.stem in SHOWN:
        shown = (DOCS / SHOWN[example.stem]).read_text(encoding="utf-8")
        printed = without_times(done.stdout)
        for line in without_times("".join(re.findall(r"```text\n(.*?)```", shown, re.DOTALL))).splitlines():
            assert line.removesuffix("...").rstrip() in printed, line


def without_times(text):
    """What is printed again, whenever it is."""
    return re.sub(r"20\d\d-\d\d-\d\dT[\d:]+", "TIME", text)
