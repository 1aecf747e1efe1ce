"""Promises: what more terms would gain, before any of them is tuned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from twinloop import _core
from twinloop.identification.context import Context
from twinloop.identification.fit.models import inner, layout, model_of
from twinloop.identification.fit.settling import settled
from twinloop.identification.fit.tuning import moving_together
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.noise import RIDGE


def promises(context: Context, hypothesis: Hypothesis, i: int, nodes: Sequence[int]) -> list[float]:
    """What more terms promise a sum, each by itself: by how much χ² falls in a step of tuning to which it is added.

    All stand in one model with weights of 0, and what each gains beside all that is tuned is read off the slopes of
    that model's errors: the test of Lagrange multipliers (Rao 1948).

    Args:
        context: of the identification.
        hypothesis: with a fit.
        i: number of the sum.
        nodes: of the terms.

    Returns:
        A gain in χ² for each; 0 where the model diverges, and of what is in the sum or says nothing new.
    """
    placed = settled(hypothesis)
    known, sums, fit = placed.sums[i], list(placed.sums), hypothesis.fit
    assert fit is not None
    new = [node for node in nodes if node not in known.weights]
    sums[i] = replace(known, weights={**known.weights, **dict.fromkeys(new, 0.0)})
    beside = replace(placed, candidates=placed.candidates.with_terms(new), sums=tuple(sums))
    model, (_, places) = model_of(context, beside), layout(beside)
    added = list(places[i][len(known.weights) :])
    # Constants inside a term of weight 0 change nothing.
    old = set(inner(placed).values())
    tuned = [place for place, node in inner(beside).items() if node in old]
    tuned += [place for at in places for place in at if place not in added]
    lags = moving_together(model, beside, context.signals)
    gram = _core.linearised(
        model,
        context.limits.engine,
        [chain.engine for chain in fit.observer],
        [run.engine for run in hypothesis.runs],
        free=[*added, *tuned],
        lags=lags,
        workers=context.workers,
    )
    if gram is None:
        return [0.0] * len(nodes)
    others = range(len(added), gram.features)

    def left(*more: int) -> float:
        """χ² after a step of what is tuned, and of more."""
        solved = gram.least_squares([*more, *others], RIDGE)
        return math.inf if solved is None else solved[1]

    before = left()
    gains = {node: before - left(j) for j, node in enumerate(new)}
    return [gain if math.isfinite(gain := gains.get(node, 0.0)) else 0.0 for node in nodes]
