"""The desk: what people do with a campaign of a store: ask, approve, tell, withdraw. One thing at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from twinloop.campaign import Campaign
from twinloop.campaign.history import Experiment
from twinloop.campaign.remaining import USUAL, duration
from twinloop.errors import InvalidInput, NotAvailable, TwinloopError
from twinloop.faces.opening import check_beside, fields_beside
from twinloop.faces.telling import (
    against_it,
    attach,
    counted,
    numbered,
    said_against,
    tell,
    tell_failed,
    to_be_flown,
    unlearnt,
)
from twinloop.faces.withdrawing import chosen, given_up_words, recorded
from twinloop.logs import Log
from twinloop.store import (
    Doing,
    StoredAs,
    approve,
    approved,
    doing,
    is_address,
    listed,
    opened,
    shown_name,
    state,
)
from twinloop.test import Test

LOST = 120.0
"""Seconds after which a writer that says nothing may have ended without a word: no step is silent for much longer."""


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
        self._busy: set[str] = set()
        self._failed: dict[str, str] = {}
        with closing(opened(store)):  # an older store is brought up to date, and what is none is refused
            pass

    @property
    def title(self) -> str:
        """What pages call the store."""
        return shown_name(self.store) if is_address(self.store) else Path(self.store).name

    def campaigns(self) -> list[dict[str, object]]:
        """Name, when begun, tests and experiments of each campaign."""
        with closing(opened(self.store, read_only=True)) as base:
            return listed(base)

    def stored_as(self, name: str) -> StoredAs:
        """Under what a command finds a campaign, in the folder of the store.

        Args:
            name: of the campaign.
        """
        return StoredAs.among(self.title, name, self.campaigns())

    def look(self, name: str) -> Campaign:
        """A campaign to look at, which learns nothing.

        Args:
            name: of the campaign.

        Raises:
            InvalidInput: no such campaign.
        """
        campaign = Campaign.load(self.store, name, read_only=True, threads=self.threads, progress=None)
        campaign.interrupted = True  # what was learnt so far is enough
        return campaign

    def agreeing(self, name: str) -> Campaign:
        """The same, for what is sent to a rig: the campaign file beside the store must describe it.

        Args:
            name: of the campaign.

        Raises:
            InvalidInput: no such campaign, or another one in the file.
        """
        campaign = self.look(name)
        check_beside(self.store, campaign, name)
        return campaign

    def state(self, name: str) -> dict[str, object]:
        """Whether anything has changed, what is going on, and why the last long thing failed.

        Args:
            name: of the campaign.
        """
        with closing(opened(self.store, read_only=True)) as base:
            text, seen = state(base, name), doing(base, name)
        return {
            "state": text,
            "working": in_words(seen) if seen is not None else "Working." if name in self._busy else None,
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
        campaign = self.agreeing(name)
        if number not in [test.number for test in to_be_flown(campaign)]:
            raise InvalidInput(f"Test {number}: expected one that waits to be flown, found another one.")
        with closing(opened(self.store)) as base:
            approve(base, name, number)
        return f"Test {number} may be flown."

    def tell(self, name: str, number: int, log: Path, called: str, aborted: str) -> str:
        """Tells the flight of a test; the answer says also what speaks against it, a line for each reason.

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
            asked, read = tell(
                campaign, number, log, aborted=aborted, name=called, columns=fields_beside(self.store)
            )
            flight = [run for run in campaign.experiments if run.number == asked.number][-1]
            said = f"Test {number} recorded: {len(campaign.experiments)} experiments are stored."
            return "\n".join([said, *_against(campaign, flight, asked, read)])

    def attach(self, name: str, log: Path, called: str) -> str:
        """Attaches a flight without a test; the answer says also what speaks against it, a line for each reason.

        Args:
            name: of the campaign.
            log: CSV or .npz.
            called: what the log was called where it came from.

        Raises:
            InvalidInput: a log that cannot be used.
            StoreFailure: somebody else writes the campaign.
        """
        with self._writing(name) as campaign:
            read = attach(campaign, log, name=called, columns=fields_beside(self.store))
            said = f"Attached: {len(campaign.experiments)} experiments are stored."
            return "\n".join([said, *_against(campaign, campaign.experiments[-1], None, read)])

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

    def withdraw(self, name: str, which: str, reason: str) -> str:
        """Takes back a flight that was recorded by mistake.

        Args:
            name: of the campaign.
            which: number of a test, or attached-N. A file of this machine, as the command takes it, is none of them.
            reason: what was wrong with it.

        Raises:
            InvalidInput: no such flight, or no reason.
            StoreFailure: somebody else writes the campaign.
        """
        with self._writing(name, agreeing=False) as campaign:
            known = recorded(campaign)
            if which not in known:
                raise InvalidInput(
                    f"Withdraw: expected a recorded flight, {' or '.join(known) or 'of which there is none'}, found"
                    f" {which}; nothing was changed."
                )
            campaign.withdraw(chosen(campaign, which), reason)
            said = f"Withdrawn: {known[which]}. {counted(campaign)} left."
            return " ".join([said, *given_up_words(campaign)])

    def ask(self, name: str, last: bool) -> str:
        """Begins to plan the next test; it goes on behind.

        Args:
            name: of the campaign.
            last: whether no other test will follow.

        Raises:
            InvalidInput: something is under way already.
        """

        def plan() -> None:
            with self._campaign(name) as campaign:
                check_beside(self.store, campaign, name)
                if not campaign.experiments:
                    raise NotAvailable(
                        "Ask: expected a recorded flight, found none; record the first test, or attach a flight."
                    )
                campaign.ask(last=last)

        if not self._turn.acquire(blocking=False):
            raise InvalidInput("Ask: expected no other task to be running, found one; wait until it is done.")
        try:
            self._failed.pop(name, None)
            self._busy.add(name)
            threading.Thread(target=self._behind, args=(name, plan), daemon=True).start()
        except BaseException:
            self._busy.discard(name)
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
            self._busy.discard(name)
            self._turn.release()

    @contextmanager
    def _writing(self, name: str, agreeing: bool = True) -> Iterator[Campaign]:
        """The campaign, with this process as its only writer, one thing at a time."""
        if not self._turn.acquire(blocking=False):
            raise InvalidInput("Expected no other task to be running, found one; wait until it is done.")
        try:
            with self._campaign(name) as campaign:
                if agreeing:
                    check_beside(self.store, campaign, name)
                yield campaign
        finally:
            self._turn.release()

    def _campaign(self, name: str) -> closing[Campaign]:
        return closing(Campaign.load(self.store, name, threads=self.threads, progress=None))


