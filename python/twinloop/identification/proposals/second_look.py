"""A second look: terms are selected again on states that the model has smoothed."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from twinloop.identification.context import Context
from twinloop.identification.evidence import by_evidence
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.fit.predictions import smoothed
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.proposals.hidden import filled_by_commands
from twinloop.identification.search.selection import climbed


def second_look(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """What the hypothesis becomes on states that it has smoothed, look after look; with a hidden one twice as many.

    What is hidden shows when terms are nearly right, so a hidden state is looked for here again.
    """
    latest = hypothesis
    for look in itertools.count(1):
        if look >= context.options.passes * (2 if latest.actuation.hidden else 1):
            return
        again = smoothed(context, latest)
        if again is None:
            return
        context.watch("smoothed")
        again = climbed(context, again, brief=True)
        if look == 1 and context.may_hide and not again.actuation.stored:
            again = max([again, filled_by_commands(context, again, latest.sums)], key=by_evidence)
        latest = fitted(context, again)
        yield latest
        if not latest.evidence.stable:
            return


def looked_again(context: Context, hypothesis: Hypothesis) -> Hypothesis | None:
    """The hypothesis with its terms selected and fitted again on states that it has smoothed; None where it cannot.

    Args:
        context: of the identification.
        hypothesis: that was fitted.
    """
    again = smoothed(context, hypothesis)
    if again is None:
        return None
    context.watch("smoothed")
    return fitted(context, climbed(context, again, brief=True))
