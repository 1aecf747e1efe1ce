"""Files that are written whole or not at all, also where the disk is full or the power fails."""

from __future__ import annotations

import os
import secrets
import shutil
from contextlib import suppress
from pathlib import Path

from twinloop.errors import InvalidInput

STORE = b"SQLite format 3\0"
"""How a database of SQLite begins."""


def write_whole(path: Path, contents: str | bytes) -> None:
    """Writes a file; what was there stays until all of the new one is on the disk.

    Args:
        path: of the file; of a link, what it leads to is replaced.
        contents: of it; a text is written in UTF-8.

    Raises:
        OSError: it cannot be written; what was there is still there.
    """
    content = contents.encode("utf-8") if isinstance(contents, str) else contents
    if _is_store(path) and not content.startswith(STORE):
        raise InvalidInput(f"File {path}: expected no database there, found one; name another file.")
    try:
        if path.exists() and not path.is_file():  # a device or a pipe, which must not become a file
            path.write_bytes(content)
        else:
            _replace(path.resolve(), content)
    except OSError as refusal:
        # Of a full disk the system names no file, of a draft one that nobody knows.
        raise OSError(refusal.errno, refusal.strerror, str(path)) from refusal


def _is_store(path: Path) -> bool:
    """Whether there is a database, which has flights in it."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(STORE)) == STORE


def _replace(path: Path, content: bytes) -> None:
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        with draft.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if path.exists():
            with path.open("ab"):  # one that may not be written may not be replaced either
                shutil.copymode(path, draft)
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)
    _keep_names(path.parent)


def _keep_names(folder: Path) -> None:
    """Puts the names in a folder on the disk, too; some systems cannot open folders, and need not."""
    with suppress(OSError):
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)
