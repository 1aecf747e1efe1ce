"""Pictures of the documentation: each is shown, and made by commands that stand in the text."""

import importlib.util
import re
import struct
from pathlib import Path

ROOT = Path(__file__).parents[2]
TEXTS = {
    file.name: file.read_text(encoding="utf-8")
    for file in [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
}


def script():
    found = importlib.util.spec_from_file_location("pictures", ROOT / "scripts" / "pictures.py")
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_every_picture_is_shown_and_there():
    shown = {
        Path(name).name for text in TEXTS.values() for name in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", text)
    }
    kept = {file.name for file in (ROOT / "docs" / "pictures").iterdir() if file.suffix != ".json"}
    assert shown == kept


def test_pictures_are_of_pages_that_commands_of_the_text_make():
    made, everything = script(), "\n".join(TEXTS.values())
    for command in made.COMMANDS:
        assert f"twinloop {command}" in everything, command
    for name, (_, width, height) in made.PAGES.items():
        head = (ROOT / "docs" / "pictures" / f"{name}.png").read_bytes()[:24]
        assert struct.unpack(">II", head[16:24]) == (width, height), name
