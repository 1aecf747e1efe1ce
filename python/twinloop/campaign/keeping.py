"""Keeps a campaign in a store: opens it as its only writer, and commits what is new whenever something has changed."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from twinloop._ground.texts import text
from twinloop.campaign.history import Progress
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.method import Method
from twinloop.campaign.provenance import provenance
from twinloop.campaign.remaining import estimate
from twinloop.campaign.setup import Setup
from twinloop.errors import InvalidInput, StoreFailure, unknown
from twinloop.records import Record, check_same
from twinloop.store import Keeper, Store, Stored, StoredAs, begun, found, listed, only_name, opened

Answer = TypeVar("Answer")

SECONDS = 10.0
"""After which a search that is under way is kept again, as soon as it has come further."""
BEAT = 1.0
"""Seconds between two times that it is said what is being done, at least."""


class Keeping:
    """A campaign's way into its store.

    Args:
        where: a file, or the address of a server.
        name: of the campaign in it; it is begun where there is none of that name.
        setup: what the campaign is about.
        identity: of the campaign, if it is new.
        threads: of the engine, for the record of the session.

    Raises:
        InvalidInput: no store, or the name is that of a campaign with another setup.
        NotAvailable: the packages of the extra `store` are missing.
        StoreFailure: somebody else writes the campaign, or the store cannot be written.
    """

    def __init__(self, where: str | Path, name: str, setup: Setup, identity: str, threads: int) -> None:
        _check_name(name)
        self._said: float | None = None
        asked = setup.to_record()
        Setup.from_record(asked)  # what could not be read again is refused before there is a row of it
        store = opened(where, create=True)
        try:
            self._keeper = Keeper(store, name, asked, identity)
        except BaseException:
            store.close()
            raise
        try:
            held = found(store, name)
            assert held is not None  # the keeper has entered it
            check_setup(Setup.from_record(held.setup), setup, as_begun(store.name, name))
            self._keeper.open_session(provenance(threads))
            # Looked up now: who says after a failure how to go on must not need the store for it.
            self.stored_as = StoredAs.among(store.name, name, listed(store))
        except BaseException:
            self.close()
            raise
        self.stored: Stored = held
        self._memory: object = None
        self._saved = time.monotonic()
        self._budget = held.experiments
        self._remaining = estimate(setup.options, held.experiments or 1)

    def keep(self, book: Logbook, method: Method, counts: Sequence[int | None]) -> None:
        """Commits what is new in the book, and what was learnt since.

        Args:
            book: of the campaign.
            method: of the campaign.
            counts: how many runs its system had made at each recorded experiment.

        Raises:
            InvalidInput: an entry could not be read again.
            StoreFailure: the store cannot be written; nothing of it was kept.
        """
        memory = method.memory
        record = None if memory is self._memory else method.to_record()
        entries = book.entries(self.rows)
        book.check_readable(entries)
        self._keeper.keep(entries, record, counts[self.rows["experiments"] :])
        self._memory, self._saved = memory, time.monotonic()
        self.rest()

    def restored(self, memory: object) -> None:
        """Says that what is remembered now is what the store holds."""
        self._memory = memory

    def checkpoint(self, method: Method) -> None:
        """Commits a search that is under way, if the last time was a while ago and it has come further since.

        Args:
            method: of the campaign.

        Raises:
            StoreFailure: the store cannot be written.
        """
        if time.monotonic() - self._saved >= SECONDS and method.memory is not self._memory:
            self._keeper.keep({}, method.to_record())
            self._memory, self._saved = method.memory, time.monotonic()

    def say(self, progress: Progress) -> None:
        """Lets those who look at the store know what is being done, now and then.

        Args:
            progress: of the campaign.
        """
        experiments = max(self._budget or 1, progress.experiments)
        self._remaining.experiments = experiments
        remaining, now = self._remaining.remaining(progress), time.monotonic()
        if self._said is not None and abs(now - self._said) < BEAT:
            return
        self._said = now
        doing = {"phase": progress.phase, "generation": progress.generation, "generations": progress.generations,
                 "told": progress.experiments, "experiments": experiments, "left": remaining}  # fmt: skip
        with suppress(StoreFailure):  # what has to be kept will tell it
            self._keeper.say(doing)

    def rest(self) -> None:
        """Lets them know that nothing is being done any more."""
        if self._said is not None:
            self._said = None
            with suppress(StoreFailure):
                self._keeper.say(None)

    def fly(self, system: Record | None, experiments: int) -> None:
        """Commits what the campaign flies from now on.

        Args:
            system: its record; None where it has none.
            experiments: runs on it in all.

        Raises:
            StoreFailure: the store cannot be written.
        """
        self._keeper.fly(system, experiments)
        self._budget = experiments

    @property
    def rows(self) -> dict[str, int]:
        """How many entries of each list of the logbook the store holds."""
        return self._keeper.rows

    @property
    def store(self) -> str:
        """The file, or the address without its passwords."""
        return self._keeper.store.name

    @property
    def name(self) -> str:
        """Of the campaign and its store, for errors."""
        return f"the campaign {self._keeper.name!r} of {self._keeper.store.name}"

    def close(self) -> None:
        """Lets others write."""
        self.rest()
        self._keeper.close()


def look(where: str | Path, name: str | None, read_only: bool) -> Stored:
    """What a store holds of a campaign.

    Args:
        where: a file, or the address of a server.
        name: of the campaign; None: the only one.
        read_only: whether nothing will be written there.

    Returns:
        The campaign.

    Raises:
        InvalidInput: no store, or no such campaign in it.
        NotAvailable: the packages of the extra `store` are missing.
        StoreFailure: the store cannot be read.
    """
    return _of_store(where, name, read_only, found)


def heading(where: str | Path, name: str | None) -> tuple[str, Record]:
    """Name and setup of a campaign that is to be written on; the rest is read once nobody else can write it.

    Args:
        where: a file, or the address of a server.
        name: of the campaign; None: the only one.

    Returns:
        Both.

    Raises:
        InvalidInput: no store, or no such campaign in it.
        NotAvailable: the packages of the extra `store` are missing.
        StoreFailure: the store cannot be read.
    """
    return _of_store(where, name, False, begun)


def gone_on_with(where: str | Path, name: str | None) -> str | None:
    """Name of the campaign of a store that is gone on with; no second one is begun beside it.

    Args:
        where: a file, or the address of a server.
        name: of the campaign; None: the only one.

    Returns:
        The name; None where the store has no campaign yet.

    Raises:
        InvalidInput: no store, no such campaign in it, or several and no name.
        NotAvailable: the packages of the extra `store` are missing.
        StoreFailure: the store cannot be read.
    """
    store = opened(where, create=True)
    try:
        names = [str(row["name"]) for row in listed(store)]
        if not names:
            return None
        if name is None:
            name = only_name(store, names)
    finally:
        store.close()
    if name not in names:
        raise unknown(f"campaign of the store {store.name}", name, names)
    return name


def _of_store(
    where: str | Path, name: str | None, read_only: bool, wanted: Callable[[Store, str | None], Answer | None]
) -> Answer:
    store = opened(where, read_only=read_only)
    try:
        answer, names = wanted(store, name), [row["name"] for row in listed(store)]
    finally:
        store.close()
    if answer is None and name is not None and names:
        raise unknown(f"campaign of the store {store.name}", name, names)
    if answer is None:
        raise InvalidInput(f"Store {store.name}: expected a campaign, found none; run one with store= first.")
    return answer


def _check_name(name: object) -> None:
    if not isinstance(name, str) or not 0 < len(name.strip()) <= 200:
        raise InvalidInput(
            f"Campaign, name: expected a text of 1 to 200 characters, found {name!r}; name it."
        )
    text("Campaign, name", name)


def as_begun(store: str, name: str) -> str:
    """What is expected of who goes on with a campaign, as the beginning of a sentence.

    Args:
        store: what messages call it.
        name: of the campaign.
    """
    return f"Store {store}: expected the campaign {name!r} as it was begun"


def check_setup(known: Setup, asked: Setup, what: str) -> None:
    """Refuses another setup than the one that is known, whatever version wrote it down.

    Args:
        known: as it was read from a store.
        asked: that is to go on from there.
        what: the store, and what was expected there, for errors.

    Raises:
        InvalidInput: they differ.
    """
    check_same(_stated(known.to_record()), _stated(asked.to_record()), what)


def _stated(setup: Record) -> Record:
    """A setup with the length of a test as people state it, in s.

    Its digits are counted from the first: of the same period, other steps are another length, however short it is.
    """
    others = {key: value for key, value in setup.items() if key != "steps"}
    return {**others, "duration": float(f"{setup['steps'] * setup['signals']['dt']:.12g}")}
