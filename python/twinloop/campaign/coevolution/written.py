"""What the preset `paper` remembers, written down: the model loop when the last test was asked for, and now."""

from __future__ import annotations

from dataclasses import dataclass

from twinloop.campaign.coevolution.learning import Learner, Learning
from twinloop.campaign.coevolution.snapshots import ModelSnapshot
from twinloop.campaign.history import Iteration
from twinloop.campaign.logbook import Logbook
from twinloop.errors import InvalidInput
from twinloop.records import Recorded


@dataclass(frozen=True, eq=False)
class WrittenLearning(Recorded, kind="model_loop"):
    """An iteration of the model loop, finished or running.

    Args:
        models: population, archive and counters.
        told: experiments that it learns.
        iteration: that is running, or was the last.
        left: generations of it that are still to be run.
        capped_before: generations before it in which the non-dominated set was pruned.
        finished: records of the iterations before.
    """

    models: ModelSnapshot
    told: int
    iteration: int
    left: int
    capped_before: int
    finished: tuple[Iteration, ...]

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
            book: with all that was told.
            learner: that made it.

        Raises:
            InvalidInput: it learnt other experiments than there are, or more generations are left than there were.
        """
        learnt = book.first(self.told)
        models = self.models.restored(learner.options, learner.signals, learner.workers)
        objectives = self.models.population_objectives.shape[1]
        if objectives != 2 * self.told or not 0 <= self.left <= learner.options.model_generations:
            raise InvalidInput(
                f"Record model_loop: expected {2 * self.told} objectives and at most"
                f" {learner.options.model_generations} generations left, found {objectives} and {self.left}."
            )
        return Learning(
            models,
            learnt.selected,
            tuple(learnt.experiments),
            self.iteration,
            self.left,
            self.capped_before,
            self.finished,
        )


@dataclass(frozen=True, eq=False)
class WrittenMemory(Recorded, kind="memory_of_paper"):
    """What the preset `paper` remembers.

    Args:
        asked: what was learnt when the last test was asked for; None: none was.
        latest: what was learnt last, or is being learnt; None: nothing was.
        same: whether both are one, and only `latest` is written.
    """

    asked: WrittenLearning | None
    latest: WrittenLearning | None
    same: bool

    @staticmethod
    def of(asked: Learning | None, latest: Learning | None) -> WrittenMemory:
        """Both, to be written down."""
        same = asked is latest
        return WrittenMemory(
            None if asked is None or same else WrittenLearning.of(asked),
            None if latest is None else WrittenLearning.of(latest),
            same,
        )

    def restored(self, book: Logbook, learner: Learner) -> tuple[Learning | None, Learning | None]:
        """Both, as they were.

        Args:
            book: with all that was told.
            learner: that made them.

        Raises:
            InvalidInput: they belong to another campaign.
        """
        latest = None if self.latest is None else self.latest.restored(book, learner)
        if self.same:
            return latest, latest
        return None if self.asked is None else self.asked.restored(book, learner), latest
