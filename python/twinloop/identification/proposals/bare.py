"""Bare: the law of what is logged alone, where a hidden state is believed.

A hidden state is accepted early, while there are few terms. Terms that are found later may describe its effect without
it, but no other proposal drops it again. So in the end the law is searched once more without hidden states.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.proposals.second_look import looked_again
from twinloop.identification.search.hidden import without_hidden
from twinloop.identification.search.selection import climbed

FAR = 200.0
"""What a law without the hidden state may be longer by, before its terms are chosen on states that it has smoothed."""


def bare(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis without its hidden states, with terms that were searched anew; none where it has no such state."""
    if hypothesis.fit is None or not hypothesis.actuation.hidden:
        return
    context.watch("terms")
    plain = replace(hypothesis, actuation=hypothesis.actuation.bare(), fit=None)
    begun = replace(plain, sums=tuple(without_hidden(found, plain.pool) for found in plain.sums))
    found = fitted(context, climbed(context, begun))
    yield found
    if not found.evidence.stable or found.evidence.length > hypothesis.evidence.length + FAR:
        return
    if (again := looked_again(context, found)) is not None:
        yield again
