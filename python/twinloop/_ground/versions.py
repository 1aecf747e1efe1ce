"""Versions of what results come from: Twinloop with its commit, Python, and what is loaded beside them."""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np

from twinloop import _core

BESIDE = (
    "sqlalchemy", "alembic", "psycopg", "scipy", "gymnasium", "mujoco", "rotorpy", "fmpy", "control", "distributed"
)  # fmt: skip
"""Packages that keep a campaign, fly its system or spread its work, where they are loaded."""
WHAT_DECIDES = ("crates", "python")
"""Folders of a checkout on which results depend."""


def versions() -> dict[str, str]:
    """Version by name; of a package that is not loaded nothing can come."""
    at = commit()
    found = {
        "twinloop": _core.__version__,
        **({} if at is None else {"commit": at}),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
    for name in BESIDE:
        if name in sys.modules:
            with suppress(metadata.PackageNotFoundError):
                found[name] = metadata.version(name)
    if "sqlite3" in sys.modules:
        found["sqlite"] = sys.modules["sqlite3"].sqlite_version
    return found


@cache
def commit(decide: Sequence[str] = WHAT_DECIDES) -> str | None:
    """The commit of the checkout that the package is loaded from, such as "8f36b7c" or "8f36b7c with changes".

    Args:
        decide: folders of it whose changes make another version.

    Returns:
        None where it is no checkout, or Git is missing.
    """
    top = Path(__file__).resolve().parents[3]
    found = _git(top, "rev-parse", "--short=7", "HEAD") if (top / ".git").exists() else None
    if found is None:
        return None
    return found + (" with changes" if _git(top, "status", "--porcelain", "--", *decide) else "")


def _git(folder: Path, *words: str) -> str | None:
    try:
        said = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, check=True, timeout=10.0
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return said.stdout.strip()
