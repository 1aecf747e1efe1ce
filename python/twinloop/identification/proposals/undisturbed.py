"""Undisturbed: terms as if nothing disturbed, where something is believed to.

Under a disturbance that explains all that is left no further term gains anything, and terms that would make it vanish
are never tried.
"""

from __future__ import annotations

from collections.abc import Iterator

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search import selection

LEAST = -40.0
"""What a sum must gain, in units of χ²: it may be longer by this, for what a regression says of it is not all."""


def undisturbed(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with sums that were searched as if nothing disturbed, fitted: of its own terms, then of all."""
    if hypothesis.fit is None or not context.options.undisturbed:
        return
    context.watch("terms")
    for found in selection.undisturbed(context, hypothesis, LEAST):
        yield fitted(context, found)
