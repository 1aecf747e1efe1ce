"""Apart: commands that are alike share a lag until their readings say that each has one of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.evidence import by_evidence
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.selection import climbed, from_both_sides
from twinloop.law.actuation import one_by_one


def apart(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with a lag for each command of those that share one, where tuning alone shows that it pays.

    Terms were chosen behind the lag that is shared, so they are chosen again behind those that tuning has found.
    """
    fit = hypothesis.fit
    may_differ = context.may_lag and context.options.apart and context.options.tuning
    if fit is None or not fit.stable or not may_differ:
        return
    lagging = [
        group
        for group in hypothesis.alike
        if len(group) > 1 and hypothesis.actuation.actuators[group[0]].lag > 0.0
    ]
    for group in lagging:
        split = replace(hypothesis, alike=one_by_one(hypothesis.alike, group), fit=None)
        found = [fitted(context, each) for each in (split, *_undelayed(context, split, group))]
        own = max(found, key=by_evidence)
        if own.evidence > hypothesis.evidence:
            again = replace(own, fit=None)
            yield fitted(context, climbed(context, from_both_sides(context, again, again.sums)))


def _undelayed(context: Context, hypothesis: Hypothesis, group: Sequence[int]) -> Iterator[Hypothesis]:
    """The hypothesis with a longer lag in place of a delay, which may have stood in for the lag of some of a group."""
    actuators = list(hypothesis.actuation.actuators)
    lag, delay, _, _ = actuators[group[0]]
    if delay:
        for i in group:
            actuators[i] = actuators[i]._replace(lag=lag + delay * context.signals.dt, delay=0)
        yield replace(hypothesis, actuation=replace(hypothesis.actuation, actuators=tuple(actuators)))
