"""Effect: whether gains make a difference on a twin at all, and which of them answer to some states."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.controllers import Family
from twinloop.planning.excitation import off_by
from twinloop.planning.judging import Judge

BESIDE = 0.625
"""Place in the box of all gains beside which each is moved: in the middle some are 0, and hide those they multiply."""
OFF = (2.0**-10, 2.0**-20, 2.0**-30)
"""Shares of half the envelope by which a state is off: by more than a little, large gains saturate their command."""
ROUNDING = 1e-12
"""Share of a command's scale below which a difference of commands is rounding."""


def gains_count(judge: Judge, members: Sequence[_core.Model], untunable: Sequence[int] = ()) -> bool:
    """Whether flights of the task differ, to the bit, between the middle of the gains' box and two of its corners.

    Where commands act on nothing that the quality counts, no flight on the twin tells one controller from another. A
    flight that diverges says that they act.

    Args:
        judge: of the campaign.
        members: of a committee.
        untunable: numbers of gains that are not asked, and stay in the middle.
    """
    family = judge.family
    corners = np.repeat([[0.0], [0.5], [1.0]], family.size, axis=1)
    corners[:, list(untunable)] = 0.5
    places = np.stack([family.from_unit(corner) for corner in corners])
    qualities = judge.judge(members, places, np.zeros(judge.signals.n_x), 1).qualities
    return bool((~np.isfinite(qualities) | (qualities != qualities[:, :, :1])).any())


def answering(family: Family, states: Sequence[int], target: Floats) -> tuple[int, ...]:
    """Numbers of the gains on which it depends how commands change as a state goes off its target.

    Args:
        family: of the controllers.
        states: that go off, one after another, for two periods: their rates and integrals are answered, too.
        target: from which they go off (n_x,).
    """
    if not states:
        return ()
    places = np.full((family.size + 1, family.size), BESIDE)
    places[np.arange(family.size), np.arange(family.size)] = 1.0
    controllers = [family.controller(genes) for genes in family.from_unit(places)]
    least = ROUNDING * np.array([command.size for command in family.signals.commands])
    targets = np.tile(target, (3, 1))
    # A gain may change what is sent at the target itself, and answer to no state.
    there = [controller.commands(targets, targets) for controller in controllers]
    answers = np.zeros(family.size, dtype=np.bool_)
    for state, share in itertools.product(states, OFF):
        readings = targets.copy()
        readings[1:] = off_by(family.signals, state, target, share)
        *moved, beside = (
            controller.commands(readings, targets) - sent
            for controller, sent in zip(controllers, there, strict=True)
        )
        answers |= [(np.abs(sent - beside) > least).any() for sent in moved]
    return tuple(np.flatnonzero(answers).tolist())
