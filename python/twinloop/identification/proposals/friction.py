"""Dry friction, where terms leave more than noise.

A rate that is read at rest is all noise, and a term as steep as friction makes forces of it. No regression on readings
finds such a term: it is added to what is known, tuned on predictions, and judged by innovations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.description import shorter, shortest
from twinloop.identification.evidence import by_evidence
from twinloop.identification.fit.alternation import by_innovations
from twinloop.identification.fit.fitting import fitted, with_fit
from twinloop.identification.fit.models import model_of
from twinloop.identification.fit.predictions import smoothed
from twinloop.identification.fit.promises import promises
from twinloop.identification.fit.tuning import tune
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.proposals.second_look import looked_again
from twinloop.identification.search.noise import calm, still
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import RUNG, Sum, priced, prices, weighed
from twinloop.identification.terms.friction import entered, frictions, frictions_in

WORTH = RUNG
"""What friction must gain, in units of χ², beside its price."""
ROUNDS = 4
"""Times that each equation may get one more term."""
FINALISTS = 3
"""Terms of each equation, those that promise most, that are tuned."""
PROMISE = 0.5
"""Share of its price that a term has to promise: small weights of what is steep tell less than large ones."""


def friction(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with dry friction among its terms; none where its terms leave nothing but noise."""
    options, fit = context.options, hypothesis.fit
    if not (options.friction and options.libraries) or fit is None or not fit.stable:
        return
    problem = Problem(context, hypothesis)
    # Friction would evade the bounds of the speed that it is made of.
    if problem.priors.bounds or hypothesis.form == "absolute":
        return
    bases = [] if still(problem, (found.chain for found in hypothesis.sums)) else [hypothesis]
    # Terms of higher rungs and evolved ones may stand in for friction: it is looked for beside few terms, too.
    if not bases and not hypothesis.beside_few:
        return
    context.watch("terms")
    if hypothesis.beside_few:
        few = fitted(context, replace(hypothesis, sums=hypothesis.from_above, fit=None))
        bases += [few] if few.evidence.stable else []
    found = [other for other in (_with_friction(context, base) for base in bases) if _rubs(other)]
    if not found:
        return
    best = max(found, key=by_evidence)
    if not _rubs(hypothesis):
        given = by_innovations(context, hypothesis)
        if not shorter(best.evidence.length + WORTH, given.evidence.length):
            return
    if (again := smoothed(context, best)) is not None:
        yield replace(again, fit=best.fit)


def _with_friction(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with terms of friction that pay by its innovations; as it was where none does."""
    best = by_innovations(context, hypothesis) if _rubs(hypothesis) else hypothesis
    for _ in range(ROUNDS):
        more = _with_one_more(context, best)
        if more is best:
            break
        more = by_innovations(context, more)
        judged = best if _rubs(best) else by_innovations(context, best)
        if not shorter(more.evidence.length + WORTH, judged.evidence.length):
            break
        best = _reselected(context, more)
    return best


def _rubs(hypothesis: Hypothesis) -> bool:
    """Whether there is friction among its terms, or inside one of them, as where joints share their masses."""
    return any(frictions_in(hypothesis.pool, found.weights) for found in hypothesis.sums)


def _reselected(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with its terms selected again on states that it has smoothed, if innovations say so."""
    other = looked_again(context, hypothesis)
    if other is None or not other.evidence.stable:
        return hypothesis
    other = by_innovations(context, other)
    return other if shorter(other.evidence.length, hypothesis.evidence.length) else hypothesis


def _with_one_more(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with one more term in each sum that is disturbed, where one pays; itself where none does."""
    best = hypothesis
    for i, known in enumerate(hypothesis.sums):
        grown = replace(best, candidates=best.candidates.growing())
        problem = Problem(context, grown)
        if calm(problem, known.chain) is not known.chain:
            nodes = _promising(context, grown, i, _offered(context, problem, known))
            tuned = [_tuned(context, problem, grown, i, node) for node in nodes]
            best = shortest([best, *tuned], _described)
    return best


def _promising(context: Context, hypothesis: Hypothesis, i: int, nodes: Sequence[int]) -> list[int]:
    """Those of some terms that promise most for a sum, the best first."""
    assert hypothesis.fit is not None
    lacking = PROMISE * prices(hypothesis.pool, nodes, hypothesis.fit.readings, len(hypothesis.runs))
    lacking -= promises(context, hypothesis, i, nodes)
    order = sorted(range(len(nodes)), key=lambda place: (lacking[place], place))
    return [nodes[place] for place in order[:FINALISTS] if lacking[place] < 0.0]


def _offered(context: Context, problem: Problem, known: Sum) -> list[int]:
    """Friction of all speeds, entered in the pool; beside friction also what is viscous, for it may have stood in."""
    every = list(frictions(context.signals, problem.stages.start))
    readings = problem.readings(known.chain)
    nodes = [entered(problem.pool, each, len(every), readings) for each in every]
    if frictions_in(problem.pool, known.weights):
        nodes += sorted({place for each in every for place in each.inputs})
    return problem.usable([node for node in dict.fromkeys(nodes) if node not in known.weights])


def _described(hypothesis: Hypothesis) -> float:
    """Description length of a fit under a noise that stays as it was, up to what is the same for all."""
    assert hypothesis.fit is not None
    runs, misfit = hypothesis.runs, hypothesis.fit.chi_squared
    return misfit + sum(
        priced(hypothesis.pool, list(found.weights), hypothesis.fit.readings, len(runs))
        for found in hypothesis.sums
    )


def _tuned(context: Context, problem: Problem, hypothesis: Hypothesis, i: int, node: int) -> Hypothesis:
    """The hypothesis with one more term in a sum, tuned with the noise that it had; itself where that is singular."""
    assert hypothesis.fit is not None
    known, sums = hypothesis.sums[i], list(hypothesis.sums)
    terms = problem.usable([*known.weights, node])
    weights = weighed(problem, known.chain, terms)
    if weights is None:
        return hypothesis
    sums[i] = replace(known, weights=weights, others=[])
    candidates = hypothesis.candidates.with_terms([node])
    more = replace(hypothesis, candidates=candidates, sums=tuple(sums), fit=None)
    fit, _ = tune(
        context, more, model_of(context, more), hypothesis.fit.observer, context.options.tuning_steps
    )
    return with_fit(more, fit)
