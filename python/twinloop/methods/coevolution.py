"""The paper's way: models and tests coevolve (section III.C)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.history import Iteration, Progress
from twinloop.learning import Learning
from twinloop.logbook import Logbook
from twinloop.methods.errors import errors
from twinloop.models import Twin
from twinloop.objectives import final_distances
from twinloop.presets import Options
from twinloop.search import chunks, committee, start_tests
from twinloop.setup import Setup
from twinloop.test import Test


class Coevolution:
    """The double loop of the preset `paper`.

    Args:
        setup: of the campaign.
        options: of the preset.
        workers: how the work is carried out.
        report: called with a `Progress` after every chunk of work.
    """

    def __init__(
        self, setup: Setup, options: Options, workers: _core.Workers, report: Callable[[Progress], None]
    ) -> None:
        self.setup = setup
        self.options = options
        self.workers = workers
        self.report = report
        self.learning = Learning(setup.signals, options, setup.seed, workers, self._watch_models)
        self._told = 0

    @property
    def iteration(self) -> int:
        """Of the model loop."""
        return self.learning.iteration

    def learn(self, book: Logbook, at_once: bool = False) -> None:
        """Finishes the iteration that is running, and runs another if more was told."""
        self._told = len(book.experiments)
        learn = self.learning.start if at_once else self.learning.learn
        learn(book.selected, book.experiments)

    def ask(self, book: Logbook, last: bool) -> Test:
        """The test loop over the committee; that an experiment is the last means nothing to the paper."""
        models = self.models
        search = start_tests(
            models,
            self.setup.family,
            self.setup.task,
            self.options,
            seed=self.setup.seed,
            iteration=len(book.asked) + 1,
            workers=self.workers,
        )
        total = self.options.generations_of_tests
        for moved, left in chunks(search, lambda s, n: s.advance(n, self.workers), total):
            search = moved
            self._report("tests", total - left, total, search.archive_size, search.evaluations)
        test = book.new_test(search.best_genes, predicted=self._predicted(search.best_genes))
        book.enter_loop(self.iteration, test, search)
        return test

    def best_test(self, book: Logbook) -> Test:
        """The flown test that ended nearest to its target."""
        best = book.best().quiet()
        return best.judged(self._predicted(best.genes), book.measured(best.number))

    def first_excitation(self, number: int) -> Floats | None:
        """None: the paper adds none."""
        return None

    def twin(self, book: Logbook) -> Twin:
        """The best trade-off."""
        model = self.models.best_model
        rows = errors(model, book, self.workers)
        return Twin(model, self.setup.signals, rows, self.options.divergence_factor)

    @property
    def models(self) -> _core.ModelSearch:
        """The model loop as a value."""
        assert self.learning.models is not None
        return self.learning.models

    @property
    def best_model(self) -> _core.Model | None:
        """The best trade-off so far."""
        return None if self.learning.models is None else self.learning.models.best_model

    def history(self, book: Logbook) -> tuple[Iteration, ...]:
        """One record for each iteration, from 0."""
        return book.with_loops(self.learning.records())

    def committee(self) -> Sequence[_core.Model]:
        """Members of the non-dominated set, the best trade-off first."""
        return committee(self.models, self.options.committee_size)

    def _predicted(self, genes: Floats) -> float:
        factor = self.options.divergence_factor
        task, row = self.setup.task, genes[np.newaxis]
        distances = final_distances(
            [self.models.best_model], self.setup.family, row, task, divergence_factor=factor
        )
        return float(distances[0, 0])

    def _watch_models(self) -> None:
        models, done, total = self.learning.models, self.learning.done, self.options.model_generations
        if models is not None:
            self._report("models", done, total, models.archive_size, models.evaluations)

    def _report(
        self, phase: str, generation: int, generations: int, archive_size: int, evaluations: int
    ) -> None:
        best = [] if self.learning.models is None else self.learning.models.best_objectives.tolist()
        self.report(
            Progress(
                phase=phase,
                iteration=self.iteration,
                generation=generation,
                generations=generations,
                told=self._told,
                tests=self.learning.tests,
                open_loop=tuple(best[::2]),
                closed_loop=tuple(best[1::2]),
                archive_size=archive_size,
                evaluations=evaluations,
            )
        )
