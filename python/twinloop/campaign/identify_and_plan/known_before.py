"""The law known before the last flights: kept where it follows them, and what all flights teach does not.

More data may make a worse twin: a flight with a disturbance of its own, or beyond what a law of the library can say,
bends what others had shown. Flights that a law has not learnt are a free test of it, and the earlier law may pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.campaign.identify_and_plan.answer import Answer
from twinloop.campaign.identify_and_plan.tame import NEARLY, TAME
from twinloop.campaign.identify_and_plan.two_laws import LEAST
from twinloop.identification.identified import Identified
from twinloop.remarks import Remark, note

HALF = 0.5
"""Mean squared error over that of a new law, geometric mean over flights, up to which an earlier one is far better."""
BEFORE = note(
    "known-before",
    "The twin learnt from all flights misses some of them in free run by more than any disturbance explains; the"
    " twin of before the last flight does not. The earlier twin is kept.",
)
"""What is said of a twin that has not learnt all flights and follows them, where the one that has does not."""
AGAIN = note(
    "known-again",
    "The law that describes all flights most briefly does not follow them in free run. The one known before the last"
    " flight does, with its constants tuned on all, so it is kept.",
)
"""What is said of a law that was known before and explains all flights, where the one found anew does not."""
FORETOLD = note(
    "foretold-before",
    "The law learnt from all flights misses some of them. The one of before the last flight follows that one"
    " better, although it has not learnt it, and all flights with less than half the squared error. It is kept.",
)
"""What is said of a law that follows flights better which it has not learnt than one that has."""
LASTED = note(
    "lasted-before",
    "The linear law learnt from all flights diverges on one of them in free run, or does not follow them. The one of"
    " before the last flight lasts on all, and is kept.",
)
"""What is said of a linear law that has not learnt all flights and follows them, where the one that has does not."""
Answered = Callable[..., Answer]
"""Holds what was identified against all flights; `number` tells its draws from those of others."""


def or_known_before(answer: Answer, earlier: Identified, answered: Answered) -> Answer:
    """What was known before the last flights, where it explains all of them: it has not learnt the last.

    Args:
        answer: of what all flights teach, which does not.
        earlier: what was known before the last of them.
        answered: holds what was identified against all flights.
    """
    known = answered(as_known_before(earlier, BEFORE), number=1)
    return known if known.explained else answer


def or_known_again(answer: Answer, again: Answer) -> Answer:
    """The law known before with constants tuned on all flights, where it explains them, and follows nearly as well.

    Much explains a law that follows them far worse: whatever it misses is then taken for a disturbance.

    Args:
        answer: of what all flights teach, which does not.
        again: that law.
    """
    if not (again.explained and again.lasts and again.worst <= NEARLY * answer.worst):
        return answer
    return replace(again, identified=as_known_before(again.identified, AGAIN))


def or_foretold(answer: Answer, earlier: Identified, learnt: int, answered: Answered) -> Answer:
    """What was known before the last flights, where it follows them better, and all flights far better.

    Args:
        answer: of what all flights teach, which misses some of them.
        earlier: what was known before the last of them.
        learnt: number of flights that were known then.
        answered: holds what was identified against all flights.
    """
    known = answered(as_known_before(earlier, FORETOLD), number=6)
    # Over longer pieces of a log any law is further off.
    same = np.array_equal(known.followed.lengths, answer.followed.lengths)
    better = same and far_better(known.followed.ratios[0], answer.followed.ratios[0], learnt)
    return known if better and known.believable else answer


def far_better(known: Floats, law: Floats, learnt: int) -> bool:
    """Whether an earlier law follows flights better that it has not learnt, and all of them far better.

    Args:
        known: mean squares of the earlier law over those of the model that never moves (N,); infinite: it diverges.
        law: of one that has learnt all flights, likewise.
        learnt: number of flights that the earlier one has learnt, the first.
    """
    if not np.isfinite(known).all():
        return False
    if not np.isfinite(law).all():
        return True
    lead = log(np.maximum(law, LEAST)) - log(np.maximum(known, LEAST))
    return bool(lead[learnt:].sum() > 0.0 and lead.mean() >= -log(HALF))


def or_lasted_before(rough: Answer, earlier: Identified, answered: Answered) -> Answer:
    """The linear law of before the last flights, where it follows all and lasts on each, and the present one does not.

    Args:
        rough: linear law learnt from all flights.
        earlier: the one of before the last of them.
        answered: holds what was identified against all flights.
    """
    if rough.believable:
        return rough
    known = answered(as_known_before(earlier, LASTED), number=3)
    return known if known.believable else rough


def as_known_before(identified: Identified, said: Remark) -> Identified:
    """What was known before the last flights, which says so."""
    earlier = {BEFORE.code, AGAIN.code, FORETOLD.code, LASTED.code, TAME.code}
    others = [each for each in identified.remarks if each.code not in earlier]
    return with_remark(replace(identified, remarks=others), said)


def with_remark(identified: Identified, remark: Remark) -> Identified:
    """The same with a remark more."""
    return replace(identified, remarks=[*identified.remarks, remark])
