"""Undisturbed: terms as if nothing disturbed, where something is believed to.

Under a disturbance that explains all that is left no further term gains anything, and terms that would make it vanish
are never tried.
"""

from __future__ import annotations

from collections.abc import Iterator

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.selection import posed
from twinloop.identification.search.structure import search
from twinloop.identification.sensors.noise import calm

NEAR = 40.0
"""Units of χ² by which a sum may be longer than what it takes the place of: what a regression says of it is not all."""


def undisturbed(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with sums that were searched as if nothing disturbed, fitted: of its own terms, then of all."""
    options = context.options
    if hypothesis.fit is None or not options.undisturbed:
        return
    context.watch("terms")
    own = list(dict.fromkeys(node for found in hypothesis.sums for node in found.weights))
    latest = hypothesis
    for terms, moves in ((own, options.moves // 10), (hypothesis.candidates.ladder[-1], options.moves // 2)):
        problem = posed(context, latest)
        quiet = [calm(problem, found.chain) for found in latest.sums]
        if all(chain is found.chain for chain, found in zip(quiet, latest.sums, strict=True)):
            return
        walks = context.walks(latest.next_unit(context.unit), moves)
        sums = search(problem, quiet, terms, latest.sums, walks)
        latest = latest.searched(
            [
                new if new.description_length < old.description_length + NEAR else old
                for old, new in zip(latest.sums, sums, strict=True)
            ]
        )
        yield fitted(context, latest)
