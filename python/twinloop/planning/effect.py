"""Effect: whether gains make a difference on a twin at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop.planning.judging import Judge


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
