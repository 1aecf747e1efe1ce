"""Tame laws: believed where the one that describes the flights most briefly is wilder and follows them hardly better.

What no law of the library explains may be described by many terms, each of which pays, that together are wrong wherever
no flight was; and there the next gains are looked for. The law known before has fewer: tuned on all flights it may
follow them nearly as well, and last where the other one does not.
"""

from __future__ import annotations

from typing import NamedTuple

from twinloop.campaign.identify_and_plan.answer import Answer
from twinloop.campaign.identify_and_plan.elsewhere import DRAWN
from twinloop.identification.identified import Identified
from twinloop.remarks import note

NEARLY = 2.0
"""Mean squared error in free run over that of a wilder law up to which a tame one follows nearly as well."""
TAME = note(
    "tame",
    "The law that describes all flights most briefly diverges under more of the controllers that could be flown than"
    " the one known before the last flight. With its constants tuned on all flights that one follows them nearly as"
    " well, or explains them, so it is kept.",
)
"""What is said of a law that was known before, where the one found anew is wilder."""


class Lasting(NamedTuple):
    """Under how many of the drawn controllers two laws last.

    Args:
        law: that was found anew.
        known: known before the last flight.
    """

    law: int
    known: int

    @property
    def wild(self) -> bool:
        """Whether the known law lasts under most controllers, and the new one under less than half as many."""
        return 2 * self.known > DRAWN and 2 * self.law < self.known


def is_wilder(law: Identified, known: Identified, lasting: Lasting, invalid: bool) -> bool:
    """Whether the known law may be the better one: where the new one is wild, or has more terms and lasts less often.

    Args:
        law: the new one.
        known: the law known before.
        lasting: of both.
        invalid: whether the new one is compared with a linear one anyway, unless it is wild.
    """
    grown = not invalid and law.terms > known.terms
    return lasting.wild or (grown and lasting.law < lasting.known)


def follows_nearly(tame: Answer, wilder: Answer, lasting: Lasting) -> bool:
    """Whether a tame law follows the flights, lasts on each, and has at most twice the squared error of a wilder one.

    Beside a law that is wild it may have more, as long as noise and disturbances explain it.

    Args:
        tame: law, held against all flights.
        wilder: law, likewise.
        lasting: of both, the tame one as the known one.
    """
    explained = lasting.wild and tame.explained
    return tame.believable and (explained or tame.worst <= NEARLY * wilder.worst)
