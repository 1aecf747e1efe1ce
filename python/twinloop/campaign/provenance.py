"""Provenance: what results may be traced back to, and the command that made them as a person would type it."""

from __future__ import annotations

import platform
import sys
from collections.abc import Sequence
from pathlib import Path

from twinloop import _core
from twinloop._ground.texts import whole_characters
from twinloop._ground.versions import versions
from twinloop.records import Record
from twinloop.store import shown_name


def provenance(threads: int) -> Record:
    """What results may be traced back to: versions and processor.

    Args:
        threads: of the engine.
    """
    return {
        "threads": threads,
        "machine": platform.machine(),
        "processor": _processor(),
        "vectors": _core.vector_widths(),
        "system": platform.platform(),
        "command": command_line(),
        "versions": versions(),
    }


def command_line() -> list[str]:
    """The command of this process as a person would type it, without passwords and tokens."""
    return [whole_characters(shown_name(word)) for word in without_tokens(as_typed(sys.argv))]


def without_tokens(words: Sequence[str]) -> list[str]:
    """A command of which nobody reads what opens its dashboard.

    Args:
        words: of it.
    """
    before = ["", *words]
    return [
        "***" if last == "--token" else "--token=***" if word.startswith("--token=") else word
        for last, word in zip(before, words, strict=False)
    ]


def as_typed(words: Sequence[str]) -> list[str]:
    """A command as a person would type it: the programme without the folders of this machine.

    Args:
        words: as a process gets them, the programme first; or as this function gave them.

    Returns:
        "twinloop" and its words; of a script "python", its name and its words.
    """
    path, *rest = words or [""]
    if path == "python":
        return list(words)
    name = Path(path).name
    if name == "__main__.py":
        module = Path(path).parent.name
        return [module, *rest] if module == "twinloop" else ["python", "-m", module, *rest]
    if Path(path).stem == "twinloop":
        return ["twinloop", *rest]
    return ["python", *([name] if name else []), *rest]


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
