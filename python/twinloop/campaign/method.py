"""The parts of a method: it learns from the runs, plans the next test, and names the controller to fly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from twinloop import _core
from twinloop._experiment.hold_back import HoldBack
from twinloop._ground.arrays import Floats
from twinloop.campaign.examination.rivals import Rival
from twinloop.campaign.examination.unseen import TwinBefore
from twinloop.campaign.history import Iteration, Lesson
from twinloop.campaign.logbook import Logbook
from twinloop.law.twin import Twin
from twinloop.records import Record
from twinloop.test import Test


class Knowledge(Protocol):
    """What was learnt, as a twin and as the numbers that an engineer looks at."""

    def twin(self, workers: _core.Workers | None = None) -> Twin:
        """The best model.

        Args:
            workers: that work out its errors on all runs; None: they are of no interest.
        """
        ...

    def twins_before(self) -> tuple[TwinBefore, ...]:
        """Earlier twins, the oldest first."""
        ...

    def innovations(self, workers: _core.Workers) -> tuple[Floats, ...] | None:
        """Innovations of each experiment that was learnt: readings less their predictions one period before.

        Args:
            workers: how the work is carried out.

        Returns:
            Over the standard deviation that is expected of them (n + 1, n_x); None where the method knows no noise, or
            the model diverges.
        """
        ...

    def rivals(self) -> tuple[Rival, ...]:
        """Sums of terms that were considered for the twin, the chosen ones among them."""
        ...


class Method(Protocol):
    """One way through the double loop."""

    memory: Any
    """All that it remembers: one value that never changes, so that a copy of a campaign may share it."""

    def to_record(self) -> Record:
        """What it remembers, as numbers, texts, lists and dicts."""
        ...

    def restore(self, record: object, book: Logbook) -> None:
        """Remembers what a record holds.

        Args:
            record: such as `to_record` gives, or JSON gives back.
            book: with the runs at the time when it was written.

        Raises:
            InvalidInput: no such record, or one of another campaign; what was remembered is so still.
        """
        ...

    @property
    def iteration(self) -> int:
        """Number of the turn of the loop that is running or was the last."""
        ...

    def learnt_by(self, iteration: int) -> int:
        """Number of experiments that a turn of the loop has learnt, after which a test was asked for.

        Args:
            iteration: its number.
        """
        ...

    def forget(self, book: Logbook, asked_since: bool) -> None:
        """Forgets a flight that was withdrawn, and all that was learnt with it.

        What was learnt at each `ask` is learnt again from what is left by the next call of `learn`.

        Args:
            book: without the flight.
            asked_since: whether a test was asked for after it was told.
        """
        ...

    def learn(self, book: Logbook, at_once: bool = False) -> None:
        """Learns all runs, starting from the state at the last `ask`.

        What is learnt is thus a function of what was asked and told, not of who looked at it in between.

        Args:
            book: with at least one experiment.
            at_once: whether what is known so far is enough, after an interruption.

        Raises:
            KeyboardInterrupt: what was known before is still known; calling again goes on.
        """
        ...

    def ask(self, book: Logbook, last: bool) -> Test:
        """Plans a test and enters it; all runs are learnt.

        Args:
            book: where it is entered.
            last: whether no other experiment will follow.
        """
        ...

    def waiting_last(self, book: Logbook) -> Test | None:
        """The waiting test that is what `ask` plans as the last one; None: there is none. All runs are learnt.

        Args:
            book: with at least one experiment.
        """
        ...

    def best_test(self, book: Logbook, at_once: bool = False) -> Test:
        """The controller to fly; all runs are learnt.

        Args:
            book: with at least one experiment.
            at_once: whether the gains that were tuned last are enough.

        Raises:
            NotAvailable: there is none.
        """
        ...

    def first_excitation(self, number: int, genes: Floats) -> tuple[Floats | None, HoldBack | None]:
        """What is added to the commands of a test with gains of the user's own, where nothing else is asked for.

        And what holds that back.
        """
        ...

    def knowledge(self, book: Logbook) -> Knowledge:
        """What was learnt, for a person to look at; all runs are learnt."""
        ...

    @property
    def asked_model(self) -> _core.Model | None:
        """The best model when the last test was asked for; None before."""
        ...

    def history(self, book: Logbook) -> tuple[Iteration, ...] | tuple[Lesson, ...]:
        """A record of each turn."""
        ...

    def committee(self) -> Sequence[_core.Model]:
        """Models that judge tests, the best first."""
        ...
