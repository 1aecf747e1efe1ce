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
from twinloop.errors import InvalidInput, engine_input
from twinloop.history import Experiment, Iteration, Lesson, Planned, TestLoop
from twinloop.objectives import frozen_error
from twinloop.records import Record, Recorded, checked_record, plain, read
from twinloop.setup import Setup
from twinloop.test import Test, check_signals, final_distance
from twinloop.trajectory import Trajectory, check_recorded, continued

FAR = 5.0
"""A first reading is refused if it is this many times further off than the second, and than the next readings move."""
NEXT = 9
"""Readings after the first that are looked at for this."""
Asked = TypeVar("Asked", TestLoop, Planned)


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
        self.selected = setup.none_selected()
        self.identity = uuid.uuid4().hex  # tells campaigns apart; nothing that is computed depends on it

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        return "identity", "tests", "experiments", "asked"

    def to_record(self) -> Record:
        """All entries: experiments with the number of their test, what was asked with that of the iteration."""
        return {**self._head(), "identity": self.identity, **self.entries({})}

    def entries(self, known: Mapping[str, int]) -> dict[str, list[Any]]:
        """Records of the entries of each list, which only grow.

        Args:
            known: how many of the first ones are left out, by list.
        """
        runs = self.experiments[known.get("experiments", 0) :]
        return {
            "tests": plain(self.tests[known.get("tests", 0) :]),
            "experiments": [[run.test.number, run.to_record()] for run in runs],
            "asked": plain(self.asked[known.get("asked", 0) :]),
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
        runs = read(list[tuple[int, Any]], found["experiments"], f"{where}.experiments")
        for i, (number, run) in enumerate(runs):
            at = f"{where}.experiments[{i}]"
            if not 0 <= number < len(book.tests):
                raise InvalidInput(f"Record {at}: expected the number of a test, found {number}.")
            book._enter(Experiment.from_record(run, book.tests[number]))
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
        book.selected, book.identity = self.selected, self.identity
        return book

    @property
    def revision(self) -> int:
        """Number of entries; it grows with each."""
        return len(self.tests) + len(self.experiments)

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
        )
        self.tests.append(test)
        return test

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

    def tell(
        self, test: object, trajectory: Trajectory, judge: Callable[[_core.SelectedTests], float | None]
    ) -> None:
        """Enters an experiment.

        Args:
            test: that was run.
            trajectory: what the system answered.
            judge: the error on it of what is known so far.

        Raises:
            InvalidInput: a test of another campaign, or a trajectory that cannot be learnt from.
        """
        known = self._known(test)
        check_recorded(trajectory, self.setup.signals, known.steps, self.setup.options.divergence_factor)
        trajectory = continued(trajectory, self.setup.signals, known.initial_state)
        _check_first_reading(trajectory, known)
        before = judge(_with_run(self.setup.none_selected(), known, trajectory))
        complete = trajectory.ended == "completed" and trajectory.steps == known.steps
        distance = None
        if complete:
            distance = final_distance(trajectory.states[-1], known.target_state, self.setup.signals)
        quality = distance
        if complete and self.setup.preset != "paper":
            quality = self.setup.quality.flown(trajectory, known.target_state)
        self._enter(
            Experiment(
                known, trajectory, before, frozen_error(trajectory, self.setup.signals), distance, quality
            )
        )

    def measured(self, test: int) -> float | None:
        """Quality of a test on the system, mean over complete runs; None if there was none.

        Args:
            test: its number.
        """
        values = [
            run.quality for run in self.experiments if run.test.number == test and run.quality is not None
        ]
        return math.fsum(values) / len(values) if values else None

    def best(self) -> Test:
        """The flown test of the best quality; the first one if no run was complete.

        Tests that left the envelope, of which the paper knows nothing, come after all others; then those that began or
        led elsewhere than the campaign's own task, whose quality says nothing of it.
        """

        def rank(test: Test) -> tuple[bool, bool, float]:
            measured = self.measured(test.number)
            if measured is None:
                return True, True, math.inf
            left = self.setup.preset != "paper" and self.left_envelope(test.number)
            return left, not self.on_task(test), measured

        return min((run.test for run in self.experiments), key=rank)

    def on_task(self, test: Test) -> bool:
        """Whether a test begins and leads where the campaign does.

        Args:
            test: of the campaign.
        """
        ends = (test.initial_state, self.setup.initial_state), (test.target_state, self.setup.target_state)
        return all(np.array_equal(*pair) for pair in ends)

    def left_envelope(self, test: int) -> bool:
        """Whether any run of a test left the envelope.

        Args:
            test: its number.
        """
        return any(run.left_envelope for run in self.experiments if run.test.number == test)

    def waiting(self) -> Test | None:
        """The first test that was asked for and not told; before the first flight, the last that was made."""
        told = {run.test.number for run in self.experiments}
        for _, loop in self.asked:
            if loop.test not in told:
                return self.tests[loop.test]
        return self.tests[-1] if self.tests and not told else None

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
        check_recorded(
            run.trajectory, self.setup.signals, run.test.steps, self.setup.options.divergence_factor
        )
        self.selected = _with_run(self.selected, run.test, run.trajectory)
        self.experiments.append(run)

    def _known(self, test: object) -> Test:
        check_signals(test, self.setup.signals)
        assert isinstance(test, Test)  # check_signals has refused everything else
        if test.number >= len(self.tests) or not self.tests[test.number].same_as(test):
            raise InvalidInput(
                f"Campaign.tell: expected a test of this campaign as it was made, found test {test.number} "
                "of another one, or changed; "
                "tell it to the campaign that made it, or make it here with campaign.test(gains)."
            )
        return self.tests[test.number]


def _with_run(selected: _core.SelectedTests, test: Test, run: Trajectory) -> _core.SelectedTests:
    with engine_input():
        return selected.with_test(test.genes, test.target_state, run.states, run.commands, test.excitation)


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
