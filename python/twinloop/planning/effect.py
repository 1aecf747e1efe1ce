"""Effect: whether gains make a difference on a twin at all, and which of them answer to some states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.controllers import Family
from twinloop.planning.excitation import off_by
from twinloop.planning.judging import Judge

BESIDE = 0.625
"""Place in the box of all gains beside which each is moved: in the middle some are 0, and hide those they multiply."""


def gains_count(judge: Judge, members: Sequence[_core.Model]) -> bool:
    """Whether flights of the task differ, to the bit, between the middle of the gains' box and two of its corners.

    Where commands act on nothing that the quality counts, no flight on the twin tells one controller from another. A
    flight that diverges says that they act.

    Args:
        judge: of the campaign.
        members: of a committee.
    """
    family = judge.family
    places = np.stack([family.from_unit(np.full(family.size, place)) for place in (0.0, 0.5, 1.0)])
    qualities = judge.judge(members, places, np.zeros(judge.signals.n_x), 1).qualities
    return bool((~np.isfinite(qualities) | (qualities != qualities[:, :, :1])).any())


def answering(family: Family, states: Sequence[int], target: Floats) -> tuple[int, ...]:
    """Numbers of the gains that change what a controller sends while some states are off their target.

    Args:
        family: of the controllers.
        states: that are off, one after another, for two periods: their rates and integrals are answered, too.
        target: around which they are (n_x,).
    """
    if not states:
        return ()
    places = np.full((family.size + 1, family.size), BESIDE)
    places[np.arange(family.size), np.arange(family.size)] = 1.0
    controllers = [family.controller(genes) for genes in family.from_unit(places)]
    targets = np.tile(target, (3, 1))
    answers = np.zeros(family.size, dtype=np.bool_)
    for state in states:
        readings = targets.copy()
        readings[1:] = off_by(family.signals, state, target)
        *moved, beside = (controller.commands(readings, targets) for controller in controllers)
        answers |= [(sent != beside).any() for sent in moved]
    return tuple(np.flatnonzero(answers).tolist())
