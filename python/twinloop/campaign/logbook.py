"""The tests of a campaign and their runs; a bad record is refused and leaves the book as it was."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from typing import Any

from twinloop._experiment.hold_back import HoldBack
from twinloop._ground.arrays import Floats
from twinloop.campaign.entering import (
    Judge,
    flown_test,
    partial_run,
    renewed_run,
    replay_of_record,
    with_run,
)
from twinloop.campaign.history import IN_SCALES, Experiment, Failure, Planned, TestLoop, Withdrawal
from twinloop.campaign.setup import Setup
from twinloop.campaign.withdrawing import as_it_counts, check_withdrawals, withdrawal_of
from twinloop.errors import InvalidInput
from twinloop.records import Record, Recorded, checked_record, plain, read
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory, check_recorded


class Logbook(Recorded, kind="logbook"):
    """Tests by number, experiments in the order of `tell`.

    `recorded` and `reported` hold all runs and failures, in their order; `experiments` and `failures` those that count,
    because they were not withdrawn.

    Args:
        setup: of the campaign.
    """

    VERSION = 2

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.tests: list[Test] = []
        self.recorded: list[Experiment] = []
        self.experiments: list[Experiment] = []
        self.asked: list[tuple[int, TestLoop | Planned]] = []
        self.reported: list[Failure] = []
        self.failures: list[Failure] = []
        self.abandoned: list[int] = []
        self.withdrawals: list[Withdrawal] = []
        self.selected = setup.none_selected()
        self.identity = uuid.uuid4().hex  # tells campaigns apart; nothing that is computed depends on it

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        return "identity", "tests", "experiments", "asked", "failures", "abandoned", "withdrawals"

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of an earlier version, in which no flight could be withdrawn."""
        return {"withdrawals": [], **super().renewed(record)}

    def to_record(self) -> Record:
        """All entries: experiments and failures with the number of their test, what was asked with the iteration's."""
        return {**self._head(), "identity": self.identity, **self.entries({})}

    def entries(self, known: Mapping[str, int]) -> dict[str, list[Any]]:
        """Records of the entries of each list, which only grow.

        Args:
            known: how many of the first ones are left out, by list.
        """
        runs = self.recorded[known.get("experiments", 0) :]
        failures = self.reported[known.get("failures", 0) :]
        return {
            "tests": plain(self.tests[known.get("tests", 0) :]),
            "experiments": [[run.number, run.to_record()] for run in runs],
            "asked": plain(self.asked[known.get("asked", 0) :]),
            "failures": [[failure.test.number, failure.to_record()] for failure in failures],
            "abandoned": plain(self.abandoned[known.get("abandoned", 0) :]),
            "withdrawals": plain(self.withdrawals[known.get("withdrawals", 0) :]),
        }

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Logbook:
        found = checked_record(record, cls, cls.recorded_fields(), where)
        (setup,) = (value for value in given if isinstance(value, Setup))
        book = cls(setup)
        book.identity = read(str, found["identity"], f"{where}.identity")
        book.tests = read(list[Test], found["tests"], f"{where}.tests", (setup.family,))
        for number, test in enumerate(book.tests):
            if (test.number, test.campaign) != (number, book.identity):
                raise InvalidInput(
                    f"Record {where}.tests[{number}]: expected test {number} of this campaign, found test"
                    f" {test.number} of another place; keep the tests in their order."
                )
        runs = read(list[tuple[int | None, Any]], found["experiments"], f"{where}.experiments")
        for i, (number, run) in enumerate(runs):
            book.recorded.append(book._run(number, run, f"{where}.experiments[{i}]"))
        failures = read(list[tuple[int, Any]], found["failures"], f"{where}.failures")
        for i, (number, failure) in enumerate(failures):
            book.reported.append(book._failure(number, failure, f"{where}.failures[{i}]"))
        book.abandoned = read(list[int], found["abandoned"], f"{where}.abandoned")
        for i, number in enumerate(book.abandoned):
            book._numbered(number, f"{where}.abandoned[{i}]")
        book.asked = read(list[tuple[int, TestLoop | Planned]], found["asked"], f"{where}.asked")
        if not all(0 <= asked.test < len(book.tests) for _, asked in book.asked):
            raise InvalidInput(
                f"Record {where}.asked: expected numbers of tests that there are, found others."
            )
        book.withdrawals = read(list[Withdrawal], found["withdrawals"], f"{where}.withdrawals")
        check_withdrawals(book, f"{where}.withdrawals")
        book._recount()
        return book

    def check_readable(self, entries: Mapping[str, list[Any]]) -> None:
        """Refuses entries of this book that could not be read again: with them the whole campaign would be lost.

        Args:
            entries: their records, as `entries` gives them.

        Raises:
            InvalidInput: one of them has a value that is refused on reading.
        """
        read(list[Test], entries["tests"], "logbook.tests", (self.setup.family,))
        for number, run in entries["experiments"]:
            self._run(number, run, "logbook.experiments")
        for number, failure in entries["failures"]:
            self._failure(number, failure, "logbook.failures")
        read(list[tuple[int, TestLoop | Planned]], entries["asked"], "logbook.asked")
        read(list[Withdrawal], entries["withdrawals"], "logbook.withdrawals")

    def _run(self, number: int | None, record: Any, where: str) -> Experiment:
        """An experiment that can be learnt from, of its record behind the number of its test."""
        replayed = replay_of_record(record, self.setup) if number is None else self._numbered(number, where)
        run = Experiment.from_record(record, replayed)
        if record["version"] < IN_SCALES and self.setup.in_scales:
            run = renewed_run(run, self.setup)
        check_recorded(run.trajectory, self.setup.limits, replayed.steps, least=1)
        return run

    def _failure(self, number: int, record: Any, where: str) -> Failure:
        return Failure.from_record(record, self._numbered(number, where))

    def first(self, experiments: int) -> Logbook:
        """The same tests with the first experiments only.

        Args:
            experiments: how many.

        Raises:
            InvalidInput: there are fewer.
        """
        self.check_known(experiments)
        book = self.copied()
        book.recorded, book.withdrawals = self.experiments[:experiments], []
        book.reported = list(self.failures)
        book._recount()
        return book

    def check_known(self, experiments: int) -> None:
        """Refuses a number of first experiments that there are not.

        Args:
            experiments: how many.

        Raises:
            InvalidInput: there are fewer.
        """
        if not 0 < experiments <= len(self.experiments):
            raise InvalidInput(
                f"Logbook: expected 1 to {len(self.experiments)} experiments, found {experiments}; what was learnt"
                " belongs to another campaign."
            )

    def when_asked(self, known: int, test: int) -> Logbook:
        """The book as it was when a test was asked for, without what was withdrawn since.

        Failures without a record are in it if their tests were made before: the book has no other order of both.

        Args:
            known: how many of the experiments there were.
            test: number of the test.
        """
        book = self.first(known)
        tests = {run.number for run in book.experiments}
        book.reported = [
            failure
            for failure in self.failures
            if (failure.test.number in tests if failure.recorded else failure.test.number < test)
        ]
        book._recount()
        return book

    def to_learn_again(self, learnt: int) -> list[Logbook]:
        """The books of the tests that were asked for before the last withdrawal, as they would have been without.

        Args:
            learnt: number of experiments that were known at the last `ask` that is remembered; those books are left
                out.
        """
        known = self.withdrawals[-1].known if self.withdrawals else ()
        asked = [(count, entry.test) for count, (_, entry) in zip(known, self.asked, strict=False)]
        return [self.when_asked(count, test) for count, test in asked if count > learnt]

    @property
    def forgot_last_ask(self) -> bool:
        """Whether what was known at the last `ask` was learnt with a flight that was withdrawn since."""
        return any(each.planned and len(each.known) == len(self.asked) for each in self.withdrawals)

    def same_flights(self, other: Logbook) -> bool:
        """Whether as many experiments and failures count as in another state of the book."""
        mine, others = (len(book.experiments) for book in (self, other))
        return mine == others and len(self.failures) == len(other.failures)

    def copied(self) -> Logbook:
        """The same entries in a book of its own."""
        book = Logbook(self.setup)
        book.tests, book.asked, book.abandoned = list(self.tests), list(self.asked), list(self.abandoned)
        book.recorded, book.experiments = list(self.recorded), list(self.experiments)
        book.reported, book.failures = list(self.reported), list(self.failures)
        book.withdrawals = list(self.withdrawals)
        book.selected, book.identity = self.selected, self.identity
        return book

    @property
    def revision(self) -> int:
        """Number of entries; it grows with each."""
        return len(self.tests) + len(self.abandoned) + self.outcomes

    def new_test(
        self,
        genes: Floats,
        *,
        excitation: Floats | None = None,
        predicted: float | None = None,
        spread: float | None = None,
        risk: float | None = None,
        reason: str = "",
        initial_state: Floats | None = None,
        target_state: Floats | None = None,
        hold_back: HoldBack | None = None,
    ) -> Test:
        """Enters a test.

        Args:
            genes: gains (size,), in their units.
            excitation: what is added to the controller's commands (n, n_u), in their units; None: nothing.
            predicted: quality that is expected.
            spread: standard deviation of it.
            risk: probability that the flight leaves the envelope.
            reason: why this test.
            initial_state: where it starts (n_x,); None: where the campaign does.
            target_state: where it leads (n_x,); None: where the campaign does.
            hold_back: what holds the excitation back while it flies; None: nothing does.

        Returns:
            The test, under the next number.
        """
        test = Test(
            self.setup.family,
            genes,
            self.setup.initial_state if initial_state is None else initial_state,
            self.setup.target_state if target_state is None else target_state,
            self.setup.steps,
            excitation,
            number=len(self.tests),
            campaign=self.identity,
            predicted=predicted,
            spread=spread,
            risk=risk,
            reason=reason,
            hold_back=hold_back,
        )
        self.tests.append(test)
        return test

    def of_task(self, genes: Floats, number: int) -> Test:
        """A test of the campaign's own task without excitation; it is not entered.

        Args:
            genes: gains (size,), in their units.
            number: that it is given.
        """
        setup = self.setup
        ends = setup.initial_state, setup.target_state
        return Test(setup.family, genes, *ends, setup.steps, number=number, campaign=self.identity)

    def enter(self, run: Experiment) -> None:
        """Enters a run that was checked.

        Args:
            run: of a test of this campaign, or an attached run.
        """
        counting = as_it_counts(run, len(self.recorded), self)
        self.selected = with_run(self.selected, counting.replayed, counting.trajectory)
        self.recorded.append(run)
        self.experiments.append(counting)

    def fail(self, test: object, reason: str, partial: Trajectory | None, judge: Judge) -> None:
        """Enters that a test failed on the system.

        Args:
            test: that was flown.
            reason: what happened.
            partial: what was recorded until then, of at least one step.
            judge: the error on it of what is known so far.

        Raises:
            InvalidInput: a test of another campaign, no reason, or a record that cannot be learnt from.
        """
        own = self.own(test)
        recorded = partial_run(partial, reason)
        if recorded is not None:
            self.enter(flown_test(self.setup, own, recorded, judge, least=1))
        self._report(Failure(own, reason, recorded=recorded is not None))

    def abandon(self, test: object) -> None:
        """Enters that a test will not be flown.

        Args:
            test: that was asked for.

        Raises:
            InvalidInput: a test of another campaign, or one that was flown.
        """
        own = self.own(test)
        if own.number in self.flown:
            raise InvalidInput(
                f"Campaign.abandon: expected a test that was not flown, found test {own.number}, which"
                " has a recorded run; there is nothing to abandon."
            )
        self.abandoned.append(own.number)

    def withdraw(self, which: object, reason: str, known: Sequence[int]) -> Withdrawal:
        """Enters that a flight counts no more; tests that were planned with it and wait are abandoned.

        Args:
            which: test, its number, an experiment or a failure.
            reason: what was wrong with it.
            known: of each test that was asked for, how many of the experiments it was planned from.

        Returns:
            The entry.

        Raises:
            InvalidInput: nothing of that kind counts, or no reason.
        """
        withdrawal = withdrawal_of(self, which, reason, known)
        self.withdrawals.append(withdrawal)
        self._recount()
        # Their risk was predicted by a twin that had learnt a withdrawn flight; this one's own test may be among them.
        doubtful = {number for each in self.withdrawals for number in each.planned}
        self.abandoned += [test.number for test in self.waiting() if test.number in doubtful]
        return withdrawal

    def _report(self, failure: Failure) -> None:
        self.reported.append(failure)
        self.failures.append(failure)

    def _recount(self) -> None:
        """What counts, of all that was entered."""
        runs, failures = ({getattr(each, key) for each in self.withdrawals} for key in ("run", "failure"))
        self.experiments = [
            as_it_counts(run, place, self) for place, run in enumerate(self.recorded) if place not in runs
        ]
        self.failures = [failure for place, failure in enumerate(self.reported) if place not in failures]
        self.selected = self.setup.none_selected()
        for run in self.experiments:
            self.selected = with_run(self.selected, run.replayed, run.trajectory)

    @property
    def flown(self) -> set[int]:
        """Numbers of the tests that were flown, whatever became of them."""
        told = {run.number for run in self.experiments if run.number is not None}
        return told | {failure.test.number for failure in self.failures}

    @property
    def outcomes(self) -> int:
        """Number of runs, failures and withdrawals; it grows with each."""
        return len(self.recorded) + len(self.reported) + len(self.withdrawals)

    @property
    def runs(self) -> int:
        """Runs of tests on the system, the failed ones too, and withdrawn ones until their test is told anew."""
        told = sum(run.number is not None for run in self.experiments)
        return told + sum(not failure.recorded for failure in self.failures) + len(self.only_withdrawn)

    @property
    def only_withdrawn(self) -> set[int]:
        """Numbers of tests of which everything that was told was withdrawn: they were flown all the same."""
        return {each.test for each in self.withdrawals if each.test is not None} - self.flown

    def waiting(self) -> list[Test]:
        """Tests from `ask` that wait for their run: neither told nor abandoned, in order."""
        done = self.flown | set(self.abandoned)
        return [self.tests[entry.test] for _, entry in self.asked if entry.test not in done]

    def _numbered(self, number: int, where: str) -> Test:
        if not 0 <= number < len(self.tests):
            raise InvalidInput(f"Record {where}: expected the number of a test, found {number}.")
        return self.tests[number]

    def own(self, test: object) -> Test:
        """A test of this campaign.

        Args:
            test: to be looked up.

        Returns:
            The test as the logbook holds it.

        Raises:
            InvalidInput: a test of another campaign, or a changed one.
        """
        check_signals(test, self.setup.signals)
        assert isinstance(test, Test)  # check_signals has refused everything else
        if test.number >= len(self.tests) or not self.tests[test.number].same_as(test):
            raise InvalidInput(
                f"Campaign: expected a test of this campaign as it was made, found test {test.number} "
                "of another one, or changed; "
                "tell it to the campaign that made it, or make it here with campaign.test(gains)."
            )
        return self.tests[test.number]
