"""What the documentation says is so: its code runs, its options exist."""

import dataclasses
import re
from pathlib import Path

import pytest

from twinloop.campaign.presets import DefaultOptions, parsed

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [
    "tutorial.md",
    "reproduction.md",
    "sweep.md",
    *sorted(
        p.relative_to(DOCS).as_posix() for room in ("concepts", "default") for p in (DOCS / room).glob("*.md")
    ),
]
"""Pages whose blocks of Python are run; those that only include an example are tested as examples."""


def blocks(page):
    found = re.findall(
        r"^```python\n(.*?)^```", (DOCS / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    return [block for block in found if "--8<--" not in block]


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)])
def test_the_code_of_a_page_runs_from_top_to_bottom(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {}
    for number, block in enumerate(blocks(page)):
        exec(compile(block, f"{page}, block {number}", "exec"), names)


@pytest.mark.parametrize("page", sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")))
def test_a_page_is_plain_markdown_that_every_reader_shows(page):
    text = re.sub(
        r"^```.*?^```", "", (DOCS / page).read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL
    )
    assert not re.search(r"^ *(!!!|\?\?\?\+?|===) ", text, re.MULTILINE)


def test_every_option_that_an_ablation_names_exists():
    text = (DOCS / "options.md").read_text(encoding="utf-8")
    changes = re.findall(r"[`\s]([a-z_]+)=([a-z0-9,.]*)[`\s,]", text)
    assert len(changes) > 10
    for name, value in set(changes) - {("name", "value")}:
        parsed("default", name, value)


def test_every_option_of_default_is_described_where_the_table_is_made_from():
    described = "".join(base.__doc__ or "" for base in DefaultOptions.__mro__)
    for field in dataclasses.fields(DefaultOptions):
        assert re.search(rf"^ +{field.name}: ", described, re.MULTILINE), field.name
