"""Table III: how the selected tests control the system, with and without control quality as an objective."""

from __future__ import annotations

import dataclasses
import importlib
import statistics
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from twinloop import _core
from twinloop.campaign.coevolution.search import chunks, start_tests
from twinloop.campaign.history import Progress
from twinloop.errors import NotAvailable
from twinloop.faces.console import Watch
from twinloop.faces.result import Result, plain_dict
from twinloop.faces.text import table
from twinloop.reproduce.paper import ITERATIONS, TABLE_3
from twinloop.reproduce.study import Run, Setting, begin, deviation, headed, mean
from twinloop.test import Test, final_distance

VERSIONS = {"two_objectives": False, "three_objectives": True}
STAGES = (1, ITERATIONS)


def require() -> Any:
    """Scipy's statistics.

    Raises:
        NotAvailable: scipy is not installed.
    """
    try:
        return importlib.import_module("scipy.stats")
    except ImportError as missing:
        raise NotAvailable(
            "Table III needs scipy, which is not installed: pip install 'twinloop[study]'."
        ) from missing


def compute(setting: Setting) -> Result:
    """Runs the study: one campaign for the models, then many test loops on two of its model sets.

    Args:
        setting: of the study.

    Returns:
        By version, lists by stage (after iteration 1, after iteration 7); the paper's; every distance.

    Raises:
        NotAvailable: scipy is missing.
        KeyboardInterrupt: before the first model set was ready.
    """
    statistics_ = require()
    stages: list[dict[str, list[float]]] = []
    interrupted = False
    with Watch(setting.options, ITERATIONS, setting.name) as watch:
        run = begin(setting, 0, watch)
        try:
            for iterations in STAGES:
                run.campaign.run(run.system, iterations)
                models = run.campaign.models
                stages.append({
                    name: _distances(setting, run, models, third, watch) for name, third in VERSIONS.items()
                })  # fmt: skip
        except KeyboardInterrupt:
            interrupted = True
            if not stages:
                raise
    return _summarised(setting, run, stages, interrupted, statistics_)


def _distances(
    setting: Setting, run: Run, models: _core.ModelSearch, third: bool, watch: Watch
) -> list[float]:
    """Final distances on the real system of the tests that the runs of the test loop select."""
    campaign = run.campaign
    options = dataclasses.replace(setting.options, control_quality=third)
    task = _core.Task(campaign.setup.initial_state, campaign.setup.target_state, campaign.setup.steps)
    workers = _core.Workers(threads=campaign.threads)
    distances = []
    for seed in np.random.SeedSequence([setting.seed, 3]).generate_state(setting.runs).tolist():
        first = start_tests(
            models, campaign.setup.setting, task, options, seed=seed, iteration=1, workers=workers
        )
        generations = options.generations_of_tests
        for search, left in chunks(first, lambda s, n: s.advance(n, workers), generations):
            iteration = campaign.history[-1].iteration
            watch(Progress(
                "tests", iteration, generations - left, generations, len(campaign.experiments), (), (), (),
                search.archive_size, search.evaluations,
            ))  # fmt: skip
        test = Test(
            campaign.family,
            search.best_genes,
            campaign.setup.initial_state,
            campaign.setup.target_state,
            campaign.setup.steps,
        )
        distances.append(
            final_distance(run.system.run(test).states[-1], test.target_state, run.system.signals)
        )
    return distances


def _summarised(
    setting: Setting,
    run: Run,
    stages: Sequence[Mapping[str, list[float]]],
    interrupted: bool,
    scipy_stats: Any,
) -> Result:
    campaign = run.campaign
    nothing = final_distance(campaign.setup.initial_state, campaign.setup.target_state, campaign.signals)
    two, three = VERSIONS
    versions = {
        name: {
            "mean": [mean(stage[name]) for stage in stages],
            "std": [deviation(stage[name]) for stage in stages],
            "median": [statistics.median(stage[name]) for stage in stages],
            "normalised_mean": [mean([distance / nothing for distance in stage[name]]) for stage in stages],
            "normalised_std": [
                deviation([distance / nothing for distance in stage[name]]) for stage in stages
            ],
            "final_distances": [stage[name] for stage in stages],
        }
        for name in VERSIONS
    }
    return plain_dict(
        {
            **headed(setting, setting.runs if not interrupted else 0, interrupted),
            "iterations": list(STAGES[: len(stages)]),
            **versions,
            "mann_whitney_p": [
                float(scipy_stats.mannwhitneyu(stage[two], stage[three], alternative="two-sided").pvalue)
                for stage in stages
            ],
            "first_controller": campaign.experiments[0].final_distance,
            "doing_nothing": nothing,
            "natural_frequency": run.natural_frequency,
            "paper": TABLE_3,
        }
    )


def render(result: Mapping[str, Any]) -> str:
    """The table as text.

    Args:
        result: of `compute`.

    Returns:
        Text.
    """
    rows: list[list[object]] = []
    for name in VERSIONS:
        label, paper, ours = name.replace("_", " "), result["paper"][name], result[name]
        rows.append([label, "paper", paper["mean"], paper["std"], None, None])
        for i, iteration in enumerate(result["iterations"]):
            stage = f"ours, after iteration {iteration}"
            rows.append(
                [label, stage, ours["mean"][i], ours["std"][i], ours["median"][i], ours["normalised_mean"][i]]
            )
    tests = [
        f"after iteration {iteration}: p = {p:.3g}"
        for iteration, p in zip(result["iterations"], result["mann_whitney_p"], strict=True)
    ]
    lines = [
        "Table III: final distance on the real system of the selected tests",
        "",
        table(["version", "", "mean", "st. dev.", "median", "normalised mean"], rows),
        "",
        (
            f"Normalised: over doing nothing, {result['doing_nothing']:.4g}. "
            f"The first controller: {result['first_controller']:.4g}."
        ),
        f"Two-sided Mann-Whitney test of the two versions: {'; '.join(tests)}.",
    ]
    return "\n".join(lines)
