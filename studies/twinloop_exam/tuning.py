"""Chooses the hyper-parameters of the others on the tuning seeds, by a small grid for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from twinloop_exam.kinds import Fitter, Tuner
from twinloop_exam.measures import quantiles
from twinloop_exam.results import Results
from twinloop_exam.tables import Table

EXPERIMENTS = (2, 4)
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
        return replace(who, settings=settings, experiments=EXPERIMENTS)
    return replace(who, settings=settings)


def score(results: Results, system: str, who: Tunable) -> float:
    """How good a variant is, to be minimised.

    Args:
        results: of this variant alone.
        system: name.
        who: the variant.

    Returns:
        The median over seeds of a fit's median and 90th percentile of the held-out error after each of
        `EXPERIMENTS`, and the geometric mean of these four; or the median of an optimiser's last quality. It lets a
        few runs that diverge count, and no more. Infinite if more do, or if anything failed or is missing.
    """
    fits = isinstance(who, Fitter)
    measures = ("error_median", "error_p90") if fits else ("quality",)
    numbers = []
    for k in EXPERIMENTS if isinstance(who, Fitter) else (who.flights - 1,):
        if results.failures(system, who.name, k):
            return math.inf
        for measure in measures:
            found = results.values(system, who.name, measure, k)
            if not found:
                return math.inf
            numbers += quantiles(list(found.values()), [0.5])
    return math.exp(math.fsum(math.log(max(value, 1e-300)) for value in numbers) / len(numbers))


def tuned(who: Tunable, scores: Sequence[tuple[Tunable, float]]) -> Table:
    """What the grid says of one learner, the best first.

    Args:
        who: the learner with the settings that the code has.
        scores: of each variant.

    Returns:
        A table.
    """
    names = list(who.grid)
    rows = [
        [
            *(str(variant.settings[name]) for name in names),
            f"{found:.3g}",
            "in the code" if variant.settings == who.settings else "",
        ]
        for variant, found in sorted(scores, key=lambda pair: pair[1])
    ]
    return Table(f"{who.name}: geometric mean of medians over seeds", [*names, "score", ""], rows)


def tuned_as_values(who: Tunable, scores: Sequence[tuple[Tunable, float]]) -> list[dict[str, object]]:
    """The same for a program to read.

    Args:
        who: the learner with the settings that the code has.
        scores: of each variant.

    Returns:
        Its settings, its score and whether it is in the code, of each variant, the best first.
    """
    return [
        {
            "learner": who.name,
            "settings": {name: variant.settings[name] for name in who.grid},
            "score": found,
            "in_the_code": variant.settings == who.settings,
        }
        for variant, found in sorted(scores, key=lambda pair: pair[1])
    ]
