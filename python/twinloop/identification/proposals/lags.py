"""Lags, delays and rates of actuators: searched on grids, one group of commands after another, from none of them on.

A group that is searched early may stand in for one that is searched later, so in the end each is tried without. Then
limits of the rate are tried, those that the commands of the runs would have met.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.side_by_side import side_by_side
from twinloop._ground.streams import Unit
from twinloop.identification.context import Context
from twinloop.identification.evidence import by_evidence
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.noise import still
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.search.structure import search
from twinloop.law.actuation import Actuation, Actuator, one_by_one
from twinloop.signals import Signals

LAGS = (0.0, 0.35, 0.7, 1.4, 2.8, 5.6, 11.0)
"""Time constants that are tried, in periods."""
FINER = sqrt(2.0)
"""Ratio of the lags that are tried beside the best of them."""
FEW = 3
"""Commands that are alike up to which each is tried with a lag and a delay of its own."""
MOST_DELAY = 50
"""Periods beyond which no delay is tried."""
RAMPS = (1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0, 32.0, 45.0)
"""Periods in which an actuator crosses all commands that were sent: limits of its rate that are tried."""
CLEARLY, SURELY = 24.0, 72.0
"""Units of χ² by which each of two in turn, or a single one, must be worse than the best lag, or the best limit of the
rate, for no others to be tried."""
GRID, RATES = 0, 1000
"""Numbers of the units of work that try them; the searches that a hypothesis counts begin at 1, and are few."""
Group = Sequence[int]
"""Commands that share a lag and a delay, by place."""
Trial = Callable[[Hypothesis | None, Iterable[Actuation]], list[Hypothesis]]
"""The hypothesis behind each of several other actuators, with sums of the first rung that are no worse there than those
of one tried before, if any: what walks find by chance on a large machine outweighs a lag."""


def lags(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with actuators of the shortest description, those that act at once among them."""
    if hypothesis.fit is not None or not context.may_lag:
        return
    context.watch("actuators")
    number = itertools.count()
    trial = _trials(context, hypothesis, number)
    (best,) = trial(None, [Actuation.direct(context.signals)])
    for group in hypothesis.alike:
        best = _searched(context, trial, best, group)
    best = _without(trial, best)
    best = _each(context, best, number)
    best = _at_limited_rates(context, best)
    if best.actuation != hypothesis.actuation:
        # The noise was that of other actuators, and a disturbance may still stand in for terms.
        yield from_both_sides(context, best, best.sums)


