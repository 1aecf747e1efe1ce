"""Hidden states that no sum uses are none, and need not be paid for."""

from __future__ import annotations

from dataclasses import replace

from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import partners
from twinloop.law.expressions import Node


def without_unused(hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis without hidden states that no sum uses before one that some does; those after it are not seen.

    Args:
        hypothesis: with sums.
    """
    hidden, pool = hypothesis.actuation.hidden, hypothesis.pool
    if len(hidden) < 2:
        return hypothesis
    seen = {number for found in hypothesis.sums for term in found.weights for number in pool.hidden_in(term)}
    beside = partners(hidden)
    used = sorted(seen | {beside[number] for number in seen})
    if used == list(range(len(used))):
        return hypothesis
    candidates = hypothesis.candidates.growing()
    places = {candidates.pool.hidden(old): candidates.pool.hidden(new) for new, old in enumerate(used)}
    made = dict(places)
    sums = tuple(
        replace(
            found,
            weights={_moved(candidates.pool, term, made): weight for term, weight in found.weights.items()},
            others=[],
        )
        for found in hypothesis.sums
    )
    terms = [term for found in sums for term in found.weights]
    # A choice of a hidden state is a term of the first rung, as it was.
    candidates = candidates.with_terms(term for term in terms if candidates.pool.is_hidden(term))
    actuation = replace(hypothesis.actuation, hidden=tuple(hidden[number] for number in used))
    return replace(hypothesis, actuation=actuation, candidates=candidates, sums=sums)


def _moved(pool: Pool, node: int, made: dict[int, int]) -> int:
    """The node of the same expression of other hidden states; nodes that were made of others stand in `made`."""
    if node not in made:
        operation, operands, value = pool[node]
        moved = tuple(_moved(pool, operand, made) for operand in operands)
        made[node] = node if moved == operands else pool.enter(Node(operation, moved, value))
    return made[node]
