"""Starts: the gains from which tuning on a committee begins, and those that are known without it."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign import standing
from twinloop.campaign.identify_and_plan.choice import UNKNOWN
from twinloop.campaign.identify_and_plan.memory import Memory
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.setup import Setup
from twinloop.controllers import lqr_gains
from twinloop.controllers.state_feedback import FeedbackFamily
from twinloop.errors import InvalidInput, NotAvailable
from twinloop.planning.judging import Committee
from twinloop.test import Test


def starts_of(setup: Setup, book: Logbook, committee: Committee, tuned: Floats | None) -> list[Floats]:
    """Genes from which tuning begins, the best flown first.

    Args:
        setup: of the campaign.
        book: of the campaign.
        committee: on which gains are tuned.
        tuned: genes (size,) of the last tuning for a test; None: there was none.
    """
    best, first = standing.best_flown(book), first_genes(setup, book)
    starts = [first if best is None else best.genes]
    if tuned is not None:
        starts.append(tuned)
    if first.tobytes() != starts[0].tobytes():
        starts.append(first)
    return [*starts, *linear_gains(setup, committee)]


def first_genes(setup: Setup, book: Logbook) -> Floats:
    """Genes (size,) of the first test that was flown; the middle of the box where none was.

    Args:
        setup: of the campaign.
        book: of the campaign.
    """
    first = standing.first_flown(book)
    return setup.family.from_unit(np.full(setup.family.size, 0.5)) if first is None else first.genes


def linear_gains(setup: Setup, committee: Committee) -> list[Floats]:
    """Gains of a full state feedback by LQR on the linearised twin; none for other families, or where it fails.

    Args:
        setup: of the campaign.
        committee: whose first member is linearised.
    """
    family = setup.family
    if not isinstance(family, FeedbackFamily) or not committee.trusted:
        return []
    # An error of one scale that lasted the whole flight costs as much as one that is there: no second is special.
    duration = setup.steps * setup.signals.dt
    filled = {
        f"{state.name}.integral": state.scale * duration
        for state in setup.signals.states
        if state.name in family.integral
    }
    weights = {name: 1.0 / (size * size) for name, size in filled.items()}
    try:
        return [family.genes(lqr_gains(committee.members[0], family, setup.final_target, weights))]
    except (NotAvailable, InvalidInput):
        return []


def known_gains(memory: Memory, best: Test | None) -> tuple[Floats, str]:
    """Gains as they were tuned last, or the best flown where none were, and what to say of it; nothing is tuned.

    Args:
        memory: of the preset.
        best: the best test flown; None: none was.

    Raises:
        NotAvailable: there are neither.
    """
    if memory.gains is not None:
        return memory.gains[1], ""
    asked = memory.asked
    known = [] if asked is None or asked.gains is None else [asked.gains]
    known += [] if best is None else [best.genes]
    if not known:
        raise NotAvailable(
            f"{UNKNOWN}none has flown, and none was tuned yet. Fly the first test, then let it finish learning."
        )
    return known[0], " No gains were tuned on this twin yet."
