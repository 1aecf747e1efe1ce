"""Drives the engine's two loops in chunks: the engine knows no clock and no Ctrl-C, their owner does."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from twinloop import _core
from twinloop.campaign.presets import Options
from twinloop.signals import Signals

CHUNK_SECONDS = 0.3
"""About how long a chunk takes; nothing that is computed depends on it."""

Search = TypeVar("Search")


def chunks(
    search: Search, advance: Callable[[Search, int], Search], generations: int
) -> Iterator[tuple[Search, int]]:
    """Moves a search on, a fraction of a second at a time.

    Args:
        search: where to start.
        advance: moves a search by a number of generations.
        generations: how many in all.

    Yields:
        The search after each chunk, and the generations that are left.
    """
    ahead, size = generations, 1
    while ahead > 0:
        size = min(size, ahead)
        start = time.monotonic()
        search = advance(search, size)
        elapsed = time.monotonic() - start
        ahead -= size
        yield search, ahead
        # At most four times longer than the last: the first chunks say little.
        size = max(1, min(4 * size, int(size * CHUNK_SECONDS / max(elapsed, 1e-6))))


def grammar(options: Options, signals: Signals) -> _core.Grammar:
    """What programs may look like.

    Args:
        options: of the campaign.
        signals: they fix the numbers of inputs and outputs.

    Returns:
        The engine's grammar.

    Raises:
        InvalidInput: options that no program can have.
    """
    inputs, outputs = _core.Model.shape(options.form, signals.engine)
    return _core.Grammar(
        inputs,
        outputs,
        spare_registers=options.spare_registers,
        pages=options.pages,
        page_length=options.page_length,
        operations=options.operations,
        writable_inputs=options.writable_inputs,
        constant_share=options.constant_share,
        constant_low=options.constant_low,
        constant_high=options.constant_high,
        constant_step=options.constant_step,
        mutation_rate=options.mutation_rate,
        aligned_pages=options.aligned_pages,
    )


def variation(options: Options, population: int) -> _core.Variation:
    """How a generation is made out of the last.

    Args:
        options: of the campaign.
        population: of the loop.

    Returns:
        The engine's settings.

    Raises:
        InvalidInput: shares or a pressure that cannot be used.
    """
    return _core.Variation(
        population,
        mutation_share=options.mutation_share,
        crossover_share=options.crossover_share,
        reproduction_share=options.reproduction_share,
        elite_share=options.elite_share,
        ranking_pressure=options.ranking_pressure,
        archive_cap=options.archive_cap,
        normalised_tradeoff=options.tradeoff == "normalised",
    )


def settings_of_tests(options: Options) -> _core.TestSettings:
    """What the test loop optimises.

    Args:
        options: of the campaign.

    Returns:
        The engine's settings.

    Raises:
        InvalidInput: mutants or caps that cannot be used.
    """
    return _core.TestSettings(
        control_quality=options.control_quality,
        distance_cap=options.distance_cap,
        mutants=options.mutants,
        mutant_step=options.mutant_step,
        mutation_step=options.test_mutation_step,
    )


def start_models(
    options: Options, signals: Signals, seed: int, selected: _core.SelectedTests, workers: _core.Workers
) -> _core.ModelSearch:
    """A random population of models, judged; its non-dominated set is "iteration 0" (paper, section IV.A).

    Args:
        options: of the campaign.
        signals: of the system.
        seed: of the campaign.
        selected: the tests with runs so far.
        workers: how the work is carried out.

    Returns:
        The model loop at generation 0.

    Raises:
        InvalidInput: the engine refused the options.
    """
    programs = grammar(options, signals)
    return _core.ModelSearch.start(
        programs, options.form, variation(options, options.model_population), seed, selected, workers
    )


def start_tests(
    models: _core.ModelSearch,
    setting: _core.Setting,
    task: _core.Task,
    options: Options,
    *,
    seed: int,
    iteration: int,
    workers: _core.Workers,
) -> _core.TestSearch:
    """A random population of tests over the committee of the models (paper, section IV.C).

    Args:
        models: the model loop.
        setting: what tests are flown in.
        task: start, target and length of the tests.
        options: of the campaign.
        seed: of the campaign.
        iteration: which stream of random numbers to use; the campaign counts its asks.
        workers: how the work is carried out.

    Returns:
        The test loop at generation 0.

    Raises:
        InvalidInput: the engine refused the options.
    """
    return _core.TestSearch.start(
        committee(models, options.committee_size),
        setting,
        task,
        settings_of_tests(options),
        variation(options, options.test_population),
        seed,
        iteration,
        workers,
    )


def committee(models: _core.ModelSearch, size: int) -> Sequence[_core.Model]:
    """Members of the non-dominated set that judge tests, the best trade-off first.

    Args:
        models: the model loop.
        size: how many at most.

    Returns:
        Models, spread by crowding.
    """
    archive = models.archive
    return [archive[member] for member in models.committee(size)]
