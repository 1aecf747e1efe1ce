"""Tame laws: believed where the one that describes the flights most briefly is wild.

What no law of the library explains may be described by many terms, each of which pays, that together are wrong wherever
no flight was; and there the next gains are looked for. The law known before has fewer: tuned on all flights it may
follow them nearly as well, and last where the other one does not.
"""

from __future__ import annotations

from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.identify_and_plan.answer import Answer
from twinloop.campaign.identify_and_plan.elsewhere import DRAWN, lasting_under
from twinloop.campaign.setup import Setup
from twinloop.remarks import note

NEARLY = 2.0
"""Mean squared error in free run over that of a wild law up to which a tame one follows nearly as well."""
TAME = note(
    "tame",
    "The law that describes all flights most briefly diverges under most controllers that could be flown. The one known"
    " before the last flight does not, and with its constants tuned on all flights it follows them nearly as well. It"
    " is kept.",
)
"""What is said of a law that was known before, where the one found anew is wild."""


def is_wild(law: _core.Model, known: _core.Model, setup: Setup, unit: Unit, workers: _core.Workers) -> bool:
    """Whether the law known before lasts under most drawn controllers, and a new one under less than half as many.

    Args:
        law: the new one.
        known: the one known before the last flight.
        setup: of the campaign.
        unit: of work, from which the controllers are drawn.
        workers: how the work is carried out.
    """
    lasting, before = lasting_under([law, known], setup, unit, workers)
    return 2 * before > DRAWN and 2 * lasting < before


def follows_nearly(tame: Answer, wild: Answer) -> bool:
    """Whether a tame law follows the flights, lasts on each, and has at most twice the squared error of a wild one.

    Args:
        tame: law, held against all flights.
        wild: law, likewise.
    """
    return tame.believable and tame.worst <= NEARLY * wild.worst
