"""One campaign in a store: found, begun, and kept row by row; what is kept is committed before `keep` returns."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twinloop.errors import InvalidInput, StoreFailure, comma_separated
from twinloop.records import Record, from_text, to_text
from twinloop.store.columns import count_in, moment_in, provenance_in, record_in
from twinloop.store.database import Store
from twinloop.store.lock import AdvisoryLock, FileLock, Lock, taken
from twinloop.store.uninterrupted import uninterrupted

if TYPE_CHECKING:
    from sqlalchemy import Connection


@dataclass(frozen=True)
class Stored:
    """What a store holds of one campaign.

    Args:
        name: of the campaign in its store.
        setup: its record.
        logbook: its record.
        memory: its record; None where nothing was learnt.
        system: record of the system that it flies, where that has one.
        runs: how many runs the system had made at each experiment; None where it does not count.
        experiments: that it will make in all, as was said last; None: nobody has said.
        created: when, in UTC.
        sessions: versions and processor each time it was opened to be written.
        told_at: time of each `tell`, in UTC.
        withdrawn_at: time of each `withdraw`, in UTC.
    """

    name: str
    setup: Record
    logbook: Record
    memory: Record | None
    system: Record | None
    runs: tuple[int | None, ...]
    experiments: int | None
    created: str
    sessions: tuple[Record, ...]
    told_at: tuple[str, ...]
    withdrawn_at: tuple[str, ...] = ()


def listed(store: Store) -> list[dict[str, Any]]:
    """The campaigns of a store, in the order in which they were begun.

    Args:
        store: open.

    Returns:
        Name, when it was begun, and how many tests and experiments there are, of each.
    """
    from sqlalchemy import func, select

    from twinloop.store.schema import campaigns, experiments, tests

    def count(table: Any) -> Any:
        rows = select(func.count()).select_from(table).where(table.c.campaign == campaigns.c.id)
        return rows.scalar_subquery()

    wanted = select(
        campaigns.c.name,
        campaigns.c.created,
        count(tests).label("tests"),
        count(experiments).label("experiments"),
    )
    with store.transaction() as connection:
        rows = connection.execute(wanted.order_by(campaigns.c.id))
        return [dict(row._mapping) for row in rows]


def found(store: Store, name: str | None) -> Stored | None:
    """A campaign of a store.

    Args:
        store: open.
        name: of the campaign; None: the only one.

    Returns:
        What the store holds of it; None where there is none.

    Raises:
        InvalidInput: no name and several campaigns, or rows that are not what was written.
    """
    from sqlalchemy import select

    from twinloop.store.schema import campaigns, checkpoints, sessions

    with store.snapshot() as connection:
        if name is None:
            name = _only_name(connection, store)
        row = connection.execute(select(campaigns).where(campaigns.c.name == name)).one_or_none()
        if row is None:
            return None

        def rows(table: Any) -> list[Any]:
            chosen = select(table).where(table.c.campaign == row.id).order_by(table.c.number)
            return list(connection.execute(chosen))

        entries = {name: rows(table) for name, table in _entries().items()}
        opened = rows(sessions)
        of_this = checkpoints.c.campaign == row.id
        memory = connection.execute(select(checkpoints.c.record).where(of_this)).scalar()
    what = f"Store {store.name}, campaign {name}"
    runs = entries["experiments"]
    for i, run in enumerate(runs):
        if _hash(run.record) != run.sha256:
            raise InvalidInput(
                f"{what}: expected experiment {i} as it was told, found another one; it was changed:"
                " use an earlier copy."
            )
    logbook = {name: [from_text(entry.record, what) for entry in found] for name, found in entries.items()}
    return Stored(
        name=row.name,
        setup=record_in("campaigns.setup", row.setup, what),
        logbook={"kind": "logbook", "version": 2, "identity": row.identity, **logbook},
        memory=None if memory is None else record_in("checkpoints.record", memory, what),
        system=None if row.system is None else record_in("campaigns.system", row.system, what),
        runs=tuple(count_in("experiments.runs", run.runs, what) for run in runs),
        experiments=count_in("campaigns.experiments", row.experiments, what),
        created=moment_in("campaigns.created", row.created, what),
        sessions=tuple(
            {"started": each.started, **provenance_in("sessions.provenance", each.provenance, what)}
            for each in opened
        ),
        told_at=tuple(moment_in("experiments.told", run.told, what) for run in runs),
        withdrawn_at=tuple(
            moment_in("withdrawals.withdrawn", each.withdrawn, what) for each in entries["withdrawals"]
        ),
    )


def _only_name(connection: Connection, store: Store) -> str:
    from sqlalchemy import select

    from twinloop.store.schema import campaigns

    names = list(connection.execute(select(campaigns.c.name).order_by(campaigns.c.id)).scalars())
    return only_name(store, [str(name) for name in names])


def only_name(store: Store, names: Sequence[str]) -> str:
    """The name of the only campaign of a store; empty where it has none.

    Args:
        store: open.
        names: of its campaigns.

    Raises:
        InvalidInput: there are several.
    """
    if len(names) > 1:
        raise InvalidInput(
            f"Store {store.name}: expected the name of one of its campaigns, found none; it holds"
            f" {comma_separated(names)}. Choose one with --name, in Python with name=."
        )
    return names[0] if names else ""


def begun(store: Store, name: str | None) -> tuple[str, Record] | None:
    """Name and setup of a campaign, without its runs.

    Args:
        store: open.
        name: of the campaign; None: the only one.

    Returns:
        Both; None where there is no such campaign.

    Raises:
        InvalidInput: no name and several campaigns.
    """
    from sqlalchemy import select

    from twinloop.store.schema import campaigns

    with store.transaction() as connection:
        name = _only_name(connection, store) if name is None else name
        of_this = campaigns.c.name == name
        setup = connection.execute(select(campaigns.c.setup).where(of_this)).scalar()
    what = f"Store {store.name}, campaign {name}"
    return None if setup is None else (name, record_in("campaigns.setup", setup, what))


class Keeper:
    """The only writer of a campaign; once another one has opened it, it writes no more.

    Args:
        store: open, to be written; it is closed with the keeper.
        name: of the campaign; it is begun where there is none of that name.
        setup: its record.
        identity: its own.

    Raises:
        StoreFailure: somebody else writes it, or the database refuses.
    """

    def __init__(self, store: Store, name: str, setup: Record, identity: str) -> None:
        self.store = store
        self.name = name
        self._lock: Lock | None = None
        self._session: int | None = None
        with store.transaction() as connection:
            self._id = _entered(connection, name, setup, identity)
        self._lock = self._locked()
        with store.transaction() as connection:
            self.rows = self._counted(connection)

    def open_session(self, provenance: Record) -> None:
        """Enters that the campaign is written from now on, and by what.

        Args:
            provenance: versions, processor and so on.

        Raises:
            StoreFailure: the database refuses, or somebody else has written the campaign since it was opened here.
        """
        from twinloop.store.schema import sessions

        with self._writing() as connection:
            if self._counted(connection) != self.rows:
                raise taken(self._what, "another one")
            number = _count(connection, sessions, self._id)
            row = {
                "campaign": self._id,
                "number": number,
                "started": _now(),
                "provenance": to_text(provenance),
            }
            connection.execute(sessions.insert(), row)
        self._session = number

    def keep(
        self,
        entries: Mapping[str, Sequence[Any]],
        memory: Record | None = None,
        runs: Sequence[int | None] = (),
    ) -> None:
        """Commits what is new; either all of it is kept when this returns, or nothing.

        Args:
            entries: records that the lists of the logbook have in addition to `rows`.
            memory: what was learnt; None: as it was.
            runs: how many runs the system had made at each of the new experiments; None where it does not count.

        Raises:
            StoreFailure: the database refuses, or holds other rows than were kept here.
        """
        if memory is None and not any(entries.values()):
            return
        # Interrupted between the commit and what is known of it, the two would part.
        with uninterrupted():
            with self._writing() as connection:
                self._check_rows(connection)
                for name, records in entries.items():
                    self._append(connection, name, records, runs)
                if memory is not None:
                    self._replace(connection, memory)
            self.rows = {name: count + len(entries.get(name, ())) for name, count in self.rows.items()}

    def _append(
        self, connection: Connection, name: str, records: Sequence[Any], runs: Sequence[int | None]
    ) -> None:
        first = self.rows[name]
        for number, record in enumerate(records, first):
            row = {"campaign": self._id, "number": number, "record": to_text(record)}
            if name == "experiments":
                row |= {"told": _now(), "sha256": _hash(str(row["record"])), "runs": runs[number - first]}
            if name == "withdrawals":
                row["withdrawn"] = _now()
            connection.execute(_entries()[name].insert(), row)

    def _replace(self, connection: Connection, memory: Record) -> None:
        from sqlalchemy import delete

        from twinloop.store.schema import checkpoints

        connection.execute(delete(checkpoints).where(checkpoints.c.campaign == self._id))
        # The time is for a person; the rest tells two within a second apart, and by no clock.
        saved = f"{_now()} {secrets.token_hex(6)}"
        row = {"campaign": self._id, "saved": saved, "record": to_text(memory)}
        connection.execute(checkpoints.insert(), row)

    def fly(self, system: Record | None, experiments: int) -> None:
        """Enters what the campaign flies from now on.

        Args:
            system: its record; None where it has none.
            experiments: runs on it in all.

        Raises:
            StoreFailure: the database refuses.
        """
        from sqlalchemy import update

        from twinloop.store.schema import campaigns

        flown = None if system is None else to_text(system)
        with self._writing() as connection:
            row = update(campaigns).where(campaigns.c.id == self._id)
            connection.execute(row.values(system=flown, experiments=experiments))

    def say(self, doing: Record | None) -> None:
        """Enters what is being done, for those who look; nothing depends on it.

        Args:
            doing: phase, step and so on; None: nothing any more.

        Raises:
            StoreFailure: the database refuses.
        """
        from sqlalchemy import delete

        from twinloop.store.schema import progress

        with self._writing() as connection:
            connection.execute(delete(progress).where(progress.c.campaign == self._id))
            if doing is not None:
                row = {"campaign": self._id, "said": _now(), "record": to_text(doing)}
                connection.execute(progress.insert(), row)

    def close(self) -> None:
        """Lets others write."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None
        self.store.close()

    @contextmanager
    def _writing(self) -> Iterator[Connection]:
        """A transaction of the only writer.

        A lock can be lost unnoticed: that of a server ends with its connection, that of a file with the file. So the
        database itself is asked whether somebody has opened the campaign since, while nobody else can.
        """
        from sqlalchemy import select

        from twinloop.store.schema import campaigns, sessions

        with self.store.transaction() as connection:
            connection.execute(select(campaigns.c.id).where(campaigns.c.id == self._id).with_for_update())
            if self._session is not None and _count(connection, sessions, self._id) != self._session + 1:
                raise StoreFailure(
                    f"Store: expected to be the only one who writes {self._what}, found that another one has opened it"
                    " since; this one writes no more, and what it was last given is not stored: close it, load the"
                    " campaign again, and repeat the command."
                )
            yield connection

    @property
    def _what(self) -> str:
        """What is written, for errors."""
        return f"the campaign {self.name!r} of {self.store.name}"

    def _counted(self, connection: Connection) -> dict[str, int]:
        return {name: _count(connection, table, self._id) for name, table in _entries().items()}

    def _check_rows(self, connection: Connection) -> None:
        """Refuses to write behind rows that nobody here knows of, such as after a commit whose answer was lost."""
        found = self._counted(connection)
        if found != self.rows:
            other = ", ".join(
                f"{name}: {count} instead of {self.rows[name]}"
                for name, count in found.items()
                if count != self.rows[name]
            )
            raise StoreFailure(
                f"Store {self.store.name}: expected the campaign {self.name!r} as it was last kept here, found"
                f" {other}; no stored data is lost: load the campaign again and continue from there."
            )

    def _locked(self) -> Lock:
        path = self.store.path
        if path is None:
            with self.store.sentences():
                return AdvisoryLock(self.store.engine.connect(), self._id, self._what)
        with self.store.sentences():
            # Beside the database itself, whatever links lead to it.
            return FileLock(Path(f"{path.resolve()}-{self._id}.lock"), self._what)


def _entered(connection: Connection, name: str, setup: Record, identity: str) -> int:
    """The number of a campaign, which is begun where there is none of the name."""
    from sqlalchemy import select

    from twinloop.store.schema import campaigns

    known = connection.execute(select(campaigns.c.id).where(campaigns.c.name == name)).scalar()
    if known is not None:
        return int(known)
    row = {"name": name, "identity": identity, "created": _now(), "setup": to_text(setup)}
    answer = connection.execute(campaigns.insert(), row)
    assert answer.inserted_primary_key is not None
    return int(answer.inserted_primary_key[0])


def _entries() -> dict[str, Any]:
    """Tables of the lists of a logbook, by name."""
    from twinloop.store.schema import ENTRIES

    return dict(ENTRIES)


def _count(connection: Connection, table: Any, campaign: int) -> int:
    from sqlalchemy import func, select

    rows = select(func.count()).select_from(table).where(table.c.campaign == campaign)
    return int(connection.execute(rows).scalar_one())


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _now() -> str:
    """When, for a person; nothing depends on the clock."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
