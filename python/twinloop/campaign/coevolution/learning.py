"""The model loop of a campaign, iteration after iteration, as a value: it can be left, kept, and gone on with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from twinloop import _core
from twinloop.campaign.coevolution.search import chunks, start_models
from twinloop.campaign.history import Experiment, Iteration
from twinloop.campaign.presets import Options
from twinloop.objectives import normalised_error
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class Learning:
    """The best models so far, and what is left to do before the experiments that they were given are learnt.

    Args:
        models: the model loop.
        selected: the tests that it learns.
        experiments: the same, with what is known about each.
        iteration: that is running, or was the last.
        ahead: generations of it that are still to be run.
        capped_before: generations before it in which the non-dominated set was pruned.
        finished: records of the iterations before.
    """

    models: _core.ModelSearch
    selected: _core.SelectedTests
    experiments: tuple[Experiment, ...]
    iteration: int
    ahead: int
    capped_before: int
    finished: tuple[Iteration, ...]

    @property
    def tests(self) -> tuple[int, ...]:
        """Numbers of the tests that are learnt, or being learnt."""
        return tuple(run.test.number for run in self.experiments if run.test is not None)

    def records(self, generations: int) -> tuple[Iteration, ...]:
        """One record for each iteration, the one that was interrupted too.

        Args:
            generations: of a whole iteration.
        """
        done = generations - self.ahead
        return self.finished if self.ahead == 0 or done == 0 else (*self.finished, self.record(done))

    def record(self, generations: int) -> Iteration:
        """Of the iteration that is running.

        Args:
            generations: that it has run.
        """
        models, best = self.models, self.models.best_objectives.tolist()
        return Iteration(
            iteration=self.iteration,
            generations=generations,
            tests=self.tests,
            archive_size=models.archive_size,
            capped_generations=models.capped_generations - self.capped_before,
            open_loop=tuple(best[::2]),
            closed_loop=tuple(best[1::2]),
            normalised=tuple(
                normalised_error(error, run.frozen)
                for error, run in zip(best[1::2], self.experiments, strict=True)
            ),
            intron_share=models.intron_share,
            evaluations=models.evaluations,
            spared=models.spared,
        )


@dataclass(frozen=True, eq=False)
class Learner:
    """Makes more of a `Learning`.

    Args:
        signals: of the system.
        options: of the campaign.
        seed: of the campaign.
        workers: how the work is carried out.
    """

    signals: Signals
    options: Options
    seed: int
    workers: _core.Workers

    def started(self, selected: _core.SelectedTests, experiments: Sequence[Experiment]) -> Learning:
        """The random population; its non-dominated set is iteration 0.

        Args:
            selected: the runs so far.
            experiments: the same, with what is known about each.
        """
        models = start_models(self.options, self.signals, self.seed, selected, self.workers)
        random = Learning(models, selected, tuple(experiments), 0, 0, 0, ())
        return replace(
            random, iteration=1, ahead=self.options.model_generations, finished=(random.record(0),)
        )

    def renewed(
        self, known: Learning, selected: _core.SelectedTests, experiments: Sequence[Experiment]
    ) -> Learning:
        """The next iteration, at its beginning.

        Args:
            known: the iterations before.
            selected: the runs so far.
            experiments: the same, with what is known about each.
        """
        models = known.models.learn(selected, self.workers)
        return replace(
            known,
            models=models,
            selected=selected,
            experiments=tuple(experiments),
            iteration=known.iteration + 1,
            ahead=self.options.model_generations,
            capped_before=models.capped_generations,
        )

    def advanced(self, known: Learning) -> Iterator[Learning]:
        """What is left of an iteration.

        Args:
            known: where it stands.

        Yields:
            What is known after each chunk of work.
        """
        selected = known.selected
        for models, ahead in chunks(
            known.models, lambda search, n: search.advance(selected, n, self.workers), known.ahead
        ):
            known = replace(known, models=models, ahead=ahead)
            if ahead == 0:
                record = known.record(self.options.model_generations)
                known = replace(known, finished=(*known.finished, record))
            yield known
