"""Neighbours: whether what disturbs is the same wherever flights do the same.

What a law is wrong about is a function of states and commands: where two flights pass near each other it is nearly the
same in both. What comes from outside is not. Where no flights pass near each other nobody can tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.identify_and_plan.likeness import Likeness, in_pieces

NEAR = 0.5
"""Root mean square distance up to which two flights are near each other, in standard deviations of their features."""
SHARP = 0.1
"""Share of how far a state moves, within which a function such as dry friction changes its sign."""


def alike_nearby(flights: Sequence[tuple[Floats, Floats]]) -> Likeness:
    """How alike disturbances are where flights pass near each other.

    Args:
        flights: of each what it does (n, p), about 0, and what disturbed it (n,), with the same rows.

    Returns:
        The likeness over all pairs of flights; nothing where none are near each other.
    """
    pieces = [(in_pieces(doing), in_pieces(disturbed)) for doing, disturbed in flights]
    if not pieces:
        return Likeness.of([])
    features = _scaled([doing for doing, _ in pieces])
    disturbed = [series for _, series in pieces]
    pairs = []
    for one, other in combinations(range(len(pieces)), 2):
        nearest, near = _nearest(features[one], features[other])
        pairs.append((np.where(near, disturbed[one], 0.0), np.where(near, disturbed[other][nearest], 0.0)))
    return Likeness.of(pairs)


def _scaled(flights: Sequence[Floats]) -> list[Floats]:
    """What flights do, and on which side of 0, each in standard deviations over all flights."""
    size = np.sqrt(np.mean([np.square(doing).mean(axis=0) for doing in flights], axis=0))
    around = SHARP * np.where(size > 0.0, size, 1.0)
    sided = [np.hstack([doing, doing / (np.abs(doing) + around)]) for doing in flights]
    spread = np.sqrt(np.mean([doing.var(axis=0) for doing in sided], axis=0))
    return [doing / np.where(spread > 0.0, spread, 1.0) for doing in sided]


def _nearest(one: Floats, other: Floats) -> tuple[Floats, Floats]:
    """For each row of one flight the nearest row of another one, and whether it is near."""
    distances = np.stack([np.square(other - row).mean(axis=1) for row in one])
    nearest = distances.argmin(axis=1)
    return nearest, distances[np.arange(len(one)), nearest] <= NEAR * NEAR
