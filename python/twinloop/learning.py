"""The model loop of a campaign, iteration after iteration; it can be interrupted and continued."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from twinloop import _core
from twinloop.history import Experiment, Iteration
from twinloop.objectives import normalised_error
from twinloop.presets import Options
from twinloop.search import chunks, start_models
from twinloop.signals import Signals


class Learning:
    """Holds the best models so far, and what is left to do before all that was told is learnt.

    Args:
        signals: of the system.
        options: of the campaign.
        seed: of the campaign.
        workers: how the work is carried out.
        watch: called after every chunk of work.
    """

    def __init__(
        self, signals: Signals, options: Options, seed: int, workers: _core.Workers, watch: Callable[[], None]
    ) -> None:
        self.signals = signals
        self.options = options
        self.seed = seed
        self.workers = workers
        self.watch = watch
        self.models: _core.ModelSearch | None = None
        self.iteration = 0
        self.left = 0
        self._selected: _core.SelectedTests | None = None
        self._experiments: tuple[Experiment, ...] = ()
        self._capped_before = 0
        self._finished: list[Iteration] = []

    @property
    def tests(self) -> tuple[int, ...]:
        """Numbers of the tests that are learnt, or being learnt."""
        return tuple(run.test.number for run in self._experiments)

    @property
    def done(self) -> int:
        """Generations of this iteration that were run."""
        return self.options.model_generations - self.left

    def start(self, selected: _core.SelectedTests, experiments: Sequence[Experiment]) -> None:
        """The random population, unless there is one; its non-dominated set is iteration 0.

        Args:
            selected: what was told so far.
            experiments: the same, with what is known about each.
        """
        if self.models is None:
            self.models = start_models(self.options, self.signals, self.seed, selected, self.workers)
            self._selected, self._experiments = selected, tuple(experiments)
            self._finished.append(self._record(self.models, 0, 0))
            self.iteration, self.left = 1, self.options.model_generations

    def learn(self, selected: _core.SelectedTests, experiments: Sequence[Experiment]) -> None:
        """Finishes the iteration that is running, and runs another if more was told since it began.

        Args:
            selected: what was told so far.
            experiments: the same, with what is known about each.

        Raises:
            KeyboardInterrupt: between chunks; calling again goes on from there, with the same bits.
        """
        self.start(selected, experiments)
        self._advance()
        if len(self._experiments) < len(experiments):
            assert self.models is not None
            relearnt = self.models.learn(selected, self.workers)
            self._capped_before = self.models.capped_generations
            self._selected, self._experiments = selected, tuple(experiments)
            self.models, self.iteration, self.left = (
                relearnt,
                self.iteration + 1,
                self.options.model_generations,
            )
            self._advance()

    def records(self) -> list[Iteration]:
        """One record for each iteration, the one that was interrupted too."""
        if self.models is None or self.left == 0 or self.done == 0:
            return list(self._finished)
        return [*self._finished, self._record(self.models, self.iteration, self.done)]

    def _advance(self) -> None:
        selected, models = self._selected, self.models
        assert selected is not None and models is not None
        if self.left == 0:
            return
        for moved, left in chunks(models, lambda s, n: s.advance(selected, n, self.workers), self.left):
            self.models, self.left = moved, left
            if left == 0:
                self._finished.append(self._record(moved, self.iteration, self.options.model_generations))
            self.watch()

    def _record(self, models: _core.ModelSearch, iteration: int, generations: int) -> Iteration:
        best = models.best_objectives.tolist()
        runs = self._experiments
        return Iteration(
            iteration=iteration,
            generations=generations,
            tests=self.tests,
            archive_size=models.archive_size,
            capped_generations=models.capped_generations - self._capped_before,
            open_loop=tuple(best[::2]),
            closed_loop=tuple(best[1::2]),
            normalised=tuple(
                normalised_error(c, run.frozen) for c, run in zip(best[1::2], runs, strict=True)
            ),
            intron_share=models.intron_share,
            evaluations=models.evaluations,
            spared=models.spared,
        )
