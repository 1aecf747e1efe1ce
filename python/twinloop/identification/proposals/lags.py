"""Lags and delays of the actuators: searched on a grid, one group of commands after another, from none of them on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from twinloop.arrays import Floats
from twinloop.identification.context import Context
from twinloop.identification.evidence import strongest
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.inputs.actuation import groups
from twinloop.identification.search.selection import from_both_sides, posed, selected
from twinloop.law.actuation import Actuation, Actuator
from twinloop.signals import Signals

LAGS = (0.0, 0.35, 0.7, 1.4, 2.8, 5.6, 11.0)
"""Time constants that are tried, in periods."""
DELAYS = (0, 1, 2, 3)
"""Delays that are tried, in periods."""


def lags(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with actuators of the shortest description, those that act at once among them."""
    if hypothesis.aligned:
        return
    context.watch("actuators")
    best = _behind(context, hypothesis, Actuation.direct(context.signals), hypothesis.searches)
    searches = best.searches
    rests = (None, *context.rests)
    for group in groups(context.signals):
        for delay in (d for d in DELAYS if d <= context.options.longest_delay):
            rising = 0
            for lag in LAGS:
                if lag == 0.0 and delay == 0:
                    continue
                tried = []
                for rest in rests:
                    actuation = _with(best.actuation, group, lag, delay, rest, context.signals)
                    tried.append(_behind(context, hypothesis, actuation, searches))
                    searches = tried[-1].searches
                found = strongest([best, strongest(tried)])
                best, rising = found, 0 if found is not best else rising + 1
                # Past the best lag the fit only gets worse.
                if rising >= 2:
                    break
    best = replace(best, searches=searches)
    if best.actuation != hypothesis.actuation:
        # The noise was that of other actuators, and a disturbance may still stand in for terms.
        best = from_both_sides(context, best, best.sums)
    yield best


def _behind(context: Context, hypothesis: Hypothesis, actuation: Actuation, searches: int) -> Hypothesis:
    """The hypothesis behind other actuators, with sums of the first rung; what it draws follows so many searches."""
    behind = replace(hypothesis, actuation=actuation, aligned=True, searches=searches)
    driven = [found.chain for found in hypothesis.sums]
    return selected(
        context, behind, posed(context, behind), behind.candidates.ladder[0], [None] * len(driven), driven,
        moves=context.options.moves // 4, starts=1,
    )  # fmt: skip


def _with(
    base: Actuation, group: Sequence[int], lag: float, delay: int, rest: Floats | None, signals: Signals
) -> Actuation:
    """Actuators of which those of a group lag and delay."""
    actuators: list[Actuator] = list(base.actuators)
    for i in group:
        actuators[i] = Actuator(lag * signals.dt, delay, None if rest is None else float(rest[i]))
    return Actuation(tuple(actuators))
