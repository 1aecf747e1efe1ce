"""A database of campaigns: opened, checked, brought up to date; its failures are sentences."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twinloop.errors import InvalidInput, NotAvailable, StoreFailure, TwinloopError
from twinloop.store.address import is_address, shown_name

if TYPE_CHECKING:
    from sqlalchemy import Connection, Engine

BUSY_SECONDS = 30.0
"""How long a transaction waits for another one; each takes milliseconds."""

SMALLEST_ROOM = 1 << 16
"""Bytes on a disk below which it counts as full: the index of a log takes half of that."""
ROOM = ("room on the disk", "free some, then do the same again")
RIGHT = (
    "the right to write",
    "give it for the file and its folder, or only read it: twinloop show, read_only=True in Python",
)
REFUSALS = (
    (ROOM[0], *ROOM),
    ("full", *ROOM),
    ("no space", *ROOM),
    ("readonly", *RIGHT),
    ("read-only", *RIGHT),
    ("locked", "a turn to write", "end the program that holds the database, then do the same again"),
    ("unable to open", "the right to open it", "give it for the file and its folder"),
)
"""Words of a database's refusal, what it misses, and what helps."""


class Store:
    """An open database whose tables are those of this version.

    Args:
        engine: of SQLAlchemy.
        name: of the file, or the address without its passwords, for errors.
        path: of the file; None for a server.
        read_only: whether nothing is written.
    """

    def __init__(self, engine: Engine, name: str, path: Path | None, read_only: bool) -> None:
        self.engine = engine
        self.name = name
        self.path = path
        self.read_only = read_only

    @contextmanager
    def transaction(self) -> Iterator[Connection]:
        """All of what is done in it is kept, or nothing.

        Yields:
            A connection.

        Raises:
            StoreFailure: the database refuses.
        """
        with self.sentences(), self.engine.begin() as connection:
            yield connection

    @contextmanager
    def snapshot(self) -> Iterator[Connection]:
        """All that is read in it is of one moment, whatever others write meanwhile.

        A file shows so much in any transaction. A server shows each statement what was written by then, if it is not
        asked for more: of an experiment that is told between two of them it would show the run without its test.

        Yields:
            A connection.

        Raises:
            StoreFailure: the database refuses.
        """
        if self.path is not None:
            with self.transaction() as connection:
                yield connection
            return
        with self.sentences(), self.engine.connect() as connection:
            alike = connection.execution_options(isolation_level="REPEATABLE READ")
            with alike.begin():
                yield alike

    @contextmanager
    def sentences(self) -> Iterator[None]:
        """Tells failures of the database as what they mean to a person."""
        from sqlalchemy.exc import SQLAlchemyError

        try:
            yield
        except TwinloopError:
            raise
        except (SQLAlchemyError, OSError, OverflowError) as failure:  # the last: of a number beyond 64 bits
            raise said(self.name, failure) from failure

    def close(self) -> None:
        """Closes all connections."""
        self.engine.dispose()


def opened(where: str | Path, *, create: bool = False, read_only: bool = False) -> Store:
    """Opens a store; an older one is brought up to date, unless it is only read.

    Args:
        where: a file of SQLite, or the address of a server such as "postgresql+psycopg://user@host/database".
        create: whether one is made where there is none.
        read_only: whether nothing will be written.

    Returns:
        The store.

    Raises:
        InvalidInput: no store, a newer one, or a database of something else.
        NotAvailable: SQLAlchemy, Alembic or the driver of the server is not installed.
        StoreFailure: the database cannot be read or written.
    """
    require()
    from sqlalchemy.exc import SQLAlchemyError

    text = str(where)
    path = None if is_address(text) else Path(where).expanduser()
    if path is not None:
        _check_file(path, create)
    store = _connected(text, path, read_only)
    try:
        with store.sentences():
            if path is not None and not read_only:
                _check_whole(store)
            _bring_up_to_date(store, create)
    except TwinloopError as refusal:
        store.close()
        if read_only and path is not None and isinstance(refusal.__cause__, SQLAlchemyError):
            return _from_still_medium(path, refusal)
        raise
    return store


