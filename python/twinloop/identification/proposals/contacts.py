"""Contacts: what begins at a place, as the force of a stop does, where terms leave more than noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.selection import from_both_sides, posed
from twinloop.identification.sensors.noise import calm
from twinloop.identification.terms.hinges import hinges
from twinloop.law.actuation import Actuation


def contacts(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with hinges among its terms, fitted; none where its terms leave nothing but noise."""
    options = context.options
    if not (options.contacts and options.libraries) or hypothesis.fit is None:
        return
    problem = posed(context, hypothesis)
    still = all(calm(problem, found.chain) is found.chain for found in hypothesis.sums)
    if still and hypothesis.fit.stable:
        return
    context.watch("terms")
    grown = hypothesis.candidates.growing()
    terms = hinges(grown.pool, context.signals, problem.stages.start[:, : grown.pool.inputs])
    if not terms:
        return
    offered = replace(hypothesis, candidates=grown.with_terms(terms), fit=None)
    for tried in (offered, *_without_lags(context, offered)):
        found = from_both_sides(context, tried, tried.sums)
        used = {term for sum_ in found.sums for term in sum_.weights}
        if not used.isdisjoint(terms):
            # What was tried and not used is no term of the ladder from here on.
            kept = grown.with_terms(term for term in terms if term in used)
            yield fitted(context, replace(found, candidates=kept))


def _without_lags(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The same with commands that act at once, if any do not: a lag may have stood in for what a contact does."""
    actuation, at_once = hypothesis.actuation, Actuation.direct(context.signals)
    if context.may_lag and actuation.actuators != at_once.actuators:
        yield replace(hypothesis, actuation=replace(actuation, actuators=at_once.actuators))
