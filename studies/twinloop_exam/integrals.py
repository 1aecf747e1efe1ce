"""Rows of a regression that is linear in the coefficients of a library: increments, or integrals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import unknown
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory
from twinloop_exam.library import Library, model_inputs

FORMS = ("increment", "integral")


@dataclass(frozen=True, eq=False)
class Rows:
    """A least-squares problem for one acceleration.

    Args:
        features: (rows, terms).
        target: (rows,).
    """

    features: Floats
    target: Floats


def regression(
    form: str, trajectories: Sequence[Trajectory], signals: Signals, library: Library
) -> list[Rows]:
    """Rows for each acceleration that has to be learnt.

    Args:
        form: "increment": what a state changes by in a period, against the mean of the features over it;
            "integral": a state, and the states it is the derivative of, against the features' running sums.
        trajectories: flights as measured.
        signals: of the system.
        library: of the features.

    Returns:
        A problem for each output of a model in the form "acceleration".

    Raises:
        InvalidInput: another form.
    """
    if form not in FORMS:
        raise unknown("form of a regression", form, FORMS)
    means = [_means(run, signals, library) for run in trajectories]
    states = list(signals.driven)
    if form == "increment":
        features = np.vstack(means)
        return [
            Rows(features, np.concatenate([np.diff(run.states[:, i]) / signals.dt for run in trajectories]))
            for i in states
        ]
    sums = [_running(mean, signals.dt) for mean in means]
    return [_integral(_chain(i, signals), trajectories, sums, signals.dt) for i in states]


def _means(run: Trajectory, signals: Signals, library: Library) -> Floats:
    """Mean of each feature over each period (n, terms): trapezoid in the states, the command is held."""
    before = library.values(model_inputs(run.states[:-1], run.commands, signals))
    after = library.values(model_inputs(run.states[1:], run.commands, signals))
    return np.asarray(0.5 * (before + after))


def _running(rates: Floats, dt: float) -> Floats:
    """Integral from the start of values that hold for a period each (n, terms) → (n + 1, terms)."""
    return np.vstack([np.zeros((1, rates.shape[1])), dt * np.cumsum(rates, axis=0)])


def _chain(state: int, signals: Signals) -> list[int]:
    """The state, what it is the derivative of, and so on."""
    names = list(signals.state_names)
    chain = [state]
    while (parent := signals.states[chain[-1]].derivative_of) is not None:
        chain.append(names.index(parent))
    return chain


def _integral(chain: list[int], runs: Sequence[Trajectory], sums: Sequence[Floats], dt: float) -> Rows:
    """Rows of a state and its integrals, each over the noise that it shows, free of the initial state.

    The sensors' noise is not told to anyone: it is estimated from what a first fit, to the first state of
    the chain alone, leaves of each state.
    """
    levels: list[list[Floats]] = [list(sums)]
    for _ in chain[1:]:
        levels.append([_running(0.5 * (level[1:] + level[:-1]), dt) for level in levels[-1]])
    first = _free_of_start(chain, runs, levels, dt, [1.0] + [0.0] * (len(chain) - 1))
    guess = np.linalg.lstsq(first.features, first.target, rcond=1e-9)[0]
    weights = []
    for depth in range(len(chain)):
        alone = [1.0 if level == depth else 0.0 for level in range(len(chain))]
        rows = _free_of_start(chain, runs, levels, dt, alone)
        left = rows.target - rows.features @ guess
        spread = float(np.sqrt(np.mean(left**2) * len(left) / max(1, len(left) - (depth + 1) * len(runs))))
        weights.append(1.0 / max(spread, 1e-9))
    top = max(weights)
    return _free_of_start(chain, runs, levels, dt, [weight / top for weight in weights])


def _free_of_start(
    chain: list[int],
    runs: Sequence[Trajectory],
    levels: Sequence[Sequence[Floats]],
    dt: float,
    weights: Sequence[float],
) -> Rows:
    """Weighted rows of the levels with a weight, with each flight's unknown initial values projected out."""
    features, targets = [], []
    used = [depth for depth, weight in enumerate(weights) if weight > 0.0]
    for number, run in enumerate(runs):
        t = dt * np.arange(run.steps + 1)
        columns, left, right = [], [], []
        for depth in used:
            weight = weights[depth]
            # The initial values of this state and of those before it in the chain act as a polynomial in t.
            powers = [
                t ** (depth - i) / float(np.prod(np.arange(1, depth - i + 1)))
                if i <= depth
                else np.zeros_like(t)
                for i in range(used[-1] + 1)
            ]
            columns.append(weight * np.stack(powers, axis=1))
            left.append(weight * levels[depth][number])
            right.append(weight * run.states[:, chain[depth]])
        basis = np.linalg.qr(np.vstack(columns))[0]
        stacked, target = np.vstack(left), np.concatenate(right)
        features.append(stacked - basis @ (basis.T @ stacked))
        targets.append(target - basis @ (basis.T @ target))
    return Rows(np.vstack(features), np.concatenate(targets))
