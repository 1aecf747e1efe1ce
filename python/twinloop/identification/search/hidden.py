"""Terms of hidden states: entered among the candidates, and taken out of sums."""

from __future__ import annotations

from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.search.structure import Sum
from twinloop.identification.terms.candidates import Candidates
from twinloop.identification.terms.pool import Pool


def with_hidden(context: Context, candidates: Candidates, count: int = 1) -> Candidates:
    """The candidates with terms of so many hidden states on the first rung, and with those that were known of them."""
    grown = candidates.growing()
    known = [node for node in context.known_terms if grown.pool.is_hidden(node)]
    return grown.with_terms([*filled(grown.pool, count), *known])


def filled(pool: Pool, count: int = 1) -> list[int]:
    """Terms of hidden states, on the first rung: each alone, times every input, and what moves an output together."""
    states = [pool.hidden(number) for number in range(count)]
    found = [node for node in pool.found if pool.is_hidden(node)]
    terms = [
        term for state in states for term in (state, *(pool.product(i, state) for i in range(pool.inputs)))
    ]
    terms += found
    pool.rungs.update(dict.fromkeys(terms, 0))
    return terms


def without_hidden(found: Sum, pool: Pool) -> Sum:
    """A sum without terms of hidden states.

    Args:
        found: the sum.
        pool: of its terms.
    """
    weights = {term: weight for term, weight in found.weights.items() if not pool.is_hidden(term)}
    return replace(found, weights=weights, others=[])