def without_lags(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The same with commands that act at once, if any do not: a lag may have stood in for what another proposal finds.

    Args:
        context: of the identification.
        hypothesis: with commands that may lag.
    """
    actuation, direct = hypothesis.actuation, Actuation.direct(context.signals)
    if context.may_lag and actuation.actuators != direct.actuators:
        yield replace(hypothesis, actuation=replace(actuation, actuators=direct.actuators))


def _searched(context: Context, trial: Trial, best: Hypothesis, group: Group) -> Hypothesis:
    """The best so far, or a better one with another lag or delay of a group."""
    for delay in range(context.options.longest_delay + 1):
        best = _best_lag(context, trial, best, group, delay)
    return _rested(context, trial, _longer(context, trial, best, group), group)


def _each(context: Context, best: Hypothesis, number: Iterator[int]) -> Hypothesis:
    """The best so far, or a better one in which each of a few alike commands has a lag or a delay of its own.

    Two that differ, such as gates at either end of a canal, hide what they share: it suits neither.
    """
    for group in best.alike:
        several = context.options.apart and 1 < len(group) <= FEW
        if not several or still(Problem(context, best), (found.chain for found in best.sums)):
            continue
        split = replace(best, alike=one_by_one(best.alike, group))
        trial = _trials(context, split, number)
        (own,) = trial(best, [best.actuation])
        for i in group:
            own = own if _suits(context, trial, own, (i,)) else _searched(context, trial, own, (i,))
        best = max([best, own], key=by_evidence)
    return best


def _suits(context: Context, trial: Trial, best: Hypothesis, one: Group) -> bool:
    """Whether the lag and the delay that a command shares with others are clearly better for it than those beside."""
    now, rests = best.actuation.actuators[one[0]], _rests(context, best, one)
    lag = now.lag / context.signals.dt
    near = [0.5 * lag, 2.0 * lag] if lag > 0.0 else [LAGS[2]]
    beside = [(near, now.delay), *(([lag], now.delay + by) for by in (1, -1) if now.delay + by >= 0)]
    return all(
        _clearly_worse(other, best)
        for lags, delay in beside
        for other in _at(context, trial, best, one, delay, lags, rests)
    )


def _at_limited_rates(context: Context, best: Hypothesis) -> Hypothesis:
    """The best so far, or a better one in which groups of commands move at a limited rate, with their lag or none."""
    trial = _trials(context, best, itertools.count(), RATES)
    for group in best.alike if context.options.ramps else ():
        crossed = [np.concatenate([run.commands[:, i] for run in best.runs]) for i in group]
        span = max(float(np.ptp(sent)) for sent in crossed)
        steps = [np.abs(np.diff(run.commands[:, i])).max(initial=0.0) for run in best.runs for i in group]
        fastest, worse = max(map(float, steps)), 0
        # One that no command would have met is none that was seen.
        met = [periods for periods in RAMPS if fastest * periods > span > 0.0]
        found: float | None = None
        for periods in met:
            other = _ramped(context, trial, best, group, periods / span)
            if other.evidence > best.evidence:
                best, found = other, periods
            # Past the true rate the fit only gets worse, and without a limit from the first one on.
            worse = _worse(worse, other, best)
            if worse >= 2:
                break
        for periods in (found / FINER, found * FINER) if found is not None else ():
            best = max([best, _ramped(context, trial, best, group, periods / span)], key=by_evidence)
    return best


def _ramped(context: Context, trial: Trial, best: Hypothesis, group: Group, periods: float) -> Hypothesis:
    """The hypothesis behind actuators of a group that move by one unit of its command in so many periods at least."""
    several = []
    now = best.actuation.actuators[group[0]].lag
    # Where no limit was known, a lag has stood for it in part.
    for lag in dict.fromkeys((now, 0.5 * now, 0.0)):
        actuators = list(best.actuation.actuators)
        for i in group:
            ramp = periods * context.signals.dt * context.signals.commands[i].size
            actuators[i] = actuators[i]._replace(lag=lag, ramp=ramp)
        several.append(replace(best.actuation, actuators=tuple(actuators)))
    return max(trial(best, several), key=by_evidence)


def _trials(context: Context, hypothesis: Hypothesis, number: Iterator[int], of: int = GRID) -> Trial:
    """What tries actuators for a hypothesis; the searches of each trial are a part of one unit of work."""
    unit = context.unit.part(hypothesis.start, of)

    def behind_one(asked: tuple[Hypothesis | None, Actuation, Unit]) -> Hypothesis:
        before, actuation, own = asked
        behind = replace(hypothesis, actuation=actuation)
        driven = [found.chain for found in (before or hypothesis).sums]
        known = before.sums if before else [None] * len(driven)
        walks = context.walks(own, context.options.moves // 4)
        sums = search(Problem(context, behind), driven, behind.candidates.ladder[0], known, walks)
        return replace(behind, sums=tuple(sums))

    def trial(before: Hypothesis | None, several: Iterable[Actuation]) -> list[Hypothesis]:
        asked = [(before, actuation, unit.part(next(number))) for actuation in several]
        return side_by_side(behind_one, asked, context.workers.threads)

    return trial


def _best_lag(context: Context, trial: Trial, best: Hypothesis, group: Group, delay: int) -> Hypothesis:
    """The best so far, or a better one with this delay.

    From no lag on a short one may describe runs worse, and a longer one better, but not where it is clearly worse. A
    delay has to be better soon: behind one or two periods more even runs of a machine without any find some lag that
    suits their noise.
    """
    (found,) = [best] if delay else trial(best, [best.actuation.at_once(group)])
    lag, worse, rests = None if delay else 0.0, 0, _rests(context, best, group)
    for tried in LAGS if delay else LAGS[1:]:
        several = _at(context, trial, found, group, delay, [tried], rests)
        other = max(several, key=by_evidence)
        if other.evidence > found.evidence:
            found, lag, worse = other, tried, 0
            if all(one is other or _clearly_worse(one, other) for one in several):
                rests = _rests(context, found, group)
        elif lag == 0.0:
            worse = _worse(worse, other, found)
        elif lag is None:
            # Where commands act at once, a delay alone is clearly worse.
            worse += 2 if found.actuation.actuators[group[0]].direct and _clearly_worse(other, found) else 1
        else:
            # Past the best lag the fit only gets worse.
            worse = max(worse + 1, _worse(worse, other, found))
        if worse >= 2:
            break
    several = [best, found]
    if lag:
        # Of the steps of the grid one is larger than a period of delay, which would stand in for a lag between them.
        finer = [lag * by for by in (1.0 / FINER, FINER)]
        several += _at(context, trial, found, group, delay, finer, _rests(context, found, group))
    return max(several, key=by_evidence)


def _clearly_worse(other: Hypothesis, than: Hypothesis, by: float = CLEARLY) -> bool:
    """Whether by more than chance of the search gives or takes."""
    return than.evidence > other.evidence.less(-by)


def _worse(before: int, other: Hypothesis, than: Hypothesis) -> int:
    """How many in turn are clearly worse, once another is counted; one that is worse by far counts twice."""
    if _clearly_worse(other, than, SURELY):
        return before + 2
    return before + 1 if _clearly_worse(other, than) else 0


def _longer(context: Context, trial: Trial, best: Hypothesis, group: Group) -> Hypothesis:
    """The same, or one with a longer delay, for as long as a period more is better with a lag that is no longer."""
    while not (now := best.actuation.actuators[group[0]]).direct and now.delay < MOST_DELAY:
        at_it: Hypothesis | None = None
        for lag in (lag for lag in reversed(LAGS) if lag * context.signals.dt <= now.lag):
            several = _at(context, trial, best, group, now.delay + 1, [lag], _rests(context, best, group))
            tried = max(several, key=by_evidence)
            if at_it is not None and max([at_it, tried], key=by_evidence) is at_it:
                break
            at_it = tried
        assert at_it is not None  # a lag of 0 is always tried
        found = max([best, at_it], key=by_evidence)
        if found is best:
            return best
        best = found
    return best


def _without(trial: Trial, best: Hypothesis) -> Hypothesis:
    """The best so far, or a better one in which groups act at once that stood in for those searched after them.

    And for terms that were found behind their lags, and are as good without.
    """
    for group in best.alike:
        if best.actuation.actuators[group[0]].direct:
            continue
        best = max([best, *trial(best, [best.actuation.at_once(group)])], key=by_evidence)
    return best


def _rests(context: Context, best: Hypothesis, group: Group) -> list[Floats | None]:
    """Where actuators of a group may rest before a run: where they do in the best so far, if they lag there."""
    now = best.actuation.actuators[group[0]]
    every = [None, *context.rests]
    known = [rest for rest in every if now.rest == (None if rest is None else rest[group[0]])]
    return every if now.direct else known


def _rested(context: Context, trial: Trial, best: Hypothesis, group: Group) -> Hypothesis:
    """The best so far, or a better one whose actuators rest elsewhere before a run."""
    now = best.actuation.actuators[group[0]]
    if now.direct:
        return best
    known = _rests(context, best, group)
    others = [rest for rest in (None, *context.rests) if not any(rest is one for one in known)]
    lag = now.lag / context.signals.dt
    return max([best, *_at(context, trial, best, group, now.delay, [lag], others)], key=by_evidence)


def _at(
    context: Context,
    trial: Trial,
    best: Hypothesis,
    group: Group,
    delay: int,
    lags: Sequence[float],
    rests: Sequence[Floats | None],
) -> list[Hypothesis]:
    """The hypothesis behind the best actuators so far, those of a group with this delay, these lags and rests."""
    return trial(
        best,
        (_with(best.actuation, group, lag, delay, rest, context.signals) for lag in lags for rest in rests),
    )


def _with(
    base: Actuation, group: Group, lag: float, delay: int, rest: Floats | None, signals: Signals
) -> Actuation:
    """Actuators of which those of a group lag and delay."""
    actuators: list[Actuator] = list(base.actuators)
    for i in group:
        actuators[i] = Actuator(lag * signals.dt, delay, None if rest is None else float(rest[i]))
    return Actuation(tuple(actuators))
