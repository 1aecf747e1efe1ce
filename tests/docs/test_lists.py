"""What a page lists is all that there is, and what it quotes is what is said."""

import re
from pathlib import Path

import pytest

import twinloop
from twinloop.campaign.campaign_file import SECTIONS
from twinloop.faces.dashboard.desk import LOST, in_words
from twinloop.store import Doing
from twinloop.store.schema import metadata
from twinloop_exam.command import bench

DOCS = Path(__file__).parents[2] / "docs"


def section(page, heading):
    text = (DOCS / page).read_text("utf-8").partition(f"## {heading}\n")[2]
    assert text
    return re.split(r"^#+ ", text, maxsplit=1, flags=re.MULTILINE)[0]


def test_every_section_of_a_campaign_file_is_in_its_table():
    listed = re.findall(r"^\| `\[?(\w+)", section("by-hand.md", "The campaign file"), re.MULTILINE)
    assert sorted(listed) == sorted(SECTIONS)


@pytest.mark.parametrize("study", ["power", "zoo"])
def test_every_option_of_a_study_is_in_its_table(study):
    verb = bench.commands[study]
    options = {name for option in verb.params for name in option.opts if name.startswith("--")}
    listed = re.findall(
        r"^\| `(--[\w-]+)", section("command-line.md", f"`twinloop bench {study}`"), re.MULTILINE
    )
    assert set(listed) == options


def test_every_table_of_a_store_is_listed_with_its_columns():
    listed = {}
    for names, columns in re.findall(
        r"^\| (`\w+`(?:, `\w+`)*) \|[^|]*\| (.*) \|$", section("concepts/store.md", "Tables"), re.MULTILINE
    ):
        for name in re.findall(r"`(\w+)`", names):
            listed[name] = set(re.findall(r"`(\w+)`", columns))
    kept = {
        table.name: {column.name for column in table.columns} - {"id", "campaign", "number"}
        for table in metadata.sorted_tables
    }
    assert listed == kept


def test_every_code_of_a_remark_is_explained():
    package = Path(twinloop.__file__).parent
    source = "\n".join(path.read_text("utf-8") for path in package.rglob("*.py"))
    # What makes a remark is `note`, `serious`, one of both, or what was chosen of both before.
    made = r"(?:\b(?:note|serious|say)|else note\))\(\s*(?:\"([a-z-]+)\"|([A-Z_]+),)"
    codes = {
        code or re.search(rf'^{name} = "([a-z-]+)"', source, re.MULTILINE)[1]
        for code, name in re.findall(made, source)
    }
    tables = (DOCS / "remarks.md").read_text("utf-8") + section(
        "command-line.md", "`twinloop check LOG FILE.toml`"
    )
    listed = {
        code
        for row in re.findall(r"^\| (`[^|]*) \|", tables, re.MULTILINE)
        for code in re.findall(r"`([\w-]+)`", row)
    }
    assert len(codes) > 50 and codes <= listed
    assert not listed - codes - {"commands-late", "commands-early"}


def test_the_page_on_the_dashboard_quotes_what_is_said_of_a_writer_that_was_killed():
    said = in_words(Doing("terms", 1, 2, told=1, experiments=2, left=None, silent=LOST + 1.0))
    text = " ".join((DOCS / "dashboard.md").read_text("utf-8").split())
    quoted = re.search(r'after two minutes "(.*?)…(.*?)"', text)
    assert quoted is not None and LOST == 120.0 and all(words in said for words in quoted.groups())
