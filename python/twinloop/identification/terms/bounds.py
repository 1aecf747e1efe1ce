"""Bounds on constants of a law: least squares and draws that keep within them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.signals import Bounds

Limits = Mapping[int, Bounds]
"""Bounds by the number of what they bound."""
SWEEPS = 200
"""Rounds over all bounds at most, until none moves a weight any more."""
STILL = 1e-9
"""Standard deviations; weights that move by less have stopped."""


def excludes_zero(bounds: Bounds) -> bool:
    """Whether a term with these bounds must be in the law."""
    return not bounds[0] <= 0.0 <= bounds[1]


def within(value: float, bounds: Bounds) -> float:
    """The nearest value that bounds allow."""
    return min(max(value, bounds[0]), bounds[1])


def bounded_solution(
    solved: tuple[Floats, Floats, float], subset: Sequence[int], limits: Limits
) -> tuple[Floats, float]:
    """Least squares on a subset of features, with some of the coefficients kept within bounds.

    Where a coefficient is moved to its bound, the others follow it along their covariance. The forces that hold
    coefficients there are the dual of a small quadratic program, found one after another (Hildreth 1957).

    Args:
        solved: the least squares without bounds: coefficients, their covariance, χ².
        subset: features.
        limits: bounds of coefficients, by feature.

    Returns:
        Coefficients and χ².
    """
    weights, covariance, chi_squared = solved
    boxed = [(i, limits[j]) for i, j in enumerate(subset) if j in limits]
    if all(low <= weights[i] <= high for i, (low, high) in boxed):
        return weights, chi_squared
    forces = np.zeros(len(weights))
    for _ in range(SWEEPS):
        moved = 0.0
        for i, bounds in boxed:
            variance = covariance[i, i]
            free = weights[i] + variance * forces[i]
            change = (free - within(free, bounds)) / variance - forces[i]
            weights = weights - change * covariance[:, i]
            forces[i] += change
            moved = max(moved, abs(change) * float(np.sqrt(variance)))
        if moved < STILL:
            break
    else:
        # Features that hardly differ pass their forces on to each other for long; which are held is clear by then.
        at = {i: high if forces[i] > 0.0 else low for i, (low, high) in boxed if forces[i] != 0.0}
        return _held(solved, dict(boxed), at)
    for i, bounds in boxed:
        weights[i] = within(weights[i], bounds)
    return weights, chi_squared + float((covariance * np.outer(forces, forces)).sum())


def _held(solved: tuple[Floats, Floats, float], boxed: Limits, at: dict[int, float]) -> tuple[Floats, float]:
    """Least squares under equalities: each weight that is held moves the others along what is left of the covariance.

    Args:
        solved: free weights, covariance, χ².
        boxed: bounds of weights, by place.
        at: values at which some of them are held; others that leave their bounds then are held there, too.
    """
    weights, covariance, chi_squared = solved
    waiting = dict(at)
    while waiting:
        for i, value in waiting.items():
            column, variance = covariance[:, i].copy(), float(covariance[i, i])
            if variance > 0.0:
                off = float(weights[i]) - value
                weights = weights - off / variance * column
                covariance = covariance - np.outer(column, column) / variance
                chi_squared += off * off / variance
            covariance[i] = covariance[:, i] = 0.0
            weights[i] = value
        at = at | waiting
        waiting = {
            i: within(float(weights[i]), bounds)
            for i, bounds in boxed.items()
            if i not in at and weights[i] != within(float(weights[i]), bounds)
        }
    return weights, chi_squared


def beyond(model: _core.Model, limits: Limits) -> set[int]:
    """Places of the constants of a model that are not within their bounds.

    Args:
        model: any.
        limits: bounds by place among its constants.
    """
    constants = model.constants.tolist()
    return {place for place, bounds in limits.items() if constants[place] != within(constants[place], bounds)}


def bounded_model(model: _core.Model, limits: Limits) -> _core.Model:
    """A model whose constants are within bounds; the model itself where none is beyond.

    Args:
        model: any.
        limits: bounds by place among its constants.
    """
    constants, outside = model.constants.tolist(), beyond(model, limits)
    for place in outside:
        constants[place] = within(constants[place], limits[place])
    return model.with_constants(constants, None) if outside else model
