"""What the studies share: the runs, each with its own first controller and seed, one after the other."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop.campaign import Campaign
from twinloop.campaign.history import Iteration
from twinloop.campaign.presets import Options, options_of
from twinloop.faces.console import Watch
from twinloop.faces.result import Result, plain_dict
from twinloop.reproduce.paper import DIFFERENCES, ITERATIONS
from twinloop.systems import Quadrotor

FREQUENCIES = (1.8, 2.2)
"""rad/s, of the first controllers."""


@dataclass(frozen=True)
class Setting:
    """How a study is carried out.

    Args:
        name: of the study.
        runs: how many.
        generations: of the model loop; the test loop keeps its ratio.
        seed: of the whole study.
        threads: of the engine; None: all.
    """

    name: str
    runs: int
    generations: int
    seed: int
    threads: int | None

    @property
    def options(self) -> Options:
        """Options of the campaigns."""
        return options_of("paper", {"model_generations": self.generations})


@dataclass(frozen=True)
class Run:
    """One finished campaign of a study.

    Args:
        number: of the run, from 0.
        natural_frequency: of its first controller, rad/s.
        campaign: with all its iterations.
        system: that it flew.
    """

    number: int
    natural_frequency: float
    campaign: Campaign
    system: Quadrotor


def begin(setting: Setting, number: int, watch: Watch) -> Run:
    """A campaign before its first flight.

    Args:
        setting: of the study.
        number: of the run, from 0.
        watch: shows its progress.

    Returns:
        The run; its first controller and its seed depend on the study's seed and the number alone.
    """
    stream = np.random.SeedSequence(setting.seed).spawn(number + 1)[number]
    low, high = FREQUENCIES
    frequency = low + (high - low) * float(np.random.Generator(np.random.Philox(stream)).random())
    system = Quadrotor(gyroscopic="print", natural_frequency=frequency)
    campaign = Campaign(
        system.signals,
        controller=system.controller,
        initial_state=system.initial_state,
        target_state=system.target_state,
        duration=system.duration,
        preset="paper",
        seed=int(stream.generate_state(1)[0]),
        options={"model_generations": setting.generations},
        threads=setting.threads,
        progress=watch,
    )
    return Run(number, frequency, campaign, system)


def finished_runs(setting: Setting) -> Iterator[Run]:
    """Runs the paper's seven iterations again and again.

    Args:
        setting: of the study.

    Yields:
        Each run when its last iteration is learnt.

    Raises:
        KeyboardInterrupt: Ctrl-C; the runs before are finished.
    """
    with Watch(setting.options, ITERATIONS, setting.name, setting.runs) as watch:
        for number in range(setting.runs):
            watch.begin(number)
            run = begin(setting, number, watch)
            run.campaign.run(run.system, ITERATIONS)
            _ = run.campaign.models  # learns the last flight
            yield run


def described(run: Run) -> Result:
    """A run as numbers: what it started from, and how the best trade-off did on the first test.

    Args:
        run: a finished run.

    Returns:
        Lists by iteration, from 0.
    """
    history = [record for record in run.campaign.history if isinstance(record, Iteration)]
    first = run.campaign.experiments[0]
    return plain_dict(
        {
            "run": run.number,
            "seed": run.campaign.setup.seed,
            "natural_frequency": run.natural_frequency,
            "first_final_distance": first.final_distance,
            "frozen_error": first.frozen,
            "closed_loop": [record.closed_loop[0] for record in history],
            "normalised": [record.normalised[0] for record in history],
            "intron_share": [record.intron_share for record in history],
            "archive_size": [record.archive_size for record in history],
            "capped_generations": [record.capped_generations for record in history],
            "final_distances": [experiment.final_distance for experiment in run.campaign.experiments],
        }
    )


def headed(setting: Setting, finished: int, interrupted: bool) -> Result:
    """What the result of every study begins with.

    Args:
        setting: of the study.
        finished: runs that were finished.
        interrupted: whether Ctrl-C ended it.

    Returns:
        Its name, settings, and where it differs from the paper's.
    """
    return {
        "study": setting.name,
        "seed": setting.seed,
        "runs_asked": setting.runs,
        "runs_finished": finished,
        "interrupted": interrupted,
        "model_generations": setting.generations,
        "test_generations": setting.options.generations_of_tests,
        "differences": list(DIFFERENCES),
    }


def mean(values: Sequence[float]) -> float | None:
    """The arithmetic mean; None of nothing."""
    return statistics.fmean(values) if values else None


def deviation(values: Sequence[float]) -> float | None:
    """The standard deviation of a sample (n − 1); None of fewer than two."""
    return statistics.stdev(values) if len(values) > 1 else None
