"""The desk: what people do with a campaign of a store: ask, approve, tell, fail, abandon. One thing at a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from twinloop.campaign import Campaign
from twinloop.campaign.history import Progress
from twinloop.errors import InvalidInput, NotAvailable, TwinloopError
from twinloop.faces.console import USUAL
from twinloop.faces.telling import attach, numbered, tell, tell_failed
from twinloop.store import approve, approved, kept, opened, state


@dataclass(frozen=True)
class Work:
    """Something long that goes on.

    Args:
        what: in a few words.
        since: seconds on the monotonic clock.
    """

    what: str
    since: float


class Desk:
    """A store, looked at by many and written by one person at a time.

    The store is opened anew for each act and closed behind it, so that others may write in between.

    Args:
        store: the file, or the address of a database.
        threads: of the engine.

    Raises:
        InvalidInput: no store.
    """

    def __init__(self, store: str, threads: int | None = None) -> None:
        self.store = store
        self.threads = threads
        self._turn = threading.Lock()
        self._work: dict[str, Work] = {}
        self._failed: dict[str, str] = {}
        with closing(opened(store)):  # an older store is brought up to date, and what is none is refused
            pass

    def campaigns(self) -> list[dict[str, object]]:
        """Name, when begun, tests and experiments of each campaign."""
        with closing(opened(self.store, read_only=True)) as base:
            return kept(base)

    def look(self, name: str) -> Campaign:
        """A campaign to look at.

        Args:
            name: of the campaign.

        Raises:
            InvalidInput: no such campaign.
        """
        return Campaign.load(self.store, name, read_only=True, threads=self.threads)

    def state(self, name: str) -> dict[str, object]:
        """Whether anything has changed, what is going on, and why the last long thing failed.

        Args:
            name: of the campaign.
        """
        with closing(opened(self.store, read_only=True)) as base:
            text = state(base, name)
        work = self._work.get(name)
        return {
            "state": text,
            "working": None if work is None else work.what,
            "seconds": None if work is None else round(time.monotonic() - work.since),
            "failed": self._failed.get(name),
        }

    def approved(self, name: str) -> dict[int, str]:
        """When each test was approved, by its number.

        Args:
            name: of the campaign.
        """
        with closing(opened(self.store, read_only=True)) as base:
            return approved(base, name)

    def approve(self, name: str, number: int) -> str:
        """Keeps that a test may be flown.

        Args:
            name: of the campaign.
            number: of the test.

        Raises:
            InvalidInput: it is not waiting to be flown.
            StoreFailure: the store cannot be written.
        """
        if number not in [test.number for test in self.look(name).waiting]:
            raise InvalidInput(f"Test {number}: expected one that waits to be flown, found another one.")
        with closing(opened(self.store)) as base:
            approve(base, name, number)
        return f"Test {number} may be flown."

    def tell(self, name: str, number: int, log: Path, called: str, aborted: str) -> str:
        """Tells the flight of a test.

        Args:
            name: of the campaign.
            number: of the test.
            log: CSV or .npz.
            called: what the log was called where it came from.
            aborted: why the test was stopped before its end; empty where it was not.

        Raises:
            InvalidInput: no such test, or a log that cannot be used, that was told before, or that ends early without a
                reason.
            StoreFailure: somebody else writes the campaign.
        """
        with self._writing(name) as campaign:
            tell(campaign, number, log, aborted=aborted, name=called)
            return f"Test {number} told: {len(campaign.experiments)} experiments are kept."

    def attach(self, name: str, log: Path, called: str) -> str:
        """Adds a flight that nobody asked for.

        Args:
            name: of the campaign.
            log: CSV or .npz.
            called: what the log was called where it came from.

        Raises:
            InvalidInput: a log that cannot be used.
            StoreFailure: somebody else writes the campaign.
        """
        with self._writing(name) as campaign:
            attach(campaign, log, name=called)
            return f"Attached: {len(campaign.experiments)} experiments are kept."

    def fail(self, name: str, number: int, reason: str) -> str:
        """Tells that a test failed.

        Args:
            name: of the campaign.
            number: of the test.
            reason: in a few words.

        Raises:
            InvalidInput: no such test, or no reason.
            StoreFailure: somebody else writes the campaign.
        """
        with self._writing(name) as campaign:
            tell_failed(campaign, number, reason)
            return f"Test {number} failed: {reason}"

    def abandon(self, name: str, number: int) -> str:
        """Tells that a test will not be flown.

        Args:
            name: of the campaign.
            number: of the test.

        Raises:
            InvalidInput: no such test.
            StoreFailure: somebody else writes the campaign.
        """
        with self._writing(name) as campaign:
            campaign.abandon(numbered(campaign, number))
            return f"Test {number} will not be flown."

    def ask(self, name: str, last: bool) -> str:
        """Begins to plan the next test; it goes on behind.

        Args:
            name: of the campaign.
            last: whether no other test will follow.

        Raises:
            InvalidInput: something is under way already.
        """

        def plan() -> None:
            with self._writing(name, self._progress(name)) as campaign:
                if not campaign.experiments:
                    raise NotAvailable(
                        "Ask: expected a flight that was told, found none; tell the first test, or attach a flight."
                    )
                campaign.ask(last=last)

        if not self._turn.acquire(blocking=False):
            raise InvalidInput(
                "Ask: expected nothing else under way, found something; wait until it is done."
            )
        try:
            self._failed.pop(name, None)
            self._work[name] = Work("opening the campaign", time.monotonic())
            threading.Thread(target=self._behind, args=(name, plan), daemon=True).start()
        except BaseException:
            self._work.pop(name, None)
            self._turn.release()
            raise
        return "Learning, and planning the next test."

    def _behind(self, name: str, work: Callable[[], None]) -> None:
        try:
            work()
        except TwinloopError as failure:
            self._failed[name] = str(failure)
        except Exception as failure:  # whatever it is, the page has to say that it is over
            self._failed[name] = f"It failed: {type(failure).__name__}: {failure}"
        finally:
            self._work.pop(name, None)
            self._turn.release()

    def _progress(self, name: str) -> Callable[[Progress], None]:
        begun = time.monotonic()

        def seen(progress: Progress) -> None:
            words = USUAL.get(progress.phase, (progress.phase, 0.0))[0]
            if progress.generations > 1:
                words += f", {progress.generation} of {progress.generations}"
            self._work[name] = Work(words, begun)

        return seen

    @contextmanager
    def _writing(self, name: str, progress: Callable[[Progress], None] | None = None) -> Iterator[Campaign]:
        """The campaign, with this process as its only writer; the turn is held already where progress is told."""
        if progress is None and not self._turn.acquire(blocking=False):
            raise InvalidInput("Expected nothing else under way, found something; wait until it is done.")
        try:
            with closing(
                Campaign.load(self.store, name, threads=self.threads, progress=progress)
            ) as campaign:
                yield campaign
        finally:
            if progress is None:
                self._turn.release()
