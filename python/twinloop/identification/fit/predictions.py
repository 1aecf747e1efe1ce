"""Predictions of a fitted model: its observer's errors name outliers, its states are smoother than readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.identification.context import Context
from twinloop.identification.hypothesis import Hypothesis

OUTLIER = 6.0
"""Whitened prediction errors beyond this many standard deviations are no noise."""
FEW = 0.02
"""Share of readings up to which they are outliers; where more are wrong, the model is."""


def predictions(context: Context, hypothesis: Hypothesis) -> Sequence[tuple[Floats, Floats, Floats]] | None:
    """What a fitted hypothesis' observer makes of each run: whitened errors, states and gusts; None: it diverges."""
    fit = hypothesis.fit
    if fit is None:
        return None
    return _core.predictions(
        fit.model,
        context.limits.engine,
        [chain.engine for chain in fit.observer],
        [run.engine for run in hypothesis.runs],
        workers=context.workers,
    )


def without_outliers(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with single readings ignored that no noise explains; itself where there are none.

    A model that is wrong everywhere explains none.
    """
    errors = predictions(context, hypothesis)
    if errors is None:
        return hypothesis
    wrong = [np.abs(whitened) > OUTLIER for whitened, _, _ in errors]
    share = float(np.mean(np.concatenate([w.any(axis=1) for w in wrong])))
    if share == 0.0 or share > FEW:
        return hypothesis
    runs = (
        replace(run, weights=np.where(w, 0.0, run.weights))
        for run, w in zip(hypothesis.runs, wrong, strict=True)
    )
    return replace(hypothesis, runs=tuple(runs), fit=None)


def smoothed(context: Context, hypothesis: Hypothesis) -> Hypothesis | None:
    """The hypothesis, not fitted, with features of the states that its observer believes; None where it diverges."""
    errors = predictions(context, hypothesis)
    if errors is None:
        return None
    runs = (
        replace(run, smooth=np.where(np.isfinite(states), states, run.states))
        for run, (_, states, _) in zip(hypothesis.runs, errors, strict=True)
    )
    return replace(hypothesis, runs=tuple(runs), smoothed=True, fit=None)
