"""Elsewhere: under how many of all the controllers that could fly what is learnt is still open.

Flights are made where gains are good, so laws that follow them equally well may part under other gains, and a law may
change there from flight to flight. Who takes the twin away, to tune for another task for example, should know of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.campaign.setup import Setup
from twinloop.law.accuracy import squares

DRAWN = 32
"""Controllers that are drawn uniformly from the box of gains."""
APART = 0.04
"""Mean square of what two laws differ by, over that of the motion, from which they part: a fifth of the motion."""


class Elsewhere(NamedTuple):
    """How far laws agree under controllers that were drawn from the box of gains.

    Two laws part under a controller where they differ by more than a fifth of the motion, or only one of them diverges.

    Args:
        drawn: controllers under which not all diverge, of the committee and the law known before.
        apart: of these, those under which the middle one of the other members parts from the first.
        changed: of these, those under which the law known before the last flight parts from the first.
        lost: other controllers that were drawn, under which all of these laws diverge.
    """

    drawn: int = 0
    apart: int = 0
    changed: int = 0
    lost: int = 0

    @property
    def all_drawn(self) -> int:
        """How many controllers were drawn; 0 where nothing was compared."""
        return self.drawn + self.lost


NOWHERE = Elsewhere()
"""Where nothing was compared."""


def elsewhere(
    members: Sequence[_core.Model],
    before: _core.Model | None,
    setup: Setup,
    unit: Unit,
    workers: _core.Workers,
) -> Elsewhere:
    """Flies all members, and the law known before, without noise under drawn controllers.

    Args:
        members: of the committee, the best first.
        before: the law known before the last flight; None: none was.
        setup: of the campaign.
        unit: of work, from which the controllers are drawn.
        workers: how the work is carried out.
    """
    known = [] if before is None else [before]
    runs = _flown([*members, *known], setup, drawn_controllers(setup, unit), workers)
    first, *others = runs[: len(members)]
    lasts = np.any([run.lasted == setup.steps for run in runs], axis=0)
    parted = np.array([_part(first, other, setup) for other in others]).reshape(-1, DRAWN)
    # The middle one; a law of which there is no other parts from none.
    apart = 2 * parted.sum(axis=0) > len(parted)
    changed = _part(first, runs[-1], setup) if known else np.zeros(DRAWN, dtype=bool)
    return Elsewhere(*(int(under.sum()) for under in (lasts, lasts & apart, lasts & changed, ~lasts)))


def drawn_controllers(setup: Setup, unit: Unit) -> Floats:
    """Genes of controllers that are drawn uniformly from the box of gains (DRAWN, size).

    Args:
        setup: of the campaign.
        unit: of work, from which they are drawn.
    """
    family = setup.family
    return family.from_unit(unit.stream("candidates").uniforms(DRAWN, family.size))


def lasting_under(
    models: Sequence[_core.Model], setup: Setup, genes: Floats, workers: _core.Workers
) -> list[int]:
    """Under how many controllers each model does not diverge.

    Args:
        models: to be compared.
        setup: of the campaign.
        genes: of the controllers (K, size).
        workers: how the work is carried out.
    """
    return [int((run.lasted == setup.steps).sum()) for run in _flown(models, setup, genes, workers)]


def _flown(
    models: Sequence[_core.Model], setup: Setup, genes: Floats, workers: _core.Workers
) -> list[_core.Runs]:
    """Runs of each model under controllers (K, size), without noise."""
    return [_core.rollout(model, setup.setting, genes, setup.task, workers=workers) for model in models]


def _part(first: _core.Runs, other: _core.Runs, setup: Setup) -> NDArray[np.bool_]:
    """Under which controllers two laws part (m,)."""
    off = squares(first.states, other.states, setup.signals).mean(axis=(1, 2))
    moved = squares(first.states, first.states[:, :1], setup.signals).mean(axis=(1, 2))
    lasts = [run.lasted == setup.steps for run in (first, other)]
    return np.asarray(np.where(lasts[0] & lasts[1], off > APART * moved, lasts[0] != lasts[1]))
