"""What the first pages show of a result is what the tutorial's command prints, line by line."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from twinloop.faces.cli import main

ROOT = Path(__file__).parents[2]
COMMAND = "twinloop run quadrotor --experiments 4 --noise 0.001 --seed 0 --plot demo.svg"
SHOWN = {
    "README.md": ("quadrotor, preset default", "## The loop, from Python"),
    "docs/tutorial.md": ("## Read the result", "## Plot it"),
}
"""Where the lines of a result begin and end on each page."""


@pytest.fixture(scope="module")
def printed():
    """The lines that the command prints."""
    done = CliRunner().invoke(main, COMMAND.partition(" --plot")[0].split()[1:])
    assert done.exit_code == 0, done.output
    return {line.rstrip() for line in done.stdout.splitlines()}


@pytest.mark.parametrize("page", SHOWN)
def test_each_line_of_a_result_is_printed_by_the_command(page, printed):
    text = (ROOT / page).read_text(encoding="utf-8")
    begin, end = (text.index(mark) for mark in SHOWN[page])
    fence = text.rindex("```\n", 0, begin) if page == "README.md" else begin
    blocks = re.findall(r"^```\n(.*?)^```", text[fence:end], re.MULTILINE | re.DOTALL)
    shown = [line.rstrip() for line in "".join(blocks).splitlines() if line and line != "..."]
    assert len(shown) > 30
    assert [line for line in shown if line not in printed] == []


def test_the_command_is_that_of_the_tutorial():
    assert f"```\n{COMMAND}\n```" in (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
