"""The paper's two loops between two generations, as values that can be written down and read back."""

from __future__ import annotations

from dataclasses import dataclass

from twinloop import _core
from twinloop._ground.arrays import Floats, floats
from twinloop.campaign.coevolution.search import committee, grammar, settings_of_tests, variation
from twinloop.campaign.presets import Options
from twinloop.errors import InvalidInput
from twinloop.records import Recorded
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class ModelSnapshot(Recorded, kind="model_search"):
    """The model loop. Random numbers are named by seed, iteration and generation, so no generator is kept.

    Args:
        seed: of all random numbers.
        iteration: turn of the double loop.
        generation: turn of this loop since the iteration began.
        evaluations: models that were run on the tests since the start.
        spared: offspring that were not run: their effective code was their parent's.
        capped_generations: generations in which the non-dominated set was pruned to its cap.
        population: programs of all individuals.
        population_objectives: (population, 2 N), open loop and closed loop of each test in turn.
        archive: programs of the non-dominated set, in the order in which they were found.
        archive_objectives: (members, 2 N).
    """

    seed: int
    iteration: int
    generation: int
    evaluations: int
    spared: int
    capped_generations: int
    population: tuple[_core.Program, ...]
    population_objectives: Floats
    archive: tuple[_core.Program, ...]
    archive_objectives: Floats

    @staticmethod
    def of(search: _core.ModelSearch) -> ModelSnapshot:
        """A snapshot of a search."""
        return ModelSnapshot(
            *search.counters,
            population=tuple(search.population),
            population_objectives=search.population_objectives,
            archive=tuple(model.program for model in search.archive),
            archive_objectives=search.archive_objectives,
        )

    def restored(self, options: Options, signals: Signals, workers: _core.Workers) -> _core.ModelSearch:
        """The search that the snapshot was taken of.

        Args:
            options: of the campaign.
            signals: of the system.
            workers: how the work is carried out.

        Raises:
            InvalidInput: the snapshot is not of a search with these options and signals.
        """
        programs = grammar(options, signals)
        return _core.ModelSearch.restored(
            programs,
            options.form,
            variation(options, options.model_population),
            signals.engine,
            _counters(self),
            self.population,
            _rows(self.population_objectives),
            self.archive,
            _rows(self.archive_objectives),
            workers,
        )


@dataclass(frozen=True, eq=False)
class TestSnapshot(Recorded, kind="test_search"):
    """The test loop, without the committee that judges: that is the models' own.

    Args:
        seed: of all random numbers.
        iteration: number of the campaign's ask.
        generation: turn of this loop.
        evaluations: tests that were judged.
        spared: tests that were not.
        capped_generations: generations in which the non-dominated set was pruned to its cap.
        flat: whether all tests of the random population ended at the same distance on the best model.
        population: genes (population, size), in their units.
        population_objectives: (population, 2 or 3).
        archive: genes of the non-dominated set (members, size), in the order in which they were found.
        archive_objectives: (members, 2 or 3).
    """

    __test__ = False  # a name that pytest would otherwise collect

    seed: int
    iteration: int
    generation: int
    evaluations: int
    spared: int
    capped_generations: int
    flat: bool
    population: Floats
    population_objectives: Floats
    archive: Floats
    archive_objectives: Floats

    @staticmethod
    def of(search: _core.TestSearch) -> TestSnapshot:
        """A snapshot of a search."""
        return TestSnapshot(
            *search.counters,
            flat=search.flat,
            population=search.population,
            population_objectives=search.population_objectives,
            archive=search.archive_genes,
            archive_objectives=search.archive_objectives,
        )

    def restored(
        self,
        models: _core.ModelSearch,
        setting: _core.Setting,
        task: _core.Task,
        options: Options,
        workers: _core.Workers,
    ) -> _core.TestSearch:
        """The search that the snapshot was taken of.

        Args:
            models: the model loop whose committee judges, as it was.
            setting: what tests are flown in.
            task: start, target and length of the tests.
            options: of the campaign.
            workers: how the work is carried out.

        Raises:
            InvalidInput: the snapshot is not of a search with these options and controllers.
        """
        return _core.TestSearch.restored(
            committee(models, options.committee_size),
            setting,
            task,
            settings_of_tests(options),
            variation(options, options.test_population),
            _counters(self),
            self.flat,
            _rows(self.population),
            _rows(self.population_objectives),
            _rows(self.archive),
            _rows(self.archive_objectives),
            workers,
        )


def _counters(snapshot: ModelSnapshot | TestSnapshot) -> tuple[int, int, int, int, int, int]:
    counters = (
        snapshot.seed,
        snapshot.iteration,
        snapshot.generation,
        snapshot.evaluations,
        snapshot.spared,
        snapshot.capped_generations,
    )
    if min(counters) < 0:
        raise InvalidInput(f"Search: expected counters of at least 0, found {counters}.")
    return counters


def _rows(values: Floats) -> Floats:
    """A matrix, whatever a record has made of it."""
    return floats("Search, numbers of a record", values, (None, None))
