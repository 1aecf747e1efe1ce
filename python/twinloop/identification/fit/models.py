"""Models of sums: which constants a model has, which of them may move, and within which bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from twinloop import _core
from twinloop.identification.context import Context
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.structure import Sum
from twinloop.identification.terms.bounds import Limits
from twinloop.identification.terms.exponentials import origins
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import partners
from twinloop.law.expressions import SHARE
from twinloop.signals import Bounds


def model_of(context: Context, hypothesis: Hypothesis) -> _core.Model:
    """The model whose outputs are a hypothesis' sums; without the last hidden states that no sum uses."""
    pool, actuation = hypothesis.pool, hypothesis.actuation
    used = (pool.reach(term) - pool.inputs for found in hypothesis.sums for term in found.weights)
    seen = max(used, default=0)
    # What turns does so with its partner, whether that is used or not.
    seen = max([seen, *(place + 1 for place in partners(actuation.hidden)[:seen])])
    actuation = replace(actuation, hidden=actuation.hidden[:seen])
    outputs = [dict.fromkeys(_fixed(hypothesis, found), 1.0) | found.weights for found in hypothesis.sums]
    if hypothesis.form == "absolute":
        for i, terms in enumerate(outputs):
            terms[i] = terms.get(i, 0.0) + 1.0
    program = pool.program_of_sums(outputs, len(actuation.hidden))
    return _core.Model(
        program, hypothesis.form, context.signals.engine, actuation.actuators, actuation.hidden
    )


def layout(hypothesis: Hypothesis) -> tuple[list[int], list[range]]:
    """Which of a model's constants may move, and which are the weights of each output.

    Constants inside nodes come first, then, output after output, a 1 for each known node and the weights.
    """
    absolute, weights = hypothesis.form == "absolute", []
    place, free = len(_held(hypothesis)), list(inner(hypothesis))
    for output, found in enumerate(hypothesis.sums):
        place += len(_fixed(hypothesis, found))
        weights.append(range(place, place + len(found.weights)))
        free += weights[-1]
        place += len(found.weights)
        # The state itself, where the output is the next one.
        place += absolute and output not in found.weights
    return free, weights


def inner(hypothesis: Hypothesis) -> dict[int, int]:
    """Places of those constants inside nodes that may move, each with its node."""
    pool = hypothesis.pool
    used = [term for found in hypothesis.sums for term in found.weights]
    kept = {pool.one, *pool.needed(_known(hypothesis)), *origins(pool, used)}
    # The scale of a share says what the same expression times a weight says: to tune both would be one too many.
    return {
        place: node
        for place, node in enumerate(_held(hypothesis))
        if node not in kept and pool[node].operation != SHARE and not _at_zero(pool, node)
    }


def _held(hypothesis: Hypothesis) -> list[int]:
    """For each constant inside nodes, the node in whose instruction it stands."""
    pool = hypothesis.pool
    used = [term for found in hypothesis.sums for term in found.weights if term != pool.one]
    return pool.held([*used, *_known(hypothesis)])


def _known(hypothesis: Hypothesis) -> list[int]:
    """Nodes that are known to drive something."""
    return [node for nodes in hypothesis.candidates.priors.fixed.values() for node in nodes]


def limits_of(hypothesis: Hypothesis) -> dict[int, Bounds]:
    """Bounds by place among a model's constants."""
    limits: dict[int, Bounds] = {}
    for found, places in zip(hypothesis.sums, layout(hypothesis)[1], strict=True):
        bounds = bounds_of(hypothesis, found)
        for place, term in zip(places, found.weights, strict=True):
            if term in bounds:
                itself = float(hypothesis.form == "absolute" and term == found.chain.states[0])
                low, high = bounds[term]
                limits[place] = (low + itself, high + itself)
    return limits


def bounds_of(hypothesis: Hypothesis, found: Sum) -> Limits:
    """Bounds of a sum's coefficients, by node."""
    return hypothesis.candidates.priors.bounds.get(found.chain.states[0], {})


def _at_zero(pool: Pool, node: int) -> bool:
    """Whether a node takes the larger or the smaller of something and 0: that 0 is no constant of a law."""
    operation, operands, _ = pool[node]
    return operation in ("min", "max") and any(pool.constant_value(operand) == 0.0 for operand in operands)


def _fixed(hypothesis: Hypothesis, found: Sum) -> Sequence[int]:
    """Nodes that are known to drive what a sum drives."""
    return hypothesis.candidates.priors.fixed.get(found.chain.states[0], ())
