"""Exported C as a shared library of this machine."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from twinloop.errors import NotAvailable

STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off")
"""Without contraction, the numbers are those of the engine."""


def compiled(
    what: str,
    folder: Path,
    sources: Sequence[str],
    library: str,
    flags: Sequence[str] = (),
    otherwise: str = "pass --force (force=True in Python)",
) -> Path:
    """Compiles C99 without warnings.

    Args:
        what: is exported.
        folder: where the sources are, and the library shall be.
        sources: names of the files.
        library: name of the file.
        flags: of the compiler, beside strict ones.
        otherwise: what to do without a compiler.

    Returns:
        The library.

    Raises:
        NotAvailable: no C compiler, or it refuses.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        raise NotAvailable(
            f"Export, {what}: expected a C compiler called cc, found none; install one, or {otherwise}."
        )
    done = subprocess.run(
        [compiler, *STRICT, *flags, "-shared", "-fPIC", "-o", library, *sources, "-lm"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise NotAvailable(f"Export, {what}: expected that it compiles, found {done.stderr[:300]!r}.")
    return folder / library
