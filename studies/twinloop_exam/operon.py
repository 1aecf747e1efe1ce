"""Symbolic regression by pyoperon on smoothed accelerations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.law.parsing import program_of
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory
from twinloop_exam.library import model_inputs, variables_of

DIGITS = 17


def fit(
    trajectories: Sequence[Trajectory], signals: Signals, settings: Mapping[str, object], seed: int
) -> _core.Model:
    """Accelerations as evolved formulas.

    Args:
        trajectories: flights as measured.
        signals: of the system.
        settings: "window" (periods over which a state's change and the inputs' mean are taken), "evaluations"
            (of formulas, for each acceleration), "length" (largest, in nodes), "variables" ("rates" or
            "all").
        seed: of the search.

    Returns:
        A model in the form "acceleration".
    """
    variables = variables_of(str(settings["variables"]), signals)
    inputs, targets = samples(trajectories, signals, variables, int(str(settings["window"])))
    searches = [search(inputs, target, settings, seed + i) for i, target in enumerate(targets.T)]
    names = {f"X{i + 1}": register for i, register in enumerate(variables)}
    formulas = [formula(found) for found in searches]
    return _core.Model(program_of(formulas, names, signals.n_x + signals.n_u), "acceleration", signals.engine)


def samples(
    trajectories: Sequence[Trajectory], signals: Signals, variables: Sequence[int], window: int
) -> tuple[Floats, Floats]:
    """Accelerations averaged over a window, and the means of the inputs over it.

    It is the integral form as far as a search that knows nothing of integrals allows.

    Args:
        trajectories: flights as measured.
        signals: of the system.
        variables: inputs of the model that may appear.
        window: periods.

    Returns:
        Inputs (rows, variables) and accelerations (rows, outputs).
    """
    inputs, targets = [], []
    for run in trajectories:
        if run.steps < window:
            continue
        middles = model_inputs(0.5 * (run.states[:-1] + run.states[1:]), run.commands, signals)
        kernel = np.full(window, 1.0 / window)
        columns = [np.convolve(middles[:, i], kernel, mode="valid") for i in variables]
        inputs.append(np.stack(columns, axis=1))
        learnt = run.states[:, list(signals.driven)]
        targets.append((learnt[window:] - learnt[:-window]) / (window * signals.dt))
    return np.vstack(inputs), np.vstack(targets)


def search(inputs: Floats, target: Floats, settings: Mapping[str, object], seed: int) -> Any:
    """One symbolic regression.

    Args:
        inputs: (rows, variables).
        target: (rows,).
        settings: as for `fit`.
        seed: of the search.

    Returns:
        Its regressor, fitted.
    """
    from pyoperon.sklearn import SymbolicRegressor

    regressor = SymbolicRegressor(
        allowed_symbols="add,sub,mul,constant,variable",
        max_length=int(str(settings["length"])),
        max_evaluations=int(str(settings["evaluations"])),
        generations=10_000,
        population_size=500,
        optimizer_iterations=5,
        random_state=seed,
        n_threads=1,
    )
    return regressor.fit(inputs, target)


def formula(regressor: Any) -> str:
    """What a regressor found, with all the digits it has.

    Args:
        regressor: fitted.

    Returns:
        A formula of X1, X2, ….
    """
    text: str = regressor.get_model_string(regressor.model_, DIGITS)
    return text