def require() -> None:
    """Refuses to work without the packages of the extra `store`.

    Raises:
        NotAvailable: one is missing.
    """
    # Alembic takes most of a second to import, and only a store that is made or brought up to date needs it.
    for name in ("sqlalchemy", "alembic"):
        if find_spec(name) is None:
            raise NotAvailable(
                f"Store: expected the packages sqlalchemy and alembic, found that {name} is missing; install them with:"
                " pip install 'twinloop[store]'."
            )


def said(name: str, failure: Exception) -> TwinloopError:
    """A failure of the database in a sentence.

    Args:
        name: of the store.
        failure: as SQLAlchemy or the system has raised it.

    Returns:
        What to raise.
    """
    reason = str(getattr(failure, "orig", None) or failure).split("\n")[0]
    low = reason.lower()
    if "disk i/o error" in low and _is_full(name):
        # On a full disk SQLite has no room for the index of its log, and says no more than that.
        low = ROOM[0]
    if "not a database" in low or "malformed" in low or "encrypted" in low:
        return InvalidInput(
            f"Store {name}: expected a database of Twinloop, found a file that is damaged or none at all ({reason});"
            " nothing was changed in it: use another file, or an earlier copy."
        )
    for words, what, advice in REFUSALS:
        if words in low:
            return StoreFailure(
                f"Store {name}: expected {what}, found none ({reason}); nothing is lost: {advice}."
            )
    return StoreFailure(
        f"Store {name}: expected an answer of the database, found: {reason}; no stored data is lost: correct that, then"
        " repeat the command."
    )


def _is_full(name: str) -> bool:
    try:
        return shutil.disk_usage(Path(name).parent).free < SMALLEST_ROOM
    except (OSError, ValueError):
        return False


def _check_file(path: Path, create: bool) -> None:
    if path.is_dir():
        raise InvalidInput(f"Store {path}: expected a file, found a folder; name a file in it.")
    if path.suffix == ".toml":
        raise InvalidInput(
            f"Store {path}: expected a store, found the name of a campaign file; name its store, by default"
            f" {path.with_suffix('.db')}."
        )
    if not path.parent.is_dir():
        raise InvalidInput(
            f"Store {path}: expected an existing folder, found none; make {path.parent} first."
        )
    if not create and not path.exists():
        raise InvalidInput(f"Store {path}: expected a store, found no such file; check its name.")


def _connected(text: str, path: Path | None, read_only: bool, immutable: bool = False) -> Store:
    from sqlalchemy import URL, create_engine, event, make_url
    from sqlalchemy.exc import ArgumentError, NoSuchModuleError

    if path is None:
        name = shown_name(text)
        try:
            url = make_url(text)
            engine = create_engine(url)
        except (ArgumentError, NoSuchModuleError, ValueError) as reason:
            # What others say of an address may quote it, with its password.
            why = f": {reason}" if isinstance(reason, NoSuchModuleError) else ""
            raise InvalidInput(
                f"Store {name}: expected a file or an address such as postgresql+psycopg://user@host/database, found"
                f" none{why}; correct it."
            ) from None
        except ModuleNotFoundError as missing:
            raise NotAvailable(
                f"Store: expected the driver of the server, found that {missing.name} is missing; for PostgreSQL,"
                " install it with: pip install 'twinloop[postgresql]'."
            ) from missing
        if "@" in (url.host or ""):
            raise InvalidInput(
                f"Store {name}: expected one @, before the host, found several; write one in a password as %40."
            )
        return Store(engine, name, None, read_only)
    if read_only:
        query = {"uri": "true", "mode": "ro", **({"immutable": "1"} if immutable else {})}
        url = URL.create("sqlite", database=path.resolve().as_uri().replace("file://", "file:"), query=query)
    else:
        url = URL.create("sqlite", database=str(path))
    engine = create_engine(url)

    @event.listens_for(engine, "connect")
    def _prepare(connection: Any, _: object) -> None:
        # Transactions are ours: the driver's own begin too late.
        connection.isolation_level = None
        cursor = connection.cursor()
        cursor.execute(f"PRAGMA busy_timeout = {int(1000 * BUSY_SECONDS)}")
        if not read_only:
            cursor.execute("PRAGMA journal_mode = WAL")
            cursor.execute("PRAGMA synchronous = FULL")
            cursor.execute("PRAGMA foreign_keys = ON")
        cursor.close()

    @event.listens_for(engine, "begin")
    def _begin(connection: Any) -> None:
        connection.exec_driver_sql("BEGIN" if read_only else "BEGIN IMMEDIATE")

    return Store(engine, str(path), path, read_only)


