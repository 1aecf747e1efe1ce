"""Subsets of features, judged by least squares within bounds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.identification.terms.bounds import Limits, bounded_solution, excludes_zero


@dataclass(frozen=True, eq=False)
class Judged:
    """A subset of features as least squares have it.

    Args:
        features: of it, in order.
        length: of the description, without what is the same for all subsets, in units of χ².
        weights: coefficients of the features.
    """

    features: tuple[int, ...]
    length: float
    weights: Floats

    def spread(self, features: int) -> Floats:
        """Coefficients of so many features, 0 for those outside the subset."""
        coefficients = np.zeros(features)
        coefficients[list(self.features)] = self.weights
        return coefficients


def all_judged(
    gram: _core.Gram, subsets: Sequence[tuple[int, ...]], costs: Floats, limits: Limits
) -> list[Judged]:
    """Least squares on subsets; where rounding leaves none of them a solution, on the largest parts that have one.

    Terms whose bounds exclude 0 are in every subset, as far as the runs can tell those terms apart.

    Args:
        gram: of the features.
        subsets: of them.
        costs: of each feature, in units of χ².
        limits: bounds of coefficients, by feature.

    Returns:
        Those that have a solution.
    """

    def judged(subset: tuple[int, ...]) -> Judged | None:
        solved = bounded_solution(gram, subset, limits)
        if solved is None:
            return None
        weights, chi_squared = solved
        nothing = [j for j, weight in zip(subset, weights, strict=True) if weight == 0.0 and j in limits]
        if nothing and len(nothing) < len(subset):
            # A term that is held at 0 is no term.
            return judged(tuple(j for j in subset if j not in nothing))
        return Judged(subset, chi_squared + float(costs[list(subset)].sum()), weights)

    bounded = [i for i, bounds in limits.items() if excludes_zero(bounds) and np.isfinite(costs[i])]
    if must := _distinguishable(gram, bounded):
        subsets = [s if set(must) <= set(s) else tuple(sorted({*s, *must})) for s in subsets]
        if all(gram.solve(list(subset)) is None for subset in subsets):
            subsets.append(tuple(sorted(must)))
    found = [judged(subset) for subset in dict.fromkeys(subsets)]
    if not any(found):
        found = [judged(part) for part in dict.fromkeys(_distinguishable(gram, each) for each in subsets)]
    return [each for each in found if each]


def _distinguishable(gram: _core.Gram, subset: Iterable[int]) -> tuple[int, ...]:
    """The features of a subset, in order, that those before them do not already span."""
    kept: list[int] = []
    for feature in subset:
        if gram.solve([*kept, feature]) is not None:
            kept.append(feature)
    return tuple(kept)
