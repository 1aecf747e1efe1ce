"""At once: a lag or a limited rate that tuning has shown to be nothing is none, and need not be paid for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis

NOTHING = 0.05
"""Periods below which a lag is none: within them a command has arrived by 1 − e⁻²⁰."""


def at_once(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with groups of commands that act at once where they hardly lag, and without limits of rates."""
    wanted = context.options.lags and context.options.at_once
    if hypothesis.fit is None or not hypothesis.fit.stable or not wanted:
        return
    actuation = hypothesis.actuation
    for group in hypothesis.alike:
        lag, delay, _, ramp = actuation.actuators[group[0]]
        if 0.0 < lag < NOTHING * context.signals.dt and delay == 0 and ramp == 0.0:
            actuation = actuation.at_once(group)
    if actuation is not hypothesis.actuation:
        yield fitted(context, replace(hypothesis, actuation=actuation, fit=None))
    # Whether a rate is limited shows where it is met; a lag that was tuned since may have taken its place.
    for group in hypothesis.alike:
        if any(actuation.actuators[i].ramp > 0.0 for i in group):
            yield fitted(context, replace(hypothesis, actuation=actuation.unlimited(group), fit=None))
