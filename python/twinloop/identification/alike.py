"""Alike: of laws that the readings hardly tell apart, the one that lasts under most controllers.

A law of terms that describe the flights may diverge where no flight was. Few systems do so under a controller that may
be flown; so of two laws that are as likely, the one that lasts is the better guess.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from twinloop import _core
from twinloop.identification.context import Context
from twinloop.identification.fit.committee import as_read
from twinloop.identification.hypothesis import Hypothesis

HARDLY = 6.0
"""Difference of description lengths up to which evidence is no more than positive (Kass and Raftery 1995)."""
CountLasting = Callable[[Sequence[_core.Model]], Sequence[int]]
"""Under how many controllers each of several models lasts."""


def longer_lasting(
    context: Context,
    best: Hypothesis,
    rivals: Sequence[Hypothesis],
    owed: Callable[[Hypothesis], float],
    lasting: CountLasting,
) -> Hypothesis | None:
    """The rival of what is believed that is hardly less likely and lasts under more controllers; None if none does.

    Args:
        context: of the identification.
        best: what is believed.
        rivals: what else was proposed, in order.
        owed: what each has to be ahead of others by, in units of χ².
        lasting: of models, each as it is read.
    """

    def length(one: Hypothesis) -> float:
        return one.evidence.length + owed(one)

    alike = [one for one in rivals if one.evidence.stage == best.evidence.stage and not one.of_part]
    most = length(best) + HARDLY
    several = [best, *sorted((one for one in alike if length(one) < most), key=length)]
    models = [as_read(context, one, one.fit.model) for one in several if one.fit is not None]
    # Of one stage all have a model, or none.
    if len(models) < 2:
        return None
    counts = lasting(models)
    # The first of those that last longest is the likeliest.
    longest = several[counts.index(max(counts))]
    return None if longest is best else replace(longest, searches=best.searches)
