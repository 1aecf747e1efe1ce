"""Who writes a campaign: a lock of the operating system or of the database, which the death of its holder ends."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path
from typing import IO, Any, Protocol

from twinloop.errors import StoreFailure


class Lock(Protocol):
    """Held from when it was made until it is released, or its process ends."""

    def release(self) -> None:
        """Lets others write."""
        ...


class FileLock:
    """A lock on a file beside a database of SQLite.

    The lock is the operating system's, not the file's existence: however its holder dies, it is free at once.

    Args:
        path: of the file; it is removed when the lock is released.
        what: that is locked, for the error.

    Raises:
        StoreFailure: somebody else holds it.
    """

    def __init__(self, path: Path, what: str) -> None:
        self.path = path
        while True:
            self._file = _opened(path)
            if not _locked(self._file):
                self._file.seek(0)
                holder = self._file.read(100).strip() or "another one"
                self._file.close()
                raise taken(what, holder)
            # Who held it before may have removed the file that was opened here.
            with contextlib.suppress(FileNotFoundError):
                if _is(self._file, path):
                    break
            self._file.close()
        self._file.seek(0)
        self._file.truncate()
        self._file.write(f"process {os.getpid()}")
        self._file.flush()

    def release(self) -> None:
        """Lets others write."""
        if not self._file.closed:
            with contextlib.suppress(OSError):
                self.path.unlink()
            self._file.close()


class AdvisoryLock:
    """A lock of a PostgreSQL server, on a connection of its own: it ends with that, which its holder may not notice.

    Args:
        connection: to the server.
        number: of the campaign.
        what: that is locked, for the error.

    Raises:
        StoreFailure: somebody else holds it.
    """

    KEY = 0x7717_1009
    """Tells our locks from those of others on the same server."""

    def __init__(self, connection: Any, number: int, what: str) -> None:
        from sqlalchemy import text

        self._connection, self._key = connection, {"key": self.KEY, "number": number}
        asked = text("select pg_try_advisory_lock(:key, :number)")
        if not connection.execute(asked, self._key).scalar():
            connection.close()
            raise taken(what, "another one")
        connection.commit()

    def release(self) -> None:
        """Lets others write."""
        from sqlalchemy import text
        from sqlalchemy.exc import SQLAlchemyError

        # The server notices the end of a connection in its own time. Where it has ended before, so has the lock.
        with contextlib.suppress(SQLAlchemyError):
            self._connection.execute(text("select pg_advisory_unlock(:key, :number)"), self._key)
        # Closed for good: a pool would keep the connection.
        self._connection.invalidate()
        self._connection.close()


def taken(what: str, holder: str) -> StoreFailure:
    """The error for a campaign that somebody else writes."""
    return StoreFailure(
        f"Store: expected to be the only one who writes {what}, found {holder} that does; end that one first, or only"
        " look: twinloop show, read_only=True in Python."
    )


def _opened(path: Path) -> IO[str]:
    """A file of a lock, made where there is none; no link, which would lead to a file of somebody's own."""
    try:
        found = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
    except OSError as reason:
        if not path.is_symlink():
            raise
        raise StoreFailure(
            f"Store: expected {path} to be a file of Twinloop's own, found a link to another one; remove the link."
        ) from reason
    return os.fdopen(found, "r+", encoding="utf-8")


def _is(file: IO[str], path: Path) -> bool:
    found, there = os.fstat(file.fileno()), path.lstat()
    return (found.st_dev, found.st_ino) == (there.st_dev, there.st_ino)


if sys.platform == "win32":
    import msvcrt

    def _locked(file: IO[str]) -> bool:
        file.seek(1000)  # behind the words, which others may read
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
else:
    import fcntl

    def _locked(file: IO[str]) -> bool:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True
