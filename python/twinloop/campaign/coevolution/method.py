"""The paper's way: models and tests coevolve (section III.C)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop._experiment.hold_back import HoldBack
from twinloop._ground.arrays import Floats
from twinloop.campaign import standing
from twinloop.campaign.coevolution.knowledge import Knowledge
from twinloop.campaign.coevolution.learning import Learner, Learning
from twinloop.campaign.coevolution.search import chunks, committee, start_tests
from twinloop.campaign.coevolution.written import WrittenMemory
from twinloop.campaign.history import Iteration, Progress, TestLoop
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.presets import Options
from twinloop.campaign.setup import Setup
from twinloop.objectives import final_distances
from twinloop.records import Record
from twinloop.test import Test


@dataclass(frozen=True, eq=False)
class Memory:
    """What the preset `paper` remembers.

    Args:
        asked: what was learnt when the last test was asked for. Learning begins here; looking at results
            in between changes nothing.
        latest: what was learnt last, or is being learnt; shown to whoever looks, and gone on with if it is of all that
            was told.
        choosing: the test loop that is under way over the models of `latest`, and how many generations are still to be
            run.
    """

    asked: Learning | None = None
    latest: Learning | None = None
    choosing: tuple[_core.TestSearch, int] | None = None


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
        self.memory = Memory()
        self.learner = Learner(setup.signals, options, setup.seed, workers)
        self._experiments = 0

    def to_record(self) -> Record:
        """What is remembered, as plain values; an iteration that is running too."""
        memory = self.memory
        return WrittenMemory.of(memory.asked, memory.latest, memory.choosing).to_record()

    def restore(self, record: object, book: Logbook) -> None:
        """Remembers what a record holds."""
        written = WrittenMemory.from_record(record)
        asked, latest = written.restored(book, self.learner)
        choosing = None
        if written.choosing is not None and latest is not None:
            choosing = written.choosing.restored(latest.models, self.setup, self.options, self.workers)
        self.memory = Memory(asked, latest, choosing)

    @property
    def iteration(self) -> int:
        """Of the model loop."""
        latest = self.memory.latest
        return 0 if latest is None else latest.iteration

    def learnt_by(self, iteration: int) -> int:
        """Number of tests of an iteration."""
        latest = self.memory.latest
        assert latest is not None  # a test was asked for after it
        return next(len(record.tests) for record in latest.finished if record.iteration == iteration)

    def forget(self, book: Logbook, asked_since: bool) -> None:
        """Back to the last `ask`, or to the random population if that had learnt the flight."""
        asked = None if asked_since else self.memory.asked
        self.memory = Memory(asked, asked)

    def learn(self, book: Logbook, at_once: bool = False) -> None:
        """One iteration on all runs since the last `ask`; after a withdrawal first those of the asks before."""
        asked = self.memory.asked
        for past in [] if at_once else book.to_learn_again(0 if asked is None else len(asked.experiments)):
            self._learn(past)
            self.memory = Memory(self.memory.latest, self.memory.latest)
        self._learn(book, at_once)

    def _learn(self, book: Logbook, at_once: bool = False) -> None:
        self._experiments = experiments = len(book.experiments)
        latest = self.memory.latest
        if at_once and latest is not None:
            return
        if latest is None or len(latest.experiments) != experiments:
            latest = self._begun(book)
        if at_once:
            self.memory = replace(self.memory, latest=latest, choosing=None)
            return
        for moved in self.learner.advanced(latest):
            self.memory = replace(self.memory, latest=moved, choosing=None)
            self._watch_models(moved)

    def _begun(self, book: Logbook) -> Learning:
        """The iteration that learns all runs, at its beginning."""
        known = self.memory.asked
        if known is None:
            return self.learner.started(book.selected, book.experiments)
        if len(known.experiments) == len(book.experiments):
            return known
        return self.learner.renewed(known, book.selected, book.experiments)

    def ask(self, book: Logbook, last: bool) -> Test:
        """The test loop over the committee; that an experiment is the last means nothing to the paper."""
        search = self._chosen(len(book.asked) + 1)
        test = book.new_test(search.best_genes, predicted=self._predicted(search.best_genes))
        book.asked.append((self.iteration, _turn(test, search)))
        self.memory = Memory(self.memory.latest, self.memory.latest)
        return test

    def waiting_last(self, book: Logbook) -> Test | None:
        """The first one that waits: that an experiment is the last means nothing to the paper."""
        return next(iter(book.waiting()), None)

    def _chosen(self, iteration: int) -> _core.TestSearch:
        """The test loop at its end; one that was under way goes on."""
        total, choosing = self.options.generations_of_tests, self.memory.choosing
        if choosing is None or choosing[0].counters[1] != iteration:
            setup = self.setup
            search = start_tests(
                self.models,
                setup.setting,
                setup.task,
                self.options,
                seed=setup.seed,
                iteration=iteration,
                workers=self.workers,
            )
            choosing = search, total
        search, left = choosing
        for moved, ahead in chunks(search, lambda s, n: s.advance(n, self.workers), left):
            search = moved
            self.memory = replace(self.memory, choosing=(search, ahead))
            self._report("tests", total - ahead, total, search.archive_size, search.evaluations)
        return search

    def best_test(self, book: Logbook, at_once: bool = False) -> Test:
        """The flown test that ended nearest to its target."""
        best = standing.best_flown(book)
        assert best is not None  # the paper learns tests only
        best = best.quiet()
        return best.judged(self._predicted(best.genes), standing.measured(book, best.number))

    def first_excitation(self, number: int, genes: Floats) -> tuple[Floats | None, HoldBack | None]:
        """None: the paper adds none."""
        return None, None

    def knowledge(self, book: Logbook) -> Knowledge:
        """The best trade-off, and the one when the last test was asked for."""
        assert self.memory.latest is not None
        return Knowledge(self.setup, book, self.memory.latest, self.memory.asked)

    @property
    def models(self) -> _core.ModelSearch:
        """The model loop as a value."""
        assert self.memory.latest is not None
        return self.memory.latest.models

    @property
    def asked_model(self) -> _core.Model | None:
        """The best trade-off when the last test was asked for."""
        asked = self.memory.asked
        return None if asked is None else asked.models.best_model

    def history(self, book: Logbook) -> tuple[Iteration, ...]:
        """One record for each iteration, from 0."""
        latest = self.memory.latest
        return (
            ()
            if latest is None
            else standing.with_asked(book, latest.records(self.options.model_generations))
        )

    def committee(self) -> Sequence[_core.Model]:
        """Members of the non-dominated set, the best trade-off first."""
        return committee(self.models, self.options.committee_size)

    def _predicted(self, genes: Floats) -> float:
        task, row = self.setup.task, genes[np.newaxis]
        distances = final_distances(
            [self.models.best_model], self.setup.family, row, task, limits=self.setup.limits
        )
        return float(distances[0, 0])

    def _watch_models(self, latest: Learning) -> None:
        models, total = latest.models, self.options.model_generations
        self._report("models", total - latest.ahead, total, models.archive_size, models.evaluations)

    def _report(
        self, phase: str, generation: int, generations: int, archive_size: int, evaluations: int
    ) -> None:
        best = self.models.best_objectives.tolist()
        self.report(
            Progress(
                phase=phase,
                iteration=self.iteration,
                generation=generation,
                generations=generations,
                experiments=self._experiments,
                tests=() if self.memory.latest is None else self.memory.latest.tests,
                open_loop=tuple(best[::2]),
                closed_loop=tuple(best[1::2]),
                archive_size=archive_size,
                evaluations=evaluations,
            )
        )


def _turn(test: Test, search: _core.TestSearch) -> TestLoop:
    """The record of a test loop that gave a test."""
    assert test.predicted is not None
    return TestLoop(
        test=test.number,
        genes=tuple(test.genes.tolist()),
        objectives=tuple(search.best_objectives.tolist()),
        flat=search.flat,
        generations=search.generation,
        archive_size=search.archive_size,
        evaluations=search.evaluations,
        predicted=test.predicted,
    )
