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
MOST_DELAY = 50
"""Periods beyond which no delay is tried."""


def lags(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with actuators of the shortest description, those that act at once among them."""
    if hypothesis.aligned:
        return
    context.watch("actuators")
    best = _behind(context, hypothesis, Actuation.direct(context.signals), hypothesis.searches)
    for group in groups(context.signals):
        for delay in range(context.options.longest_delay + 1):
            best = _best_lag(context, hypothesis, best, group, delay, LAGS)
        best = _longer(context, hypothesis, best, group)
    if best.actuation != hypothesis.actuation:
        # The noise was that of other actuators, and a disturbance may still stand in for terms.
        best = from_both_sides(context, best, best.sums)
    yield best


def _best_lag(
    context: Context,
    hypothesis: Hypothesis,
    best: Hypothesis,
    group: Sequence[int],
    delay: int,
    lags: Sequence[float],
) -> Hypothesis:
    """The best so far, or a better one with this delay; what it draws follows the searches of both."""
    searches, rising = best.searches, 0
    for lag in lags:
        if lag == 0.0 and delay == 0:
            continue
        tried = _at(context, hypothesis, replace(best, searches=searches), group, delay, lag)
        searches = tried.searches
        found = strongest([best, tried])
        best, rising = found, 0 if found is not best else rising + 1
        # Past the best lag the fit only gets worse.
        if rising >= 2:
            break
    return replace(best, searches=searches)


def _longer(context: Context, hypothesis: Hypothesis, best: Hypothesis, group: Sequence[int]) -> Hypothesis:
    """The same, or one with a longer delay, for as long as a period more is better with a lag that is no longer."""
    while not (now := best.actuation.actuators[group[0]]).direct and now.delay < MOST_DELAY:
        at_it: Hypothesis | None = None
        searches = best.searches
        for lag in (lag for lag in reversed(LAGS) if lag * context.signals.dt <= now.lag):
            tried = _at(context, hypothesis, replace(best, searches=searches), group, now.delay + 1, lag)
            searches = tried.searches
            if at_it is not None and strongest([at_it, tried]) is at_it:
                break
            at_it = tried
        assert at_it is not None  # a lag of 0 is always tried
        found = strongest([best, at_it])
        if found is best:
            return replace(best, searches=searches)
        best = replace(found, searches=searches)
    return best


def _at(
    context: Context, hypothesis: Hypothesis, best: Hypothesis, group: Sequence[int], delay: int, lag: float
) -> Hypothesis:
    """The hypothesis behind the best actuators so far, those of a group with this delay and lag: the better rest."""
    searches, tried = best.searches, []
    for rest in (None, *context.rests):
        actuation = _with(best.actuation, group, lag, delay, rest, context.signals)
        tried.append(_behind(context, hypothesis, actuation, searches))
        searches = tried[-1].searches
    return replace(strongest(tried), searches=searches)


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
