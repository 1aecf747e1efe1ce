"""What ARCHITECTURE.md counts is there to be counted."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONTROLLERS = ROOT / "crates" / "twinloop-core" / "src" / "controller"


def code():
    for folder in (*ROOT.glob("crates/*/src"), ROOT / "python" / "twinloop"):
        yield from (path for path in folder.rglob("*") if path.suffix in (".rs", ".py", ".pyi"))


@pytest.mark.parametrize("room", ["campaign", "identification", "planning"])
def test_every_module_of_the_rooms_that_learn_and_plan_is_named(room):
    guide = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    parts = (ROOT / "python" / "twinloop" / room).rglob("*.py")
    named = set(re.findall(r"\w+", " ".join(re.findall(r"`[^`]+`", guide))))
    unnamed = {path.stem for path in parts} - named
    assert unnamed <= {"__init__"}


def test_a_new_law_of_control_changes_as_many_files_as_are_counted():
    guide = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    guide = guide[guide.index("- **controller**: ") : guide.index("- **quality of flights**: ")]
    # Files that know two laws must learn of a third one; those of a single law are its own, one of each language.
    laws = re.compile(r"state_?feedback", re.IGNORECASE), re.compile(r"\bpid\b", re.IGNORECASE)
    own = CONTROLLERS / "state_feedback.rs"  # compares itself with a PID
    knowing = {
        path for path in code() if path != own and all(law.search(path.read_text("utf-8")) for law in laws)
    }
    files, of_its_own, places = map(
        int, re.search(r"changes (\d+) files, (\d+) of them .* (\d+) places", guide).groups()
    )
    assert len(knowing) + of_its_own == files
    for path in knowing:
        assert "/".join(path.parts[-2:]) in guide or f"`{path.name}`" in guide, path
    assert len(
        re.findall(r"state_?feedback", (CONTROLLERS / "mod.rs").read_text("utf-8"), re.IGNORECASE)
    ) == (
        places + 1  # one line names the module and the law
    )
