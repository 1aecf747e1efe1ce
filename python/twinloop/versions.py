"""Versions of what results come from: Twinloop, Python, and what is loaded beside them."""

from __future__ import annotations

import platform
import sys
from contextlib import suppress
from importlib import metadata

import numpy as np

from twinloop import _core

BESIDE = (
    "sqlalchemy", "alembic", "psycopg", "scipy", "gymnasium", "mujoco", "rotorpy", "fmpy", "control", "distributed"
)  # fmt: skip
"""Packages that keep a campaign, fly its system or spread its work, where they are loaded."""


def versions() -> dict[str, str]:
    """Version by name; of a package that is not loaded nothing can come."""
    found = {
        "twinloop": _core.__version__,
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