def to_be_learnt(campaign: Campaign) -> str:
    """How many flights are not learnt yet, and what to do; empty where all are.

    Args:
        campaign: to look at.
    """
    missing = unlearnt(campaign)
    return f"{missing}; to learn now, plan the next test." if missing else ""


def _against(campaign: Campaign, flight: Experiment, asked: Test | None, read: Log) -> list[str]:
    return said_against(against_it(campaign, flight, asked, read))


def in_words(seen: Doing) -> str:
    """What the writer of a campaign is doing, whatever process it is, for a person.

    Args:
        seen: in the store.
    """
    if seen.phase == "experiment":
        said = f"flying experiment {seen.told + 1} of {seen.experiments}"
    else:
        names = {"models": "evolving models", "tests": "evolving tests"}
        known = USUAL.get(seen.phase)
        what, turn = (known[0], "step") if known else (names.get(seen.phase, seen.phase), "generation")
        said = (
            f"{what}, {turn} {seen.generation} of {seen.generations};"
            f" experiments recorded: {seen.told} of {seen.experiments}"
        )
    if seen.left is not None:
        said += f"; about {duration(seen.left)} left" if seen.left >= 0.5 else "; nearly done"
    if seen.silent > LOST:
        said += f"; no progress for {duration(seen.silent)}, it may have stopped"
    return f"Working: {said}."
