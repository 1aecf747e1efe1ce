"""Screen: which of many hidden states explains most, by short searches among few terms."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twinloop._ground.side_by_side import side_by_side
from twinloop._ground.streams import Unit
from twinloop.identification.context import Context
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.records import Stages, stages
from twinloop.identification.search.hidden import filled, with_hidden, without_hidden
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import search, search_known, usable_among
from twinloop.law.actuation import HiddenState

AT_ONCE = 24
"""Hidden states of which inner products are computed at once."""
STORED, FURTHER = 50, 10_000
"""Number of the unit of work of a screen, and how far those of further screens are from it."""

Sources = tuple[HiddenState, ...]
"""Hidden states of one time, those that commands fill first."""


@dataclass(frozen=True, eq=False)
class Screen:
    """Tries hidden states by short searches among few terms: those that there are, and each hidden state alone.

    The noise stays what it is without them, so which one explains most of what is left is told by χ² alone.

    Args:
        context: of the identification.
        hypothesis: with the hidden states' nodes in its pool.
        terms: that were found without them.
        inputs: of the law without hidden states.
        problem: without hidden states.
        unit: of work.
        numbers: of the searches.
    """

    context: Context
    hypothesis: Hypothesis
    terms: Sequence[int]
    inputs: Stages
    problem: Problem
    unit: Unit
    numbers: Iterator[int]

    @staticmethod
    def of(context: Context, hypothesis: Hypothesis, number: int) -> Screen:
        """What begins with the sums of a hypothesis, without terms of a hidden state that commands fill.

        Args:
            context: of the identification.
            hypothesis: with these sums.
            number: of the screen, by which what it draws is told from what others of the same start draw.
        """
        candidates = hypothesis.candidates.growing()
        pool = candidates.pool
        filled(pool, 2)
        used = [term for found in (*hypothesis.sums, *hypothesis.from_above) for term in found.weights]
        linear = (pool.one, *range(pool.inputs))
        terms = [term for term in dict.fromkeys([*linear, *used]) if not pool.is_hidden(term)]
        bare = replace(
            hypothesis,
            candidates=candidates,
            actuation=hypothesis.actuation.bare(),
            sums=tuple(without_hidden(found, hypothesis.pool) for found in hypothesis.sums),
        )
        inputs = stages(bare.runs, context.signals, bare.actuation)
        problem = Problem(context, bare, inputs)
        usable = problem.usable(terms)
        for found in bare.sums:
            problem.feedthrough(found.chain, usable)
        unit = context.unit.part(hypothesis.start + STORED + FURTHER * number)
        return Screen(context, bare, terms, inputs, problem, unit, itertools.count(1))

    def beside(self, number: int = 0) -> Screen:
        """The same with a unit of work of its own, of a number that is 0 or above those of searches."""
        return replace(self, unit=self.unit.part(number), numbers=itertools.count(1))

    @cached_property
    def without(self) -> Hypothesis:
        """The hypothesis without hidden states, with the best sums of few terms."""
        (found,) = self([()])
        return found

    @cached_property
    def plain(self) -> Hypothesis:
        """The same with sums of all terms."""
        return self.with_all_terms(self.without)

    def __call__(self, several: Iterable[Sources]) -> list[Hypothesis]:
        """The hypothesis behind each of several hidden states, or pairs of them, with the best sums of few terms."""
        every = list(several)
        parts = (every[first:][:AT_ONCE] for first in range(0, len(every), AT_ONCE))
        return [found for part in parts for found in self._searched([self.behind(one) for one in part])]

    def behind(self, sources: Sources) -> tuple[Hypothesis, Problem]:
        """The hypothesis behind hidden states, and its problem."""
        bare = self.hypothesis
        tried = replace(bare, actuation=replace(bare.actuation, hidden=sources))
        integrated = all(source.integrated for source in sources)
        inputs = self.inputs.storing(sources, self.context.signals) if integrated else None
        return tried, Problem(self.context, tried, inputs, self.problem)

    def _searched(self, several: Sequence[tuple[Hypothesis, Problem]]) -> list[Hypothesis]:
        """Some of what is tried, with its sums.

        They differ in what is hidden alone, so the inner products of all are computed at once.
        """
        context, pool, sums = self.context, self.hypothesis.pool, self.hypothesis.sums
        base = usable_among(self.problem, self.terms, sums)
        behind = [
            problem.usable([pool.hidden(number) for number in range(len(one.actuation.hidden))])
            for one, problem in several
        ]
        columns = [self.problem.values(base)]
        columns += [problem.values(nodes) for (_, problem), nodes in zip(several, behind, strict=True)]
        every, driven = np.concatenate(columns, axis=2), [found.chain for found in sums]
        threads = context.workers.threads
        grams = side_by_side(lambda chain: self.problem.gram(chain, every), driven, threads)
        firsts = itertools.accumulate((len(nodes) for nodes in behind), initial=len(base))
        units = [self.unit.part(next(self.numbers)) for _ in several]

        def of(asked: tuple[tuple[Hypothesis, Problem], list[int], int, Unit]) -> Hypothesis:
            (one, problem), nodes, first, unit = asked
            own = [*range(len(base)), *range(first, first + len(nodes))]
            walks = context.walks(unit, context.options.moves // 25, purpose="hidden_subsets")
            chosen = search_known(
                problem, driven, [*base, *nodes], sums, walks, [gram.part(own) for gram in grams]
            )
            return replace(one, sums=tuple(chosen))

        return side_by_side(of, zip(several, behind, firsts, units, strict=False), threads)

    def with_all_terms(self, found: Hypothesis) -> Hypothesis:
        """A tried hypothesis with sums of all terms of the first rung, and of those of its hidden states."""
        context = self.context
        candidates = with_hidden(context, found.candidates, len(found.actuation.hidden))
        starts = max(1, context.options.starts // 2)
        unit = self.unit.part(next(self.numbers))
        walks = context.walks(unit, context.options.moves, starts, "hidden_subsets")
        grown = replace(found, candidates=candidates)
        driven = [one.chain for one in found.sums]
        sums = search(Problem(context, grown), driven, candidates.ladder[0], found.sums, walks)
        return replace(grown, sums=tuple(sums))
