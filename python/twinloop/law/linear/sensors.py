"""Sensors that are late or early, around a point: what they read is a sum of states now and some periods before."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.law import Law
from twinloop.law.linear.jacobian import jacobian
from twinloop.law.linear.state_space import Linear

ORDER = 8
"""Terms of an exponential series; that of integrals of integrals ends after a few."""


def as_read(law: Law, plain: Linear, inputs: Floats) -> Linear:
    """A linear law with what its sensors read.

    Args:
        law: of a twin.
        plain: the law around a point, every state read in time.
        inputs: of the equations at the point.

    Returns:
        The same; in discrete time, with the states of as many earlier periods as the sensors reach back.
    """
    offsets = np.array(law.offsets)
    if not offsets.any():
        return plain
    size = len(plain.A)
    if plain.dt is None:
        return replace(plain, offsets=np.concatenate([offsets, np.zeros(size - len(offsets))]))
    periods = offsets / plain.dt
    reach = max(1, math.ceil(periods.max()))
    whole = _with_past(plain, law.signals.n_x, reach)
    moving = _kinematics(law, inputs)
    for state in np.flatnonzero(offsets):
        row = _late(moving, float(periods[state]), plain.dt, int(state))
        if periods[state] < 0.0:
            row = _early(moving, -float(offsets[state]), plain.dt, law.signals.driven)[:, state]
        whole.C[state] = 0.0
        for back, weights in enumerate(row):
            first = 0 if back == 0 else size + (back - 1) * len(offsets)
            whole.C[state, first : first + len(offsets)] = weights
    return whole


def _with_past(plain: Linear, n_x: int, reach: int) -> Linear:
    """With the states of earlier periods behind the others, the latest first."""
    size = len(plain.A)
    n = size + reach * n_x
    A, B = np.zeros((n, n)), np.zeros((n, plain.B.shape[1]))
    A[:size, :size], B[:size] = plain.A, plain.B
    for back in range(reach):
        first = 0 if back == 0 else size + (back - 1) * n_x
        A[size + back * n_x : size + (back + 1) * n_x, first : first + n_x] = np.eye(n_x)
    before = [f"{name}_{back}_before" for back in range(1, reach + 1) for name in plain.states[:n_x]]
    return replace(
        plain,
        A=A,
        B=B,
        C=np.eye(n),
        states=(*plain.states, *before),
        state=np.concatenate([plain.state, np.tile(plain.state[:n_x], reach)]),
        drift=np.concatenate([plain.drift, np.zeros(reach * n_x)]),
        offsets=np.zeros(n),
    )


def _kinematics(law: Law, inputs: Floats) -> Floats:
    """How other states move each one that they give (n_x, n_x)."""
    n_x = law.signals.n_x
    _, slopes = jacobian(law.expressions, law.derivatives(), inputs)
    moving = np.array(slopes[:, :n_x])
    moving[list(law.signals.driven)] = 0.0
    return moving


def _late(moving: Floats, periods: float, dt: float, state: int) -> Floats:
    """Weights (back + 1, n_x) of the states now and before: Hermite's cubic between the two around the time."""
    back = math.ceil(periods)
    share = back - periods
    rest = 1.0 - share
    weights = np.zeros((max(back, 0) + 1, len(moving)))
    if back < 1:
        return weights
    weights[back, state] = rest * rest * (1.0 + 2.0 * share)
    weights[back - 1, state] = share * share * (3.0 - 2.0 * share)
    weights[back] += dt * share * rest * rest * moving[state]
    weights[back - 1] -= dt * share * share * rest * moving[state]
    return weights


def _early(moving: Floats, ahead: float, dt: float, driven: tuple[int, ...]) -> Floats:
    """Weights (2, n_x, n_x) of the states now and a period before, for all sensors that are so much ahead, s."""
    term = going = np.eye(len(moving))
    for order in range(1, ORDER):
        term = term @ moving * (ahead / order)
        going = going + term
    # What is driven goes on as it did over the last period; its mean over the time is what moves the others.
    trend = np.zeros((len(moving), len(moving)))
    trend[list(driven), list(driven)] = 0.5 * ahead / dt
    trend = (going - np.eye(len(moving))) @ trend
    return np.stack([going + trend, -trend])
