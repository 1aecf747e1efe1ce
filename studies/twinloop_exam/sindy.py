"""PySINDy's sparse regression, in its own form and on the integral rows that ours would see."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory
from twinloop_exam.integrals import regression
from twinloop_exam.library import Library, model_inputs, monomials, variables_of


def fit(
    trajectories: Sequence[Trajectory], signals: Signals, settings: Mapping[str, object], seed: int
) -> _core.Model:
    """Accelerations as sparse polynomials.

    Args:
        trajectories: flights as measured.
        signals: of the system.
        settings: "form" ("derivative": PySINDy's smoothed finite differences; "integral": its optimiser on
            running sums), "threshold" and "alpha" of STLSQ, "ensemble" (models of a bagged ensemble, 0: one
            model), "variables" ("rates" or "all").
        seed: of the ensemble.

    Returns:
        A model in the form "acceleration".
    """
    variables = variables_of(str(settings["variables"]), signals)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its advice on sparsity is for a person at a notebook
        if settings["form"] == "derivative":
            library, coefficients = own_form(trajectories, signals, variables, settings, seed)[1:]
        else:
            library = monomials(variables)
            coefficients = _integral_form(trajectories, signals, library, settings, seed)
    return library.model(coefficients, signals)


def own_form(
    trajectories: Sequence[Trajectory],
    signals: Signals,
    variables: Sequence[int],
    settings: Mapping[str, object],
    seed: int,
) -> tuple[Any, Library, Floats]:
    """PySINDy as its documentation has it: differentiate, then regress.

    Args:
        trajectories: flights as measured.
        signals: of the system.
        variables: inputs of the model that may appear.
        settings: as for `fit`.
        seed: of the ensemble.

    Returns:
        Its own model, the library in Twinloop's terms, and the coefficients (terms, outputs).
    """
    import pysindy

    learnt = list(signals.driven)
    given = [i for i in variables if i not in learnt]
    states, inputs = [], []
    for run in trajectories:
        # The last state has no command: PySINDy wants as many of one as of the other.
        states.append(np.ascontiguousarray(run.states[:-1][:, learnt]))
        inputs.append(np.ascontiguousarray(model_inputs(run.states[:-1], run.commands, signals)[:, given]))
    np.random.seed(seed)  # its ensembles draw from NumPy's global generator, there is no other door
    model = pysindy.SINDy(
        optimizer=_optimiser(settings),
        feature_library=pysindy.PolynomialLibrary(degree=2),
        differentiation_method=pysindy.SmoothedFiniteDifference(),
    )
    model.fit(states, t=signals.dt, u=inputs)
    order = learnt + given
    powers = np.asarray(model.feature_library.powers_, dtype=int)
    terms = [tuple(order[i] for i, power in enumerate(row) for _ in range(power)) for row in powers]
    coefficients = np.asarray(model.coefficients(), dtype=np.float64).T
    return model, Library(tuple(terms)), coefficients


def _integral_form(
    trajectories: Sequence[Trajectory],
    signals: Signals,
    library: Library,
    settings: Mapping[str, object],
    seed: int,
) -> Floats:
    found = []
    for rows in regression("integral", trajectories, signals, library):
        # Thresholds are on coefficients: to mean something they need features of one size.
        scales = np.sqrt(np.mean(rows.features**2, axis=0))
        scales[scales == 0.0] = 1.0
        size = float(np.sqrt(np.mean(rows.target**2))) or 1.0
        np.random.seed(seed)
        optimiser = _optimiser(settings)
        optimiser.fit(rows.features / scales, (rows.target / size)[:, np.newaxis])
        found.append(np.asarray(optimiser.coef_, dtype=np.float64).ravel() * size / scales)
    return np.stack(found, axis=1)


def _optimiser(settings: Mapping[str, object]) -> Any:
    import pysindy

    threshold, alpha = float(str(settings["threshold"])), float(str(settings["alpha"]))
    sparse = pysindy.STLSQ(threshold=threshold, alpha=alpha)
    members = int(str(settings["ensemble"]))
    if members == 0:
        return sparse
    return pysindy.EnsembleOptimizer(sparse, bagging=True, n_models=members)
