"""Chooses the hyper-parameters of the others on the tuning seeds, by a small grid for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from twinloop.exam.learners import Fitter, Learner, Tuner
from twinloop.exam.results import Results, spread
from twinloop.exam.tables import Table

SEEDS = range(10)
EXPERIMENTS = 2
"""After Υ0, of the flights on which the fits are compared."""

Tunable = Fitter | Tuner


def variants(who: Tunable) -> list[Tunable]:
    """A learner with every combination of its grid's values.

    Args:
        who: the learner.

    Returns:
        Copies that differ in their settings.
    """
    names = list(who.grid)
    return [
        _varied(who, {**who.settings, **dict(zip(names, values, strict=True))})
        for values in product(*(who.grid[name] for name in names))
    ]


def _varied(who: Tunable, settings: dict[str, object]) -> Tunable:
    if isinstance(who, Fitter):
        return replace(who, settings=settings, experiments=(EXPERIMENTS,))
    return replace(who, settings=settings)


def score(results: Results, system: str, who: Tunable) -> tuple[float, float]:
    """How good a variant is, to be minimised: the second number decides.

    Args:
        results: of this variant alone.
        system: name.
        who: the variant.

    Returns:
        For a fit the medians over seeds of the median and of the 90th percentile of the held-out error; for
        an optimiser the third quartile and the median over seeds of the last quality. Infinite if a seed
        failed.
    """
    last = EXPERIMENTS if isinstance(who, Fitter) else who.flights - 1
    if results.failures(system, who.name, last) or not results.rows(system, who.name):
        return math.inf, math.inf
    if isinstance(who, Fitter):
        middle = spread(results.values(system, who.name, "error_median", last))
        tail = spread(results.values(system, who.name, "error_p90", last))
        return (math.inf, math.inf) if middle is None or tail is None else (middle.median, tail.median)
    found = spread(results.values(system, who.name, "quality", last))
    return (math.inf, math.inf) if found is None else (found.high, found.median)


def tuned(who: Tunable, scores: Sequence[tuple[Learner, tuple[float, float]]]) -> Table:
    """What the grid says of one learner, the best first.

    Args:
        who: the learner with the settings that the code has.
        scores: of each variant.

    Returns:
        A table.
    """
    names = list(who.grid)
    ordered = sorted(scores, key=lambda pair: pair[1][1])
    rows = []
    for variant, (first, decides) in ordered:
        assert isinstance(variant, Fitter | Tuner)
        here = "in the code" if variant.settings == who.settings else ""
        rows.append(
            [*(str(variant.settings[name]) for name in names), f"{first:.3g}", f"{decides:.3g}", here]
        )
    kind = ("median", "90th percentile") if isinstance(who, Fitter) else ("third quartile", "median")
    return Table(f"{who.name}, seeds {SEEDS.start} to {SEEDS.stop - 1}", [*names, *kind, ""], rows)