def _check_whole(store: Store, check: str = "quick_check") -> None:
    """Refuses a file that SQLite finds damaged; `integrity_check` also compares each table with its indices."""
    with store.engine.connect() as connection:
        answer = connection.exec_driver_sql(f"PRAGMA {check}(1)").scalar()
    if answer != "ok":
        raise InvalidInput(
            f"Store {store.name}: expected a whole database, found a damaged one ({str(answer)[:100]}); nothing"
            " was changed in it: use an earlier copy."
        )


def _from_still_medium(path: Path, refusal: TwinloopError) -> Store:
    """A store where not even SQLite's own marks can be made, such as on a mounted image; else the refusal again.

    What is opened as immutable is read without its log of commits, and while others may write it.
    """
    if "locked" in str(refusal.__cause__):
        raise refusal
    log = path.resolve().with_name(f"{path.resolve().name}-wal")
    if log.exists() and log.stat().st_size > 0:
        raise StoreFailure(
            f"Store {path}: expected the right to write in its folder, which reading the commits of {log.name} needs,"
            " found none; nothing is lost: give that right, or copy both files into a folder of yours and read them"
            " there."
        ) from refusal
    store = _connected(str(path), path, read_only=True, immutable=True)
    try:
        with store.sentences():
            _bring_up_to_date(store, create=False)
    except TwinloopError:
        store.close()
        raise refusal from None
    return store


def _bring_up_to_date(store: Store, create: bool) -> None:
    from sqlalchemy import inspect, text

    from twinloop.store.schema import REVISION

    with store.engine.connect() as connection:
        if store.path is not None:
            others = connection.execute(
                text("select name from sqlite_master where type in ('trigger', 'view')")
            )
            if foreign := sorted(others.scalars()):
                raise InvalidInput(
                    f"Store {store.name}: expected tables alone, found {', '.join(foreign[:5])}; a trigger or a view"
                    " would change what is written, and Twinloop makes none: use a store that nobody has changed."
                )
        tables = set(inspect(connection).get_table_names())
        ours = {"alembic_version", "campaigns", "experiments"} <= tables
        found = connection.execute(text("select version_num from alembic_version")).scalar() if ours else None
    if tables and not ours:
        raise InvalidInput(
            f"Store {store.name}: expected a database of Twinloop, found one of something else, with the tables"
            f" {', '.join(sorted(tables)[:5])}; name another file."
        )
    if not tables and not (create and not store.read_only):
        raise InvalidInput(f"Store {store.name}: expected a store, found an empty database; check its name.")
    if found != REVISION:
        _migrate(store, found)


def _migrate(store: Store, found: str | None) -> None:
    from alembic import command
    from alembic.config import Config
    from alembic.script import ScriptDirectory

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).with_name("migrations")))
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    if found is not None and found not in known:
        if store.path is not None:
            # A version may be unknown because its digits are damaged: it stands in an index, too.
            _check_whole(store, "integrity_check")
        raise InvalidInput(
            f"Store {store.name}: expected tables of version {max(known)} at most, found {found}; a newer Twinloop"
            " wrote it: install that."
        )
    if store.read_only:
        raise InvalidInput(
            f"Store {store.name}: expected tables of version {max(known)}, found {found}; open it once without"
            " read_only, as `twinloop learn` does, which brings it up to date."
        )
    with store.engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "head")
