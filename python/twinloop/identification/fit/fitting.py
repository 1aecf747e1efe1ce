"""Fitting: a hypothesis gets a model whose constants are tuned on predictions; outliers and weak terms go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twinloop.identification.context import Context
from twinloop.identification.fit.innovations import Described
from twinloop.identification.fit.models import bounds_of, layout, model_of
from twinloop.identification.fit.predictions import without_outliers
from twinloop.identification.fit.support import supported
from twinloop.identification.fit.tuning import tune
from twinloop.identification.fit.unused import without_unused
from twinloop.identification.hypothesis import Fit, Hypothesis
from twinloop.identification.search.structure import Sum, Weights, prices
from twinloop.identification.sensors.chains import Chain, stirred
from twinloop.identification.terms.bounds import excludes_zero
from twinloop.law.actuation import Actuation

TURNS = 4
"""Times at most that a model is tuned again with the noise that was estimated behind it."""
GAIN = 1.0
"""What another noise must gain, in units of χ², for a model to be tuned with it again."""
PRUNINGS = 3
"""How often terms that tuning has shown to be nothing are dropped."""


def fitted(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with its model tuned, without outliers and without terms that tuning has shown to be nothing.

    The noise that its innovations say takes the place of the one that it had, for the model is tuned by noise and the
    noise estimated behind the model.
    """
    best = Described(context, _pruned(context, hypothesis))
    for _ in range(TURNS):
        if best.gained <= GAIN:
            break
        other = Described(context, _tuned(context, best.under_noise)[0])
        evidence = other.hypothesis.evidence
        if not evidence.stable or best.hypothesis.evidence.length < evidence.length - GAIN:
            break
        best = other
    return best.hypothesis


def _pruned(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis tuned, without outliers, weak terms and terms that share too few readings."""
    best, fit = _tuned(context, hypothesis)
    if not fit.stable or not context.options.tuning:
        return best
    cleaned = without_outliers(context, best) if context.options.outliers else best
    if cleaned is not best:
        best, fit = _tuned(context, cleaned)
    prunes = context.options.pruning and hypothesis.form != "absolute"
    for _ in range(PRUNINGS if prunes else 0):
        kept, saved = _without_weak(best, fit)
        if saved == 0.0:
            break
        other, pruned = _tuned(context, replace(best, sums=tuple(kept)))
        if not pruned.chi_squared - fit.chi_squared < saved:
            break
        best, fit = other, pruned
    for _ in range(PRUNINGS if context.options.support else 0):
        fewer = supported(context, best)
        if fewer is best:
            break
        other, _ = _tuned(context, fewer)
        if not other.evidence.stable:
            break
        best = other
    return best


def _tuned(context: Context, hypothesis: Hypothesis) -> tuple[Hypothesis, Fit]:
    """The hypothesis with its model tuned, and that fit."""
    hypothesis = without_unused(hypothesis)
    sums, steps = hypothesis.sums, context.options.tuning_steps
    driven = [found.chain for found in sums]
    observer = [*driven, *stirred(hypothesis.given, driven, context.signals)]
    fit, _ = tune(context, hypothesis, model_of(context, hypothesis), observer, steps)
    if not fit.stable:
        # Held to its readings at every step it cannot diverge; from there it may be let go.
        held = [_held(chain, context.signals.dt) for chain in observer]
        fit, _ = tune(context, hypothesis, fit.model, held, steps)
        freed, _ = tune(context, hypothesis, fit.model, observer, steps)
        if freed.stable:
            fit = freed
        else:
            sums = tuple(replace(found, chain=chain) for found, chain in zip(sums, held, strict=False))
    tuned = with_fit(replace(hypothesis, sums=sums), fit)
    return replace(tuned, actuation=Actuation.of(fit.model, context.signals)), fit


def with_fit(hypothesis: Hypothesis, fit: Fit) -> Hypothesis:
    """The hypothesis with a fit, and with the weights of its model where that is stable."""
    if not fit.stable or hypothesis.form == "absolute":
        return replace(hypothesis, fit=fit)
    values, places = fit.model.constants.tolist(), layout(hypothesis)[1]
    sums = tuple(
        replace(found, weights=dict(zip(found.weights, (values[place] for place in at), strict=True)))
        for found, at in zip(hypothesis.sums, places, strict=True)
    )
    return replace(hypothesis, sums=sums, fit=fit)


def _held(chain: Chain, dt: float) -> Chain:
    """The chain with so much disturbance that its observer believes every reading."""
    period = dt if chain.integrated else 1.0
    white = max(chain.motion.white, float(chain.sensors[0]) / period)
    return chain.with_noise(chain.sensors, (white, chain.motion.correlated, chain.motion.correlation_time))


def _without_weak(hypothesis: Hypothesis, fit: Fit) -> tuple[list[Sum], float]:
    """The sums without terms whose uncertain weights do not pay for them, and what those cost."""
    if not fit.covariance.size:
        # A small change of a constant makes it diverge: nothing is known of weights.
        return list(hypothesis.sums), 0.0
    free, places = layout(hypothesis)
    variances = dict(zip(free, np.diag(fit.covariance).tolist(), strict=False))
    saved, kept = 0.0, []
    for found, at in zip(hypothesis.sums, places, strict=True):
        must = {term for term, bounds in bounds_of(hypothesis, found).items() if excludes_zero(bounds)}
        readings = sum(int(run.weights[:, found.chain.states[0]].sum()) for run in hypothesis.runs)
        costs = prices(hypothesis.pool, list(found.weights), readings, len(hypothesis.runs)).tolist()
        weights: Weights = {}
        for place, cost, (term, weight) in zip(at, costs, found.weights.items(), strict=True):
            # A constant at its bound has no variance, but is no term if that bound is 0.
            pays = weight != 0.0 and weight * weight >= cost * variances[place]
            if pays or term in must or len(found.weights) == 1:
                weights[term] = weight
            else:
                saved += cost
        kept.append(replace(found, weights=weights or dict(found.weights)))
    return kept, float(saved)
