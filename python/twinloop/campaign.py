"""The double loop, counted in experiments: ask for a test, fly it, tell what happened (section III.C)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop.arrays import Floats, floats, whole
from twinloop.controllers import Controller, Family, UnboundFamily
from twinloop.errors import InvalidInput, NotAvailable, engine_input
from twinloop.history import Experiment, Iteration, Progress
from twinloop.learning import Learning
from twinloop.logbook import Logbook
from twinloop.models import TestErrors, Twin
from twinloop.objectives import closed_loop, final_distances, normalised_error, open_loop
from twinloop.presets import Options
from twinloop.search import chunks, start_tests
from twinloop.setup import checked, refuse_arguments
from twinloop.signals import Signals
from twinloop.systems import System
from twinloop.test import Test
from twinloop.trajectory import Trajectory

ARGUMENTS = (
    "signals",
    "controller",
    "initial_state",
    "target_state",
    "duration",
    "preset",
    "seed",
    "options",
    "threads",
    "progress",
)


class Campaign:
    """Learns a twin and a controller from as few experiments as possible.

    Args:
        signals: of the system.
        controller: a family of controllers, such as `twinloop.controllers.PID`.
        initial_state: where every test starts (n_x,), SI units, radians.
        target_state: where every test should end (n_x,), the same units.
        duration: of a test, s; a whole number of periods.
        preset: name of a set of options; "paper" is the only one.
        seed: of all random numbers; equal seeds give equal bits.
        options: other values for some of the preset's options, by name.
        threads: how many the engine may use, by default all that there are; no result depends on it.
        progress: called with a `Progress` a few times a second while the loops run.

    Raises:
        InvalidInput: an argument that cannot be used, or that this version does not have.
    """

    def __init__(
        self,
        signals: Signals,
        *,
        controller: UnboundFamily,
        initial_state: ArrayLike,
        target_state: ArrayLike,
        duration: float,
        preset: str = "paper",
        seed: int = 0,
        options: Mapping[str, object] | None = None,
        threads: int | None = None,
        progress: Callable[[Progress], None] | None = None,
        **other: object,
    ) -> None:
        refuse_arguments("Campaign", other, ARGUMENTS)
        self.setup = checked(
            signals, controller, initial_state, target_state, duration, preset, options, seed
        )
        self.threads = (
            available_threads() if threads is None else whole("Campaign, threads", threads, least=1)
        )
        self.progress = progress
        self.interrupted = False
        with engine_input():
            self._workers = _core.Workers(threads=self.threads)
        self._book = Logbook(self.setup)
        self._learning = Learning(
            self.signals, self.options, self.setup.seed, self._workers, self._watch_models
        )

    @property
    def signals(self) -> Signals:
        """Of the system."""
        return self.setup.signals

    @property
    def family(self) -> Family:
        """Of the controllers, bound to the signals."""
        return self.setup.family

    @property
    def options(self) -> Options:
        """Of the preset, with those that were changed."""
        return self.setup.options

    # Ask and tell

    def test(self, gains: Mapping[str, float] | ArrayLike, excitation: ArrayLike | None = None) -> Test:
        """A test with gains of your own: the first one, a controller that you already trust.

        Args:
            gains: all gains by name, or (size,) in order; in their units and bounds.
            excitation: what is added to the controller's commands (steps, n_u), in their units; the sum is
                clipped to the commands' bounds. None: nothing.

        Returns:
            The test, to be flown and told.

        Raises:
            InvalidInput: gains or an excitation that cannot be used.
        """
        genes = self.family.genes(gains)
        if excitation is not None:
            shape = (self.setup.steps, self.signals.n_u)
            excitation = floats("Campaign.test, excitation (steps, commands)", excitation, shape)
        return self._book.new_test(genes, excitation=excitation)

    def ask(self) -> Test:
        """Learns from all that was told, then picks the test on which the best models disagree.

        Asking again without telling learns nothing new and gives another test.

        Returns:
            The test, to be flown and told, with its predicted final distance.

        Raises:
            NotAvailable: nothing was told yet.
        """
        self.interrupted = False
        models = self._learnt()
        with self._interruptible():
            search = start_tests(
                models,
                self.family,
                self.setup.task,
                self.options,
                seed=self.setup.seed,
                iteration=len(self._book.asked) + 1,
                workers=self._workers,
            )
            total = self.options.generations_of_tests
            for moved, left in chunks(search, lambda s, n: s.advance(n, self._workers), total):
                search = moved
                self._report("tests", total - left, total, search.archive_size, search.evaluations)
        test = self._book.new_test(search.best_genes, predicted=self._predicted(models, search.best_genes))
        self._book.enter_loop(self._learning.iteration, test, search)
        return test

    def tell(self, test: Test, trajectory: Trajectory) -> None:
        """Adds a run to what is to be learnt. Tests may be told in any order; one told again is a replicate.

        Args:
            test: from this campaign.
            trajectory: what the system answered; shorter than the test if the run was cut.

        Raises:
            InvalidInput: a test of another campaign, or a useless trajectory; nothing has changed.
        """
        models = self._learning.models

        def error_so_far(alone: _core.SelectedTests) -> float | None:
            if models is None:
                return None
            return float(closed_loop([models.best_model], alone, self._workers)[0, 0])

        self._book.tell(test, trajectory, error_so_far)
        self.interrupted = False

    def run(self, system: System, experiments: int = 4) -> Campaign:
        """The whole loop. Ctrl-C ends it cleanly and keeps the best so far; `interrupted` says so.

        What was asked for and not told yet is flown first. Where nothing was told, the first test is the
        last one made by `campaign.test`, or that of `system.default_gains`.

        Args:
            system: anything with `signals` and `run(test)`.
            experiments: runs on the system in all, the first and those told before included.

        Returns:
            The campaign.

        Raises:
            InvalidInput: no system, or one that answers with something else than a usable trajectory.
            NotAvailable: there is no first test.
        """
        budget = whole("Campaign.run, experiments", experiments, least=1)
        if not (hasattr(system, "signals") and callable(getattr(system, "run", None))):
            raise InvalidInput(
                "Campaign.run, system: expected an object with `signals` and `run(test)`, "
                f"found {type(system).__name__}; add them."
            )
        self.interrupted = False
        try:
            while len(self._book.experiments) < budget:
                test = self._next(system)
                self._report("experiment", 0, 0, 0, 0)
                self.tell(test, system.run(test))
        except KeyboardInterrupt:
            self.interrupted = True
        return self

    # What came out

    @property
    def twin(self) -> Twin:
        """The best model, after learning all that was told; the best so far after an interruption."""
        model = self._learnt().best_model
        selected, experiments = self._book.selected, self._book.experiments
        steps = open_loop([model], selected, self._workers)[0].tolist()
        runs = closed_loop([model], selected, self._workers)[0].tolist()
        rows = [
            TestErrors(run.test.number, step, free, normalised_error(free, run.frozen), run.before, free)
            for run, step, free in zip(experiments, steps, runs, strict=True)
        ]
        return Twin(model, self.signals, rows, self.options.divergence_factor)

    @property
    def best_test(self) -> Test:
        """The controller to fly: the flown test that ended nearest to its target.

        It carries the final distance that the twin predicts, after learning all that was told, and the
        measured one. Runs that were cut do not count, unless there are no others. It carries no excitation:
        to fly and tell it where it was flown with one, make a test of it with `campaign.test`.
        """
        models, best = self._learnt(), self._book.best().quiet()
        return best.judged(self._predicted(models, best.genes), self._book.measured(best.number))

    @property
    def controller(self) -> Controller:
        """That of `best_test`, for a real loop: `.parameters`, `.reset()`, `.command(state, target)`."""
        return self.best_test.controller()

    @property
    def models(self) -> _core.ModelSearch:
        """The model loop as a value, after learning all that was told."""
        return self._learnt()

    @property
    def experiments(self) -> tuple[Experiment, ...]:
        """All that was told, in order."""
        return tuple(self._book.experiments)

    @property
    def history(self) -> tuple[Iteration, ...]:
        """One record for each iteration, from 0; the last may be unfinished after an interruption."""
        return self._book.with_loops(self._learning.records())

    # Inside

    def _learnt(self) -> _core.ModelSearch:
        if not self._book.experiments:
            raise NotAvailable(
                "Expected at least one experiment that was told, found none; first fly a controller you "
                "trust: test = campaign.test(gains), then campaign.tell(test, system.run(test))."
            )
        learn = self._learning.start if self.interrupted else self._learning.learn
        with self._interruptible():
            return learn(self._book.selected, self._book.experiments)

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        try:
            yield
        except KeyboardInterrupt:
            self.interrupted = True
            raise

    def _next(self, system: System) -> Test:
        waiting = self._book.waiting()
        if waiting is not None:
            return waiting
        if self._book.experiments:
            return self.ask()
        gains = getattr(system, "default_gains", None)
        if gains is None:
            raise NotAvailable(
                "Campaign.run: expected a first test, found none and no `default_gains` of "
                f"{type(system).__name__}; make one with campaign.test(gains), from a controller you trust."
            )
        return self.test(gains)

    def _predicted(self, models: _core.ModelSearch, genes: Floats) -> float:
        factor = self.options.divergence_factor
        task, row = self.setup.task, genes[np.newaxis]
        distances = final_distances([models.best_model], self.family, row, task, divergence_factor=factor)
        return float(distances[0, 0])

    def _watch_models(self) -> None:
        models, done, total = self._learning.models, self._learning.done, self.options.model_generations
        if models is not None:
            self._report("models", done, total, models.archive_size, models.evaluations)

    def _report(
        self, phase: str, generation: int, generations: int, archive_size: int, evaluations: int
    ) -> None:
        if self.progress is None:
            return
        best = [] if self._learning.models is None else self._learning.models.best_objectives.tolist()
        progress = Progress(
            phase=phase,
            iteration=self._learning.iteration,
            generation=generation,
            generations=generations,
            told=len(self._book.experiments),
            tests=self._learning.tests,
            open_loop=tuple(best[::2]),
            closed_loop=tuple(best[1::2]),
            archive_size=archive_size,
            evaluations=evaluations,
        )
        self.progress(progress)


def available_threads() -> int:
    """Processors that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
