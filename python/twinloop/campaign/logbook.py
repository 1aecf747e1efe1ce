"""What a campaign asked for and what it was told; a bad record is refused and leaves the book as it was."""

from __future__ import annotations

import dataclasses
import math
import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.campaign.history import Experiment, Failure, Iteration, Lesson, Planned, TestLoop
from twinloop.campaign.setup import Setup
from twinloop.errors import InvalidInput, engine_input
from twinloop.hold_back import HoldBack
from twinloop.objectives import frozen_error
from twinloop.records import Record, Recorded, checked_record, plain, read
from twinloop.replay import Replay
from twinloop.test import Test, check_signals, final_distance
from twinloop.trajectory import Trajectory, check_recorded, continued

FAR = 5.0
"""A first reading is refused if it is this many times further off than the second, and than the next readings move."""
NEXT = 9
"""Readings after the first that are looked at for this."""
Asked = TypeVar("Asked", TestLoop, Planned)
Judge = Callable[[_core.SelectedTests], float | None]
"""The error, on the one test of a set, of what is known so far; None where nothing is."""


class Logbook(Recorded, kind="logbook"):
    """Tests by number, experiments in the order they were told.

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
            replayed = _attached(run, setup) if number is None else book._numbered(number, at)
            book._enter(Experiment.from_record(run, replayed))
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
            book._enter(run)
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

    def enter_loop(self, iteration: int, test: Test, search: _core.TestSearch) -> None:
        """Enters the test loop that gave a test.

        Args:
            iteration: of the models that judged it.
            test: that it gave.
            search: at its end.
        """
        assert test.predicted is not None
        loop = TestLoop(
            test=test.number,
            genes=tuple(test.genes.tolist()),
            objectives=tuple(search.best_objectives.tolist()),
            flat=search.flat,
            generations=search.generation,
            archive_size=search.archive_size,
            evaluations=search.evaluations,
            predicted=test.predicted,
        )
        self.asked.append((iteration, loop))

    def enter_plan(self, iteration: int, planned: Planned) -> None:
        """Enters a test that was planned, and why.

        Args:
            iteration: of the models that judged it.
            planned: what was expected of it.
        """
        self.asked.append((iteration, planned))

    def tell(self, test: object, trajectory: object, judge: Judge, least: int = 2) -> None:
        """Enters an experiment.

        Args:
            test: that was run.
            trajectory: what the system answered.
            judge: the error on it of what is known so far.
            least: steps that it must have.

        Raises:
            InvalidInput: a test of another campaign, or a trajectory that cannot be learnt from.
        """
        known, signals = self.known(test), self.setup.signals
        recorded = check_recorded(trajectory, self.setup.limits, known.steps, least)
        recorded = continued(recorded, signals, known.initial_state)
        _check_first_reading(recorded, known)
        before = judge(_with_run(self.setup.none_selected(), known, recorded))
        distance = quality = None
        if recorded.ended == "completed" and recorded.steps == known.steps:
            distance = quality = final_distance(recorded.states[-1], known.target(known.steps), signals)
            if self.setup.preset != "paper":
                quality = self.setup.quality.flown(recorded, known.target_state)
        self._enter(Experiment(known, recorded, before, frozen_error(recorded, signals), distance, quality))

    def attach(self, trajectory: object, judge: Judge) -> None:
        """Enters a run that nobody asked for.

        Args:
            trajectory: what was recorded, of any length.
            judge: the error on it of what is known so far.

        Raises:
            InvalidInput: a trajectory that cannot be learnt from.
        """
        signals = self.setup.signals
        recorded = check_recorded(trajectory, self.setup.limits, None)
        recorded = continued(recorded, signals, recorded.states[0])
        replayed = Replay(signals, recorded.states[0], recorded.commands)
        before = judge(_with_run(self.setup.none_selected(), replayed, recorded))
        self._enter(
            Experiment(replayed, recorded, before, frozen_error(recorded, signals), None, None, attached=True)
        )

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
        known = self.known(test)
        if not isinstance(reason, str) or not reason.strip():
            raise InvalidInput(
                f"Campaign.tell_failed, reason: expected what happened, in words, found {reason!r}; write it down."
            )
        if isinstance(partial, Trajectory):
            ended = "diverged" if partial.ended == "diverged" else "aborted"
            partial = dataclasses.replace(partial, ended=ended, reason=reason)
        if partial is not None:
            self.tell(known, partial, judge, least=1)
        self.failures.append(Failure(known, reason, recorded=partial is not None))

    def abandon(self, test: object) -> None:
        """Enters that a test will not be flown.

        Args:
            test: that was asked for.

        Raises:
            InvalidInput: a test of another campaign, or one that was flown.
        """
        known = self.known(test)
        if known.number in self.flown:
            raise InvalidInput(
                f"Campaign.abandon: expected a test that was not flown, found test {known.number}, of which"
                " a run was told; nothing is left to abandon."
            )
        self.abandoned.append(known.number)

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

    def status(self, test: object) -> str:
        """Where a test is in its life: "asked", "flown", "aborted", "failed" or "abandoned".

        Args:
            test: of this campaign.
        """
        number = self.known(test).number
        runs = [run for run in self.experiments if run.number == number]
        if any(failure.test.number == number for failure in self.failures):
            return "failed"
        if runs:
            return "flown" if any(run.complete for run in runs) else "aborted"
        return "abandoned" if number in self.abandoned else "asked"

    def measured(self, test: int) -> float | None:
        """Quality of a test on the system, mean over complete runs; None if there was none.

        Args:
            test: its number.
        """
        values = [run.quality for run in self.experiments if run.number == test and run.quality is not None]
        return math.fsum(values) / len(values) if values else None

    def best(self) -> Test | None:
        """The flown test of the best quality; the first one if no run was complete, None if no test was flown.

        Tests that are not known to fly, of which the paper knows nothing, come after all others; then those that began
        or led elsewhere than the campaign's own task, whose quality says nothing of it.
        """

        def rank(test: Test) -> tuple[bool, bool, bool, float]:
            measured = self.measured(test.number)
            if measured is None:
                return True, True, True, math.inf
            unfit = self.setup.preset != "paper" and not self.flies(test.number)
            return False, unfit, not self.on_task(test), measured

        flown = (run.test for run in self.experiments if run.test is not None)
        return min(flown, key=rank, default=None)

    def first_flown(self) -> Experiment | None:
        """The first run of a test, if there is any."""
        return next((run for run in self.experiments if run.test is not None), None)

    def flies(self, test: int) -> bool:
        """Whether a test is known to fly: each of its runs went to its end inside the envelope.

        Args:
            test: its number.
        """
        runs = [run for run in self.experiments if run.number == test]
        return bool(runs) and all(run.kept_envelope for run in runs) and not self.failed(test)

    def finishes(self, test: int) -> bool:
        """Whether each run of a test went to its end, inside the envelope or not.

        Args:
            test: its number.
        """
        runs = [run for run in self.experiments if run.number == test]
        return bool(runs) and all(run.complete for run in runs) and not self.failed(test)

    def unfit(self) -> list[Floats]:
        """Genes of tests that failed on the system, or were cut."""
        return [self.tests[number].genes for number in sorted(self.flown) if not self.finishes(number)]

    def failed(self, test: int) -> bool:
        """Whether a test has failed on the system.

        Args:
            test: its number.
        """
        return any(failure.test.number == test for failure in self.failures)

    def on_task(self, test: Test) -> bool:
        """Whether a test begins and leads where the campaign does.

        Args:
            test: of the campaign.
        """
        ends = (test.initial_state, self.setup.initial_state), (test.target_state, self.setup.target_state)
        return all(np.array_equal(*pair) for pair in ends)

    def waiting(self) -> list[Test]:
        """Tests that were asked for, and neither told nor abandoned, in their order."""
        done = self.flown | set(self.abandoned)
        return [self.tests[entry.test] for _, entry in self.asked if entry.test not in done]

    def made(self) -> Test | None:
        """Before there is a run of any test: the last one that was made, and neither failed nor was abandoned."""
        done = self.flown | set(self.abandoned)
        undone = [test for test in self.tests if test.number not in done]
        return undone[-1] if undone and self.first_flown() is None else None

    def with_plans(self, records: Sequence[Lesson]) -> tuple[Lesson, ...]:
        """Lessons with the tests that were planned after each.

        Args:
            records: of the identifications.

        Returns:
            The same, complete.
        """
        return tuple(
            dataclasses.replace(record, asked=self._asked_after(record.iteration, Planned))
            for record in records
        )

    def with_loops(self, records: Sequence[Iteration]) -> tuple[Iteration, ...]:
        """Iterations with the test loops that followed each.

        Args:
            records: of the model loop.

        Returns:
            The same, complete.
        """
        return tuple(
            dataclasses.replace(record, asked=self._asked_after(record.iteration, TestLoop))
            for record in records
        )

    def _asked_after(self, iteration: int, kind: type[Asked]) -> tuple[Asked, ...]:
        """What was asked for after an iteration, with the quality flown so far."""
        return tuple(
            dataclasses.replace(asked, flown=self.measured(asked.test))
            for after, asked in self.asked
            if after == iteration and isinstance(asked, kind)
        )

    def _enter(self, run: Experiment) -> None:
        check_recorded(run.trajectory, self.setup.limits, run.replayed.steps, least=1)
        self.selected = _with_run(self.selected, run.replayed, run.trajectory)
        self.experiments.append(run)

    def _numbered(self, number: int, where: str) -> Test:
        if not 0 <= number < len(self.tests):
            raise InvalidInput(f"Record {where}: expected the number of a test, found {number}.")
        return self.tests[number]

    def known(self, test: object) -> Test:
        """A test of this campaign.

        Args:
            test: to be looked up.

        Raises:
            InvalidInput: it is none.
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


