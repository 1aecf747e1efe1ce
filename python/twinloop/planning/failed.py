"""Failed: which gains stand for a controller that failed on the system, or was cut."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.planning.gains import nearby
from twinloop.planning.judging import Judge

ALIKE = 1e-3
"""Share by which quality and usage of two flights differ at most that are the same but for a gain of no effect."""


def stand_for_failed(
    judge: Judge, members: Sequence[_core.Model], genes: Floats, failed: Sequence[Floats]
) -> NDArray[np.bool_]:
    """Which gains are close to some that failed, or fly the task as these do on every member.

    A gain that has no effect may be far from that of the failure: the controller is the same.

    Args:
        judge: of the campaign.
        members: of the committee.
        genes: of the candidates (K, size).
        failed: genes of tests that failed, each (size,); may be none.

    Returns:
        A flag each (K,).
    """
    same = nearby(judge.family, genes, failed)
    if not len(failed) or same.all():
        return same
    flights = judge.quiet(members, np.concatenate([genes, np.stack(failed)]))
    # Members on which the failure diverges tell nothing of it but that.
    every = np.stack([flights.qualities[:, 0], flights.usages[:, 0]])
    mine, theirs = every[:, :, : len(genes)], every[:, :, len(genes) :]
    for other in np.moveaxis(theirs, 2, 0)[..., np.newaxis]:
        lasts = np.isfinite(other)
        if lasts.any():
            near = np.abs(mine - np.where(lasts, other, 0.0)) <= ALIKE * np.where(lasts, other, 0.0)
            same |= np.where(lasts, near, np.isinf(mine)).all(axis=(0, 1))
    return same
