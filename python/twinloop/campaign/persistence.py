"""What a campaign is made of, and how it outlives its process: plain records, copies, and the store that keeps it."""

from __future__ import annotations

import copy
import os
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from twinloop import _core
from twinloop._ground.arrays import whole
from twinloop.campaign.coevolution.method import Coevolution
from twinloop.campaign.history import Experiment, Progress
from twinloop.campaign.identify_and_plan.method import IdentifyAndPlan
from twinloop.campaign.keeping import Keeping, heading, look
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.method import Method
from twinloop.campaign.own_progress import OwnProgress
from twinloop.campaign.presets import Options
from twinloop.campaign.rig import Rig
from twinloop.campaign.setup import Setup
from twinloop.controllers import Controller
from twinloop.errors import InvalidInput
from twinloop.law.twin import Twin
from twinloop.records import Record, Recorded, checked_record
from twinloop.store import Stored, StoredAs
from twinloop.test import Test

if TYPE_CHECKING:
    from typing_extensions import Self


class Persistent(Recorded):
    """The parts of a campaign that stay: its setup, its logbook, what its method remembers; and where they are kept."""

    def _begin(
        self, setup: Setup, threads: int | None, progress: Callable[[Progress], None] | bool | None
    ) -> None:
        self.setup = setup
        self.threads = (
            available_threads() if threads is None else whole("Campaign, threads", threads, least=1)
        )
        if progress is not None and not isinstance(progress, bool) and not callable(progress):
            raise InvalidInput(
                f"Campaign, progress: expected something to call with a Progress, True or False, found"
                f" {progress!r}; pass a function."
            )
        self.progress = progress
        # Called in `run` with each test and its flight once that is recorded; flights go on unless it raises.
        self.landed: Callable[[Test, Experiment], None] | None = None
        self._own_progress = OwnProgress(setup.options)
        self.interrupted = False
        self._workers = _core.Workers(threads=self.threads)
        self._book = Logbook(self.setup)
        self._method = self._chosen()
        self._controller: Controller | None = None
        self._shown_twin: tuple[tuple[object, int], Twin] | None = None
        self._keeping: Keeping | None = None
        self._rig = Rig()

    def _open(self, where: str | Path, name: str) -> None:
        """Goes on with what a store holds, and keeps there what comes."""
        keeping = Keeping(where, name, self.setup, self._book.identity, self.threads)
        try:
            self._recall(keeping.stored)
        except BaseException:
            keeping.close()
            raise
        keeping.restored(self._method.memory)
        self._keeping = keeping
        # A campaign that nobody holds any more writes no more; the end of the process is one of those.
        weakref.finalize(self, keeping.close)

    def _recall(self, held: Stored) -> None:
        self._book = Logbook.from_record(held.logbook, self.setup)
        if held.memory is not None:
            self._method.restore(held.memory, self._book)
        self._rig = Rig(held.system, held.experiments, held.runs)

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        return "setup", "logbook", "memory"

    def to_record(self) -> Record:
        """The campaign as numbers, texts, lists and dicts: its setup, all runs, all that was learnt.

        Raises:
            NotAvailable: its controllers have no plain form.
        """
        return {
            **self._head(),
            "setup": self.setup.to_record(),
            "logbook": self._book.to_record(),
            "memory": self._method.to_record(),
        }

    @classmethod
    def from_record(
        cls,
        record: object,
        *given: object,
        threads: int | None = None,
        progress: Callable[[Progress], None] | bool | None = True,
    ) -> Self:
        """The campaign of a record; it continues with the same bits.

        Args:
            record: such as `to_record` gives, or JSON gives back.
            given: nothing; a campaign is whole.
            threads: how many the engine may use, by default all that there are.
            progress: as in `Campaign`.

        Returns:
            A campaign of its own.

        Raises:
            InvalidInput: another kind, a newer version, an unknown or missing key, or a value that cannot be used.
        """
        found = checked_record(record, cls, cls.recorded_fields(), cls.KIND)
        campaign = object.__new__(cls)
        campaign._begin(Setup.from_record(found["setup"]), threads, progress)
        campaign._book = Logbook.from_record(found["logbook"], campaign.setup)
        campaign._method.restore(found["memory"], campaign._book)
        campaign._rig.count(len(campaign._book.recorded))
        return campaign

    def __copy__(self) -> Self:
        """A campaign that goes on by itself from here, with the same bits.

        Both call the same `progress`; the copy's `controller` is at rest.
        """
        campaign = object.__new__(type(self))
        campaign.setup, campaign.threads = self.setup, self.threads
        campaign.progress, campaign.interrupted = self.progress, self.interrupted
        campaign.landed = self.landed
        campaign._own_progress = OwnProgress(self.setup.options)
        campaign._workers = _core.Workers(threads=self.threads)
        campaign._book = self._book.copied()
        campaign._method = campaign._chosen()
        campaign._method.memory, campaign._controller = self._method.memory, None
        campaign._shown_twin = self._shown_twin
        campaign._keeping = None  # a store has one writer
        campaign._rig = copy.copy(self._rig)
        return campaign

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """As `copy.copy`: what both share are values that never change."""
        return copy.copy(self)

    def __reduce__(self) -> NoReturn:
        """A pickle runs code where it is read, and knows no versions: a record does neither.

        Raises:
            InvalidInput: always.
        """
        raise InvalidInput(
            "Campaign: expected a store or a record to keep it in, found pickle; use campaign.save(path) and"
            " Campaign.load(path), or campaign.to_record() and Campaign.from_record(record)."
        )

    def save(self, where: str | Path, name: str = "campaign") -> None:
        """Writes the campaign into a store, or what is new into one where it was saved before.

        Args:
            where: a file of SQLite, or the address of a database; made where there is none.
            name: of the campaign there.

        Raises:
            InvalidInput: another campaign of that name is there, or no store.
            NotAvailable: the packages of the extra `store` are missing.
            StoreFailure: the store cannot be written.
        """
        keeping = Keeping(where, name, self.setup, self._book.identity, self.threads)
        try:
            mine, known = self._book.to_record(), keeping.stored.logbook
            lists = [key for key, value in known.items() if isinstance(value, list)]
            if known["identity"] != mine["identity"] or any(
                mine[key][: len(known[key])] != known[key] for key in lists
            ):
                raise InvalidInput(
                    f"Campaign.save: expected {keeping.name} to be an earlier state of this one, found another"
                    " one, or one that has continued separately; choose another name."
                )
            keeping.keep(self._book, self._method, self._rig.counts)
            if self._rig.budget is not None:
                keeping.fly(self._rig.system, self._rig.budget)
        finally:
            keeping.close()

    @classmethod
    def load(
        cls,
        where: str | Path,
        name: str | None = None,
        *,
        read_only: bool = False,
        threads: int | None = None,
        progress: Callable[[Progress], None] | bool | None = True,
    ) -> Self:
        """A campaign from a store; it is stored there from now on, too, and continues with the same bits.

        Args:
            where: a file of SQLite, or the address of a database.
            name: of the campaign there; None: the only one.
            read_only: whether to look only: others may write it meanwhile, and what is done here is not kept.
            threads: how many the engine may use, by default all that there are.
            progress: as in `Campaign`.

        Returns:
            The campaign.

        Raises:
            InvalidInput: no store, no such campaign, or several and no name.
            NotAvailable: the packages of the extra `store` are missing.
            StoreFailure: somebody else writes the campaign, or the store cannot be read.
        """
        campaign = object.__new__(cls)
        if read_only:
            held = look(where, name, read_only)
            campaign._begin(Setup.from_record(held.setup), threads, progress)
            campaign._recall(held)
        else:
            known, setup = heading(where, name)
            campaign._begin(Setup.from_record(setup), threads, progress)
            campaign._open(where, known)
        return campaign

    @property
    def store(self) -> str | None:
        """Where it is kept; None: nowhere."""
        return None if self._keeping is None else self._keeping.store

    def close(self) -> None:
        """Lets others write the campaign in its store; nothing that is done afterwards is kept there."""
        if self._keeping is not None:
            self._keeping.close()
            self._keeping = None

    def _keep(self) -> None:
        self._rig.count(len(self._book.recorded))
        if self._keeping is not None:
            self._keeping.keep(self._book, self._method, self._rig.counts)

    def _take_up(self, system: object, experiments: int) -> None:
        """The system is the one that is flown from now on, for so many runs on it in all."""
        self._rig.fly(system, experiments, None if self._keeping is None else self._keeping.name)
        if self._keeping is not None:
            self._keeping.fly(self._rig.system, experiments)

    @contextmanager
    def _entering(self) -> Iterator[None]:
        """What is entered in the book meanwhile is committed at the end, or taken back."""
        book, memory, counts = self._book.copied(), self._method.memory, self._rig.counts
        rows = None if self._keeping is None else self._keeping.rows
        try:
            yield
            self._keep()
        except BaseException:
            # Ctrl-C may come behind the commit: what the store holds stays.
            if self._keeping is None or self._keeping.rows == rows:
                self._book, self._method.memory, self._rig.counts = book, memory, counts
            raise

    def _chosen(self) -> Method:
        options = self.setup.options
        if isinstance(options, Options):
            return Coevolution(self.setup, options, self._workers, self._report)
        return IdentifyAndPlan(self.setup, options, self._workers, self._report)

    def _report(self, progress: Progress) -> None:
        if self._keeping is not None:
            self._keeping.checkpoint(self._method)
            self._keeping.say(progress)
        if callable(self.progress):
            self.progress(progress)
        elif self.progress:
            self._own_progress(progress)


def stored_as(campaign: Persistent) -> StoredAs | None:
    """Under what commands find a campaign again, with its name where its store holds several; None: nowhere.

    Args:
        campaign: that is written now, or is kept nowhere.
    """
    return None if campaign._keeping is None else campaign._keeping.stored_as


def available_threads() -> int:
    """Processors that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
