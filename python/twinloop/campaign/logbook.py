"""The tests of a campaign and their runs; a bad record is refused and leaves the book as it was."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from typing import Any

from twinloop._experiment.hold_back import HoldBack
from twinloop._ground.arrays import Floats
from twinloop.campaign.entering import Judge, flown_test, partial_run, replay_of_record, with_run
from twinloop.campaign.history import Experiment, Failure, Planned, TestLoop
from twinloop.campaign.setup import Setup
from twinloop.errors import InvalidInput
from twinloop.records import Record, Recorded, checked_record, plain, read
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory, check_recorded


class Logbook(Recorded, kind="logbook"):
    """Tests by number, experiments in the order of `tell`.

    Args:
        setup: of the campaign.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.tests: list[Test] = []
        self.experiments: list[Experiment] = []
        self.asked: list[tuple[int, TestLoop | Planned]] = []
        self.failures: list[Failure] = []
        self.abandoned: list[int] = []
        self.selected = setup.none_selected()
        self.identity = uuid.uuid4().hex  # tells campaigns apart; nothing that is computed depends on it

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        return "identity", "tests", "experiments", "asked", "failures", "abandoned"

    def to_record(self) -> Record:
        """All entries: experiments and failures with the number of their test, what was asked with the iteration's."""
        return {**self._head(), "identity": self.identity, **self.entries({})}

    def entries(self, known: Mapping[str, int]) -> dict[str, list[Any]]:
        """Records of the entries of each list, which only grow.

        Args:
            known: how many of the first ones are left out, by list.
        """
        runs = self.experiments[known.get("experiments", 0) :]
        failures = self.failures[known.get("failures", 0) :]
        return {
            "tests": plain(self.tests[known.get("tests", 0) :]),
            "experiments": [[run.number, run.to_record()] for run in runs],
            "asked": plain(self.asked[known.get("asked", 0) :]),
            "failures": [[failure.test.number, failure.to_record()] for failure in failures],
            "abandoned": plain(self.abandoned[known.get("abandoned", 0) :]),
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
            at = f"{where}.experiments[{i}]"
            replayed = replay_of_record(run, setup) if number is None else book._numbered(number, at)
            read_run = Experiment.from_record(run, replayed)
            check_recorded(read_run.trajectory, setup.limits, replayed.steps, least=1)
            book.enter(read_run)
        failures = read(list[tuple[int, Any]], found["failures"], f"{where}.failures")
        for i, (number, failure) in enumerate(failures):
            at = f"{where}.failures[{i}]"
            book.failures.append(Failure.from_record(failure, book._numbered(number, at)))
        book.abandoned = read(list[int], found["abandoned"], f"{where}.abandoned")
        for i, number in enumerate(book.abandoned):
            book._numbered(number, f"{where}.abandoned[{i}]")
        book.asked = read(list[tuple[int, TestLoop | Planned]], found["asked"], f"{where}.asked")
        if not all(0 <= asked.test < len(book.tests) for _, asked in book.asked):
            raise InvalidInput(
                f"Record {where}.asked: expected numbers of tests that there are, found others."
            )
        return book

    def first(self, told: int) -> Logbook:
        """The same tests with the first experiments only.

        Args:
            told: how many.

        Raises:
            InvalidInput: there are fewer.
        """
        if not 0 < told <= len(self.experiments):
            raise InvalidInput(
                f"Logbook: expected 1 to {len(self.experiments)} experiments, found {told}; what was learnt belongs to"
                " another campaign."
            )
        book = self.copied()
        book.experiments, book.selected = [], self.setup.none_selected()
        for run in self.experiments[:told]:
            book.enter(run)
        return book

    def copied(self) -> Logbook:
        """The same entries in a book of its own."""
        book = Logbook(self.setup)
        book.tests, book.experiments, book.asked = list(self.tests), list(self.experiments), list(self.asked)
        book.failures, book.abandoned = list(self.failures), list(self.abandoned)
        book.selected, book.identity = self.selected, self.identity
        return book

    @property
    def revision(self) -> int:
        """Number of entries; it grows with each."""
        return len(self.tests) + len(self.experiments) + len(self.failures) + len(self.abandoned)

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
        self.selected = with_run(self.selected, run.replayed, run.trajectory)
        self.experiments.append(run)

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
        self.failures.append(Failure(own, reason, recorded=recorded is not None))

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

    @property
    def flown(self) -> set[int]:
        """Numbers of the tests that were flown, whatever became of them."""
        told = {run.test.number for run in self.experiments if run.test is not None}
        return told | {failure.test.number for failure in self.failures}

    @property
    def outcomes(self) -> int:
        """Number of experiments and failures; it grows with each."""
        return len(self.experiments) + len(self.failures)

    @property
    def runs(self) -> int:
        """Runs of tests on the system, the failed ones too."""
        told = sum(run.test is not None for run in self.experiments)
        return told + sum(not failure.recorded for failure in self.failures)

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
