"""Delays: once a law is known, periods of a delay take the place of a part of a lag, and the other way about.

Lags and delays are searched behind the first, simple terms, and what these lack another lag stands in for. Behind the
terms that are found then, tuning moves a lag, but never a delay, for that is a number of whole periods. What the last
terms lack a lag stands in for, too, so a delay has to be clearly better.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.proposals.lags import CLEARLY
from twinloop.identification.proposals.second_look import looked_again


def delays(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with other delays of commands that lag or are delayed, where that pays; then with new terms."""
    fit, options = hypothesis.fit, context.options
    if fit is None or not fit.stable or not (context.may_lag and options.delays and options.tuning):
        return
    context.watch("actuators")
    best = hypothesis
    for group in hypothesis.alike:
        for moved in [_moved(context, best, group, by) for by in (1, -1)]:
            if moved is not None and moved.evidence.less(CLEARLY) > best.evidence:
                best = moved
    if best is not hypothesis:
        yield best
        # What was chosen behind the wrong delay is chosen again.
        again = looked_again(context, best)
        if again is not None:
            yield again


def _moved(context: Context, best: Hypothesis, group: Sequence[int], by: int) -> Hypothesis | None:
    """The same with more, or less, of a delay, as long as each period describes the runs better; None if none does."""
    found = None
    while (other := _exchanged(context, found or best, group, by)) is not None:
        if not other.evidence > (found or best).evidence:
            break
        found = other
    return found


def _exchanged(context: Context, best: Hypothesis, group: Sequence[int], by: int) -> Hypothesis | None:
    """The same, fitted, with one period of delay more or less, and a lag that is shorter or longer by as much."""
    now, actuators = best.actuation.actuators[group[0]], list(best.actuation.actuators)
    if now.direct or now.delay + by < 0:
        return None
    for i in group:
        lag = max(0.0, actuators[i].lag - by * context.signals.dt)
        actuators[i] = actuators[i]._replace(lag=lag, delay=now.delay + by)
    actuation = replace(best.actuation, actuators=tuple(actuators))
    return fitted(context, replace(best, actuation=actuation, fit=None))
