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


@dataclass(frozen=True, eq=False)
class Judge:
    """Least squares on subsets of features.

    Args:
        gram: of the features.
        costs: of each feature, in units of χ².
        limits: bounds of coefficients, by feature.
    """

    gram: _core.Gram
    costs: Floats
    limits: Limits

    def __call__(self, subsets: Sequence[tuple[int, ...]]) -> list[Judged]:
        """Subsets as judged; where rounding leaves none of them a solution, the largest parts that have one.

        Terms whose bounds exclude 0 are in every subset, as far as the runs can tell those terms apart.

        Returns:
            Those that have a solution.
        """

        def judged(subset: tuple[int, ...]) -> Judged | None:
            if self.limits:
                free = self.gram.solve(list(subset))
                solved = None if free is None else bounded_solution(free, subset, self.limits)
            else:
                solved = self.gram.least_squares(list(subset))
            if solved is None:
                return None
            weights, chi_squared = solved
            held = [j for i, j in enumerate(subset) if j in self.limits and weights[i] == 0.0]
            if held and len(held) < len(subset):
                # A term that is held at 0 is no term.
                return judged(tuple(j for j in subset if j not in held))
            return Judged(subset, chi_squared + float(self.costs[list(subset)].sum()), weights)

        bounds = self.limits.items()
        needed = [i for i, each in bounds if excludes_zero(each) and np.isfinite(self.costs[i])]
        if must := _distinguishable(self.gram, needed):
            subsets = [s if set(must) <= set(s) else tuple(sorted({*s, *must})) for s in subsets]
            if all(self.gram.least_squares(list(subset)) is None for subset in subsets):
                subsets.append(tuple(sorted(must)))
        found = [judged(subset) for subset in dict.fromkeys(subsets)]
        if not any(found):
            parts = dict.fromkeys(_distinguishable(self.gram, each) for each in subsets)
            found = [judged(part) for part in parts]
        return [each for each in found if each]


def _distinguishable(gram: _core.Gram, subset: Iterable[int]) -> tuple[int, ...]:
    """The features of a subset, in order, that those before them do not already span."""
    kept: list[int] = []
    for feature in subset:
        if gram.least_squares([*kept, feature]) is not None:
            kept.append(feature)
    return tuple(kept)
