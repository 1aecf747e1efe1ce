"""What a user's own code raised, and where, in a few words: for people who read a sentence and no traceback."""

from __future__ import annotations

import sysconfig
from pathlib import Path
from traceback import extract_tb, walk_tb
from types import CodeType

OURS = Path(__file__).parents[1]
"""The package, whose own lines tell a user nothing about theirs."""


def raised(reason: BaseException) -> str:
    """The kind of an exception, the file and line of the user's that it came from, and its text.

    Args:
        reason: that was caught.

    Returns:
        Such as "ValueError in rig.py, line 7: no port". Without a place where only installed code is involved, and
        where the text has it already, as that of a syntax error.
    """
    lines = [frame for frame in extract_tb(reason.__traceback__) if _users_own(frame.filename)]
    place = f" in {Path(lines[-1].filename).name}, line {lines[-1].lineno}" if lines else ""
    text = " ".join(str(reason).split())
    return f"{type(reason).__name__}{place}{': ' if text else ''}{text}"


def came_through(reason: BaseException, code: CodeType) -> bool:
    """Whether an exception came out of a call of a function, or of something that it called.

    Args:
        reason: that was caught.
        code: of the function.
    """
    return any(frame.f_code is code for frame, _ in walk_tb(reason.__traceback__))


def _users_own(file: str) -> bool:
    """Whether a file is neither ours nor installed."""
    installed = (
        OURS,
        *(Path(sysconfig.get_path(kind)) for kind in ("stdlib", "purelib", "platlib", "scripts")),
    )
    return not file.startswith("<") and not any(
        folder in Path(file).resolve().parents for folder in installed
    )
