"""Exponentials, where they show beside few terms: what grows by a factor with a temperature, a voltage or a lift."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import from_both_sides, short_search
from twinloop.identification.starts import GROWTH
from twinloop.identification.terms.exponentials import FINER, Exponential, entered, finer
from twinloop.identification.terms.exponentials import exponentials as all_exponentials


def exponentials(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with exponentials among its terms, fitted; none where none shows beside terms of the first rung.

    They are looked for behind what explains the readings, too: over a short range evolved terms stand in for them.
    """
    options = context.options
    if not (options.exponentials and options.libraries) or hypothesis.fit is None:
        return
    problem = Problem(context, hypothesis)
    # An exponential would evade the bounds of what it is made of.
    if problem.priors.bounds:
        return
    every = all_exponentials(hypothesis.candidates.growing().pool, context.signals, problem.stages.start)
    if not every:
        return
    context.watch("terms")
    tried, searches = every, itertools.count()
    bare = replace(hypothesis, start=hypothesis.start + GROWTH, fit=None)
    # What lies between two rises that are tried would be taken for a sum of both.
    for shares in (*FINER, ()):
        showing = _showing(context, replace(bare, searches=next(searches)), tried)
        few = list(dict.fromkeys(itertools.chain.from_iterable(showing)))
        if not few:
            return
        tried = finer(few, every, shares)
    # What one substance loses by a reaction another one gains: they pay for it together, as many as use it in the end.
    uses = Counter(one.alone for of_chain in showing for one in of_chain)
    grown = bare.candidates.growing()
    terms = {entered(grown.pool, one, len(every), uses[one.alone]): one for one in few}
    found = replace(bare, candidates=grown.with_terms(terms), searches=next(searches))
    found = from_both_sides(context, found)
    used = [terms[term] for sum_ in found.sums for term in sum_.weights if term in terms]
    if used:
        uses = Counter(one.alone for one in used)
        for one in used:
            entered(found.pool, one, len(every), uses[one.alone])
        yield fitted(context, found)


def _showing(
    context: Context, hypothesis: Hypothesis, every: Sequence[Exponential]
) -> list[list[Exponential]]:
    """Those of some exponentials that are in the best sum of each chain that has any."""
    grown = hypothesis.candidates.growing()
    places = {entered(grown.pool, one, len(every)): one for one in every}
    tried = replace(hypothesis, candidates=grown.with_terms(places))
    sums = short_search(context, tried, tried.driven, [None] * len(tried.driven))
    showing = (
        next(filter(None, ([t for t in each.terms if t in places] for each in found.subsets)), [])
        for found in sums
    )
    return [[places[term] for term in own] for own in showing]
