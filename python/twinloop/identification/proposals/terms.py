"""Terms of all rungs and evolved ones, and the model that they make."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.selection import climbed


def terms(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with the best sums of all rungs, fitted; where its model diverges, also from above."""
    if hypothesis.fit is not None:
        return
    context.watch("terms")
    found = fitted(context, climbed(context, hypothesis))
    yield found
    if not found.evidence.stable:
        # A short description whose model diverges is worth nothing; the one from above has fewer terms.
        yield fitted(context, climbed(context, replace(hypothesis, sums=hypothesis.from_above)))
