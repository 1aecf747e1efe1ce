"""Subsets of features, judged by least squares within bounds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.identification.terms.bounds import Limits, bounded_solution, excludes_zero

Judged = tuple[tuple[int, ...], float, Floats]
"""A subset of features, its energy, its coefficients."""


def with_what_must_be(
    subsets: list[tuple[int, ...]], gram: _core.Gram, costs: Floats, limits: Limits
) -> list[tuple[int, ...]]:
    """Subsets that hold every term whose bounds exclude 0, as far as the runs can tell those terms apart."""
    required = (
        place for place, bounds in limits.items() if excludes_zero(bounds) and np.isfinite(costs[place])
    )
    must = _distinguishable(gram, required)
    if not must:
        return subsets
    forced = [s if set(must) <= set(s) else tuple(sorted({*s, *must})) for s in subsets]
    if all(gram.solve(list(subset)) is None for subset in forced):
        forced.append(tuple(sorted(must)))
    return forced


def all_judged(
    gram: _core.Gram, subsets: Sequence[tuple[int, ...]], costs: Floats, limits: Limits
) -> list[Judged]:
    """Least squares on subsets; where rounding leaves none of them a solution, on the largest parts that have one.

    Args:
        gram: of the features.
        subsets: of them.
        costs: of each feature, in units of χ².
        limits: bounds of coefficients, by feature.

    Returns:
        Those that have a solution.
    """
    found = [_judged(gram, subset, costs, limits) for subset in dict.fromkeys(subsets)]
    if not any(found):
        parts = dict.fromkeys(_distinguishable(gram, subset) for subset in subsets)
        found = [_judged(gram, subset, costs, limits) for subset in parts]
    return [judged for judged in found if judged]


def _distinguishable(gram: _core.Gram, subset: Iterable[int]) -> tuple[int, ...]:
    """The features of a subset, in order, that those before them do not already span."""
    kept: list[int] = []
    for feature in subset:
        if gram.solve([*kept, feature]) is not None:
            kept.append(feature)
    return tuple(kept)


def _judged(gram: _core.Gram, subset: tuple[int, ...], costs: Floats, limits: Limits) -> Judged | None:
    solved = bounded_solution(gram, subset, limits)
    if solved is None:
        return None
    weights, left = solved
    nothing = [j for j, weight in zip(subset, weights, strict=True) if weight == 0.0 and j in limits]
    if nothing and len(nothing) < len(subset):
        # A term that is held at 0 is no term.
        return _judged(gram, tuple(j for j in subset if j not in nothing), costs, limits)
    return subset, left + float(costs[list(subset)].sum()), weights
