"""Contacts: what begins at a place, as the force of a stop does, where terms leave more than noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.selection import from_both_sides, posed
from twinloop.identification.search.structure import search
from twinloop.identification.sensors.noise import calm, first_noise
from twinloop.identification.terms.hinges import hinges
from twinloop.law.actuation import Actuation

NEAR = 10.0
"""Units of χ² by which a subset may be worse than the best whose hinges are looked at more closely."""


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
    terms = set(hinges(grown.pool, context.signals, problem.stages.start[:, : grown.pool.inputs]))
    offered = replace(hypothesis, candidates=grown.with_terms(terms), fit=None)
    for tried in (offered, *_without_lags(context, offered)):
        screened = _screened(context, tried)
        seen = terms & _used(screened)
        if not seen:
            continue
        # Both sides are looked at among the few that a short search has come across.
        few = replace(screened, candidates=grown.with_terms(sorted(seen)))
        found = from_both_sides(context, few, few.sums)
        if not terms.isdisjoint(_used(found, others=False)):
            yield fitted(context, found)


def _screened(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """What a short search finds among all terms, with the noise that these leave if all are used."""
    options, problem = context.options, posed(context, hypothesis)
    terms = hypothesis.candidates.ladder[0]
    usable = problem.usable(terms)
    low = [first_noise(problem, found.chain, usable, options.gusts) for found in hypothesis.sums]
    return hypothesis.searched(
        search(
            problem, low, terms, hypothesis.sums,
            moves=options.moves // 4, starts=1, largest=options.largest, unit=hypothesis.next_unit(context.unit),
        )
    )  # fmt: skip


def _used(hypothesis: Hypothesis, others: bool = True) -> set[int]:
    """Terms of the sums, and of the subsets that are nearly as good."""
    used = {term for found in hypothesis.sums for term in found.weights}
    near = (subset for found in hypothesis.sums for subset, above in found.others if above < NEAR)
    return used.union(*near) if others else used


def _without_lags(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The same with commands that act at once, if any do not: a lag may have stood in for what a contact does."""
    actuation, at_once = hypothesis.actuation, Actuation.direct(context.signals)
    if context.may_lag and actuation.actuators != at_once.actuators:
        yield replace(hypothesis, actuation=replace(actuation, actuators=at_once.actuators))
