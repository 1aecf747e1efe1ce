"""Contacts: what begins at a place, as the force of a stop does, where terms leave more than noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.fit.settling import settled
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.proposals.lags import without_lags
from twinloop.identification.search.drives import drive
from twinloop.identification.search.noise import still
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import from_both_sides, short_search
from twinloop.identification.search.structure import search
from twinloop.identification.starts import CONTACTS
from twinloop.identification.terms.hinges import Hinge, begun, damped, entered, hinges, limits
from twinloop.identification.terms.libraries import periodic

NEAR = 10.0
"""Units of χ² by which a subset may be worse than the best whose hinges are looked at more closely."""


def contacts(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with hinges among its terms, fitted; none where its terms leave nothing but noise."""
    options = context.options
    if not (options.contacts and options.libraries) or hypothesis.fit is None:
        return
    problem = Problem(context, hypothesis)
    # A hinge would evade the bounds of what it is made of.
    if problem.priors.bounds:
        return
    quiet = still(problem, (found.chain for found in hypothesis.sums))
    bases = [] if quiet and hypothesis.fit.stable else [hypothesis, *without_lags(context, hypothesis)]
    # Terms of higher rungs and evolved ones may stand in for what begins at a place: it is looked for beside few terms.
    rigid = context.signals.kinematics is not None
    if not bases and context.several and not rigid and hypothesis.beside_few:
        bases = [replace(hypothesis, sums=hypothesis.from_above)]
    if not bases:
        return
    context.watch("terms")
    every = hinges(context.signals, problem.stages.start)
    if context.several:
        # In one short run a bend of what drives a chain stands in for any contact.
        every += limits(_drives(context, hypothesis, problem), problem.stages.start)
    placed = settled(hypothesis)
    there = begun(placed.pool, [term for found in placed.sums for term in found.weights], context.signals)
    searches, start = 0, hypothesis.start + CONTACTS
    for variant in bases:
        tried = replace(variant, start=start, searches=searches)
        few, searches = _screened(context, tried, every), searches + 1
        # Both sides are looked at among the few that a short search has come across, bare and with their dampers.
        dampers = damped([*few, *there], context.signals)
        for bare, new in (([], few), (few, dampers)):
            if not new:
                continue
            grown = tried.candidates.growing()
            terms = [entered(grown.pool, hinge, len(every)) for hinge in (*bare, *new)]
            found = replace(tried, candidates=grown.with_terms(terms), fit=None, searches=searches)
            found = from_both_sides(context, found, found.sums)
            searches = found.searches
            if any(term in sum_.weights for sum_ in found.sums for term in terms[-len(new) :]):
                yield fitted(context, found)


def _drives(context: Context, hypothesis: Hypothesis, problem: Problem) -> Iterator[dict[int, float]]:
    """Coefficients of inputs that together drive a chain, for which the law leaves more than noise."""
    moving = periodic(context.signals)
    inputs = [i for i in range(context.signals.n_x + context.signals.n_u) if i not in moving]
    chains = [found.chain for found in hypothesis.sums if not still(problem, [found.chain])]
    walks = context.walks(hypothesis.next_unit(context.unit), context.options.moves // 25)
    nothing = [None] * len(chains)
    found = search(problem, chains, [problem.pool.one, *inputs], nothing, walks, fixed_noise=True)
    for chain, sum_ in zip(chains, found, strict=True):
        # Where it is limited most of the time, what it is held against hardly shows.
        driving = [i for i in inputs if i in sum_.weights or i in chain.states]
        if len(driving) > 1:
            yield drive(problem, chain, driving)


def _screened(context: Context, hypothesis: Hypothesis, every: Sequence[Hinge]) -> list[Hinge]:
    """Hinges that a short search finds among all terms, with the noise that these leave if all are used."""
    grown = hypothesis.candidates.growing()
    places = {entered(grown.pool, hinge, len(every)): hinge for hinge in every}
    tried = replace(hypothesis, candidates=grown.with_terms(places), fit=None)
    sums = short_search(context, tried, [found.chain for found in tried.sums], tried.sums)
    near = (subset for found in sums for subset, above in found.subsets if above < NEAR)
    return [
        places[term] for term in dict.fromkeys(term for subset in near for term in subset) if term in places
    ]
