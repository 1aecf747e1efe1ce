"""What the preset `paper` remembers, written down: the model loop when a test was asked for, and now; the test loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from twinloop import _core
from twinloop.campaign.coevolution.learning import Learner, Learning
from twinloop.campaign.coevolution.snapshots import ModelSnapshot, TestSnapshot
from twinloop.campaign.history import Iteration
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.presets import Options
from twinloop.campaign.setup import Setup
from twinloop.errors import InvalidInput
from twinloop.records import Recorded


@dataclass(frozen=True, eq=False)
class WrittenLearning(Recorded, kind="model_loop"):
    """An iteration of the model loop, finished or running.

    Args:
        models: population, archive and counters.
        experiments: number of experiments that it learns.
        iteration: that is running, or was the last.
        ahead: generations of it that are still to be run.
        capped_before: generations before it in which the non-dominated set was pruned.
        finished: records of the iterations before.
    """

    models: ModelSnapshot
    experiments: int
    iteration: int
    ahead: int
    capped_before: int
    finished: tuple[Iteration, ...]

    VERSION = 3
    RENAMED: ClassVar[Mapping[str, str]] = {"left": "ahead", "told": "experiments"}

    @staticmethod
    def of(learning: Learning) -> WrittenLearning:
        """An iteration, to be written down."""
        return WrittenLearning(
            ModelSnapshot.of(learning.models),
            len(learning.experiments),
            learning.iteration,
            learning.ahead,
            learning.capped_before,
            learning.finished,
        )

    def restored(self, book: Logbook, learner: Learner) -> Learning:
        """The iteration that was written down.

        Args:
            book: with all runs.
            learner: that made it.

        Raises:
            InvalidInput: it learnt other experiments than there are, or more generations are left than there were.
        """
        learnt = book.first(self.experiments)
        models = self.models.restored(learner.options, learner.signals, learner.workers)
        objectives = self.models.population_objectives.shape[1]
        if objectives != 2 * self.experiments or not 0 <= self.ahead <= learner.options.model_generations:
            raise InvalidInput(
                f"Record model_loop: expected {2 * self.experiments} objectives and at most"
                f" {learner.options.model_generations} generations left, found {objectives} and {self.ahead}."
            )
        return Learning(
            models,
            learnt.selected,
            tuple(learnt.experiments),
            self.iteration,
            self.ahead,
            self.capped_before,
            self.finished,
        )


@dataclass(frozen=True, eq=False)
class WrittenChoosing(Recorded, kind="choosing"):
    """A test loop that is under way.

    Args:
        tests: population, archive and counters.
        ahead: generations that are still to be run.
    """

    tests: TestSnapshot
    ahead: int

    def restored(
        self, models: _core.ModelSearch, setup: Setup, options: Options, workers: _core.Workers
    ) -> tuple[_core.TestSearch, int]:
        """The test loop that was written down, and the generations that are left.

        Args:
            models: the model loop whose committee judges.
            setup: of the campaign.
            options: of the preset.
            workers: how the work is carried out.

        Raises:
            InvalidInput: it belongs to another campaign, or more generations are left than there were.
        """
        if not 0 <= self.ahead <= options.generations_of_tests:
            raise InvalidInput(
                f"Record choosing: expected at most {options.generations_of_tests} generations left, found"
                f" {self.ahead}."
            )
        return self.tests.restored(models, setup.setting, setup.task, options, workers), self.ahead


@dataclass(frozen=True, eq=False)
class WrittenMemory(Recorded, kind="memory_of_paper"):
    """What the preset `paper` remembers.

    Args:
        asked: what was learnt when the last test was asked for; None: none was.
        latest: what was learnt last, or is being learnt; None: nothing was.
        same: whether both are one, and only `latest` is written.
        choosing: the test loop that is under way over the models of `latest`; None: none is.
    """

    VERSION = 2

    asked: WrittenLearning | None
    latest: WrittenLearning | None
    same: bool
    choosing: WrittenChoosing | None = None

    @staticmethod
    def of(
        asked: Learning | None, latest: Learning | None, choosing: tuple[_core.TestSearch, int] | None
    ) -> WrittenMemory:
        """All of them, to be written down."""
        same = asked is latest
        return WrittenMemory(
            None if asked is None or same else WrittenLearning.of(asked),
            None if latest is None else WrittenLearning.of(latest),
            same,
            None if choosing is None else WrittenChoosing(TestSnapshot.of(choosing[0]), choosing[1]),
        )

    def restored(self, book: Logbook, learner: Learner) -> tuple[Learning | None, Learning | None]:
        """What was learnt, as it was.

        Args:
            book: with all runs.
            learner: that made them.

        Raises:
            InvalidInput: they belong to another campaign.
        """
        latest = None if self.latest is None else self.latest.restored(book, learner)
        if self.same:
            return latest, latest
        return None if self.asked is None else self.asked.restored(book, learner), latest