def _attached(record: object, setup: Setup) -> Replay:
    """What a twin flies to be compared with a recorded run that nobody asked for."""
    found = record.get("trajectory") if isinstance(record, Mapping) else None
    trajectory = Trajectory.from_record(found)
    return Replay(setup.signals, trajectory.states[0], trajectory.commands)


def _with_run(selected: _core.SelectedTests, test: Test | Replay, run: Trajectory) -> _core.SelectedTests:
    with engine_input():
        if isinstance(test, Replay):
            return selected.with_record(run.states, run.commands)
        held = None if test.hold_back is None else test.hold_back.engine
        return selected.with_test(
            test.genes, test.target_state, run.states, run.commands, test.excitation, held
        )


def _check_first_reading(trajectory: Trajectory, test: Test) -> None:
    """Refuses a first reading that only a sensor that was not ready can have given: free runs begin there."""
    if trajectory.steps < NEXT:
        return
    scales = np.array([state.scale for state in test.family.signals.states])
    first, second = np.abs(trajectory.states[:2] - test.initial_state)
    # What the next readings do of themselves: their noise, and what the system does in a period.
    usual = np.abs(np.diff(trajectory.states[1 : NEXT + 1], axis=0)).max(axis=0)
    wrong = (first > 0.01 * scales) & (first > FAR * second) & (first > FAR * usual)
    for i in np.flatnonzero(wrong):
        state = test.family.signals.states[int(i)]
        raise InvalidInput(
            f"Campaign.tell: expected {state.name} to begin near {test.initial_state[i]:g} {state.unit}, found"
            f" {trajectory.states[0, i]:g} in the first row and {trajectory.states[1, i]:g} in the second; the sensor"
            " was not ready: put into the first row what the state was, or run the test again."
        )
