"""Drives: in which proportion inputs drive a chain, also where something limits what they do.

A servo turns only so fast, an inner loop accelerates only so much. Through such a limit a regression still sees roughly
in which proportion inputs drive a chain (Bussgang 1952), and better where they drive it less.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.search.noise import RIDGE
from twinloop.identification.search.problem import Problem
from twinloop.identification.sensors.chains import Chain

WITHIN = (0.8, 0.65, 0.5, 0.35, 0.25, 0.18, 0.13)
"""Shares of the periods, in which inputs drive a chain least, by which their coefficients are estimated in turn."""
BENDS = tuple(share / 10.0 for share in range(1, 10))
"""Shares of the periods below the places at which what drives a chain may be bent."""


def drive(problem: Problem, chain: Chain, inputs: Sequence[int]) -> dict[int, float]:
    """Coefficients of inputs that drive a chain together through a limit, where there is one, up to a factor.

    They are estimated in turn where they drive it less and less; those are taken by whose sum, bent at any places, the
    chain is described best: of few periods there is more noise in them, of many more of the limit.

    Args:
        problem: of the chain.
        chain: that is driven.
        inputs: at least two that were found usable.

    Returns:
        Coefficients by input; all 0 where nothing can be told.
    """

    def solved(*features: Floats) -> tuple[Floats, float]:
        columns = np.concatenate(features, axis=2)
        gram = problem.gram(chain, columns)
        answer = gram.least_squares(range(columns.shape[2]), RIDGE)
        return (np.zeros(columns.shape[2]), np.inf) if answer is None else answer

    columns = problem.values([*problem.usable([problem.pool.one]), *inputs])
    found, least = np.zeros(len(inputs)), np.inf
    for driven in (None, *_followed(columns[:, :, 1:], inputs, chain)):
        for share in WITHIN:
            within = np.ones(1) if driven is None else _least(driven, share)
            coefficients, _ = solved(*(columns * part for part in (within, 1.0 - within) if part.any()))
            coefficients = coefficients[: columns.shape[2]]
            driven = (columns * coefficients).sum(axis=2)
            bent = np.maximum(0.0, driven[:, :, np.newaxis] - np.quantile(driven, BENDS))
            _, left = solved(columns, bent)
            if left < least:
                found, least = coefficients[1:], left
    return dict(zip(inputs, found.tolist(), strict=True))


def _least(driven: Floats, share: float) -> Floats:
    """1 in such a share of the periods, in which a chain is driven least, 0 in others (3, rows, 1)."""
    size = np.abs(driven)
    calm: Floats = (size <= np.quantile(size, share))[:, :, np.newaxis].astype(float)
    return calm


def _followed(columns: Floats, inputs: Sequence[int], chain: Chain) -> Iterator[Floats]:
    """How far the last state of a chain is from the input that it resembles most, both by their spreads (3, rows).

    A state that follows a command is hardly driven where it has come near. None where it resembles no other.
    """
    own, spread = [inputs.index(i) for i in chain.states if i in inputs], columns[0].std(axis=0)
    others = [place for place in range(len(inputs)) if place not in own and spread[place] > 0.0]
    if not own or not others or not spread[own[-1]] > 0.0:
        return
    standard = (columns - columns[0].mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    state = standard[:, :, own[-1]]
    alike = [float((state[0] * standard[0, :, place]).mean()) for place in others]
    nearest = max(range(len(others)), key=lambda number: abs(alike[number]))
    yield state - np.sign(alike[nearest]) * standard[:, :, others[nearest]]
