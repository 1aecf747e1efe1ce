"""Which version of the code measures: that of the package, and the commit of the repository that it stands in."""

from __future__ import annotations

import subprocess
from importlib import metadata
from pathlib import Path

WHAT_DECIDES = ("crates", "python", "studies")
"""Folders whose changes make another version."""


def version() -> str:
    """Such as "0.1.0 at 8f36b7c", "0.1.0 at 8f36b7c with changes", or "0.1.0" outside a repository."""
    released, here = metadata.version("twinloop"), Path(__file__).resolve().parents[2]
    commit = _git(here, "rev-parse", "--short=7", "HEAD")
    if commit is None:
        return released
    changed = _git(here, "status", "--porcelain", "--", *WHAT_DECIDES)
    return f"{released} at {commit}" + (" with changes" if changed else "")


def _git(folder: Path, *words: str) -> str | None:
    try:
        said = subprocess.run(["git", "-C", str(folder), *words], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return said.stdout.strip()
