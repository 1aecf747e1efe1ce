"""Files that a command will write: refused before any work is done."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from twinloop.errors import InvalidInput
from twinloop.faces.plots import SUFFIXES, require


def check_writable(path: Path, suffixes: Sequence[str]) -> None:
    """Refuses a file that could not be written.

    Args:
        path: of the file.
        suffixes: that it may have, such as [".json"].

    Raises:
        InvalidInput: another suffix, no such folder, or no right to write there.
    """
    if path.suffix.lower() not in suffixes:
        raise InvalidInput(
            f"File {str(path)!r}: expected it to end in {' or '.join(suffixes)}; change its name."
        )
    if path.is_dir():
        raise InvalidInput(f"File {str(path)!r}: expected a file, found a folder; name a file in it.")
    if not path.parent.is_dir():
        raise InvalidInput(
            f"File {str(path)!r}: expected an existing folder, found none; make {str(path.parent)!r} first."
        )
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
        if path.exists():
            with path.open("a"):
                pass
    except OSError as refusal:
        raise InvalidInput(
            f"File {str(path)!r}: expected to be allowed to write it, found {refusal.strerror}; choose"
            " another place."
        ) from refusal


def check_picture(path: Path) -> None:
    """Refuses a picture that could not be drawn or written.

    Args:
        path: of the picture.

    Raises:
        InvalidInput: as for `check_writable`.
        NotAvailable: matplotlib is missing.
    """
    check_writable(path, SUFFIXES)
    require()
