"""Settling: terms whose constants were tuned on predictions become terms with those constants.

A place or a width that is known to a grid alone leaves model error, which the noise that is estimated behind it takes
for a disturbance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.terms.friction import upright
from twinloop.identification.terms.pool import Pool
from twinloop.law.expressions import BINARY, COMMUTING, Node


def settled(hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with the tuned constants inside its terms, which cost what they did.

    Args:
        hypothesis: with a fit; what was tuned in its model shows in no term yet.
    """
    assert hypothesis.fit is not None
    candidates, fixed = hypothesis.candidates.growing(), hypothesis.candidates.priors.fixed
    pool, used = candidates.pool, [term for found in hypothesis.sums for term in found.weights]
    known = [node for nodes in fixed.values() for node in nodes]
    held = pool.held([term for term in (*used, *known) if term != pool.one])
    values = dict(zip(held, hypothesis.fit.model.constants.tolist(), strict=False))
    new = {term: upright(pool, _with_constants(pool, term, values)) for term in used}
    for term, (other, _) in new.items():
        if other != term:
            pool.found.setdefault(other, pool.length(term))
            pool.rungs.setdefault(other, pool.rung([term]))
    ladder = tuple(
        tuple(dict.fromkeys(new.get(term, (term, 1))[0] for term in rung)) for rung in candidates.ladder
    )
    sums = tuple(
        replace(
            found,
            weights={new[term][0]: new[term][1] * weight for term, weight in found.weights.items()},
            others=[],
        )
        for found in hypothesis.sums
    )
    return replace(hypothesis, candidates=replace(candidates, ladder=ladder), sums=sums)


def _with_constants(pool: Pool, number: int, values: Mapping[int, float]) -> int:
    """The node of an expression with other constants, each by the node in whose instruction it stands."""
    operation, operands, value = pool[number]
    if not operands:
        return pool.constant(values[number]) if number in values else number
    parts = [_with_constants(pool, operand, values) for operand in operands]
    if operation in BINARY and number in values:
        # An instruction holds a constant as its second operand, or as either where they commute.
        first_alone = operation in COMMUTING and pool.constant_value(operands[1]) is None
        parts[0 if first_alone else 1] = pool.constant(values[number])
    if operation in COMMUTING:
        return pool.add(operation, *parts)
    return pool.enter(Node(operation, tuple(parts), value))
