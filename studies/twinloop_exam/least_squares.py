"""The baseline that anything learnt must beat: ridge regression on all monomials to degree 2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory
from twinloop_exam.integrals import regression
from twinloop_exam.library import monomials, variables_of


def fit(
    trajectories: Sequence[Trajectory], signals: Signals, settings: Mapping[str, object], seed: int
) -> _core.Model:
    """Accelerations as polynomials.

    Args:
        trajectories: flights as measured.
        signals: of the system.
        settings: "form" ("increment" or "integral"), "ridge" (relative to the features' mean square) and
            "variables" ("rates" or "all").
        seed: not used; nothing here is random.

    Returns:
        A model in the form "acceleration".
    """
    library = monomials(variables_of(str(settings["variables"]), signals))
    problems = regression(str(settings["form"]), trajectories, signals, library)
    ridge = float(str(settings["ridge"]))
    coefficients = [ridge_fit(rows.features, rows.target, ridge) for rows in problems]
    return library.model(np.stack(coefficients, axis=1), signals)


def ridge_fit(features: Floats, target: Floats, ridge: float) -> Floats:
    """Least squares with a penalty on coefficients, the features brought to one scale.

    Args:
        features: (rows, terms).
        target: (rows,).
        ridge: penalty, relative to the mean square of a feature.

    Returns:
        Coefficients (terms,), of the features as they were passed.
    """
    scales = np.sqrt(np.mean(features**2, axis=0))
    scales[scales == 0.0] = 1.0
    left, spectrum, right = np.linalg.svd(features / scales, full_matrices=False)
    # The pseudo-inverse's own cut-off: below it a direction is rounding, not data.
    kept = spectrum > 1e-12 * spectrum[0]
    shrunk = np.where(kept, spectrum, 1.0) / (np.where(kept, spectrum, 1.0) ** 2 + ridge * len(target))
    return np.asarray(right.T @ (np.where(kept, shrunk, 0.0) * (left.T @ target)) / scales)
