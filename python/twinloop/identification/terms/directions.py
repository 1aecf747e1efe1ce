"""Directions of commands: how alike commands act together, as a controller's mixer or the best model so far says.

Rotors, wheels and rudders share their work. What one output feels of them all, their sum or the difference of two
sides, acts elsewhere, too: times a rate, times a hidden state, in squares. One term says so where it would take one for
each command, and holds where the commands are no longer tied to each other, as when one of them saturates.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.terms.attitude import tilted
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import alike_commands
from twinloop.signals import Signals

Direction = tuple[tuple[int, float], ...]
"""Shares of inputs of which at least two are not 0: the first one is positive, the largest 1 or -1."""


def together(pool: Pool, direction: Direction, *, squared: bool = False) -> int:
    """The node of a direction: its inputs, or their squares, by their shares."""
    node: int | None = None
    for place, share in direction:
        part = pool.product(place, place) if squared else place
        part = part if abs(share) == 1.0 else pool.add("*", part, abs(share))
        node = part if node is None else pool.add("+" if share > 0.0 else "-", node, part)
    assert node is not None
    return node


def unequal(direction: Direction) -> int:
    """How many inputs have a share of their own."""
    return sum(abs(share) != 1.0 for _, share in direction)


def of_mixer(matrix: Floats, signals: Signals) -> list[Direction]:
    """Directions in which a mixer moves commands: its columns, of alike commands.

    Args:
        matrix: of the mixer (commands, axes).
        signals: of the system.

    Returns:
        Directions without repetition; none for an axis that moves one command, or commands of different kinds.
    """
    found = []
    for column in matrix.T:
        moved = set(np.flatnonzero(column).tolist())
        if len(moved) > 1 and any(moved <= set(group) for group in alike_commands(signals)):
            shares = (column / np.abs(column).max()).tolist()
            found.append(turned([(signals.n_x + i, shares[i]) for i in sorted(moved)]))
    return list(dict.fromkeys(found))


def terms_of(
    pool: Pool, direction: Direction, states: Iterable[int], tilts: Sequence[int] = ()
) -> dict[int, list[int]]:
    """Terms that a direction makes: itself, its squares, and itself times states.

    Where all pull the same way, as rotors that carry a body, it and its squares are turned by that body's tilts, too.

    Args:
        pool: that they are entered in.
        direction: of alike commands.
        states: that it is multiplied by.
        tilts: how a body's pose turns what drives it, see `attitude.py`.

    Returns:
        By the term's node those of the plain terms that it is made of.
    """
    places, node = [place for place, _ in direction], together(pool, direction)
    found = {
        node: places,
        together(pool, direction, squared=True): [pool.product(place, place) for place in places],
    }
    for state in states:
        found[pool.product(state, node)] = [pool.product(state, place) for place in places]
    for tilt in tilts if all(share > 0.0 for _, share in direction) else ():
        parts = zip(*(tilted(pool, tilt, place) for place in places), strict=True)
        for whole, plain in zip((node, together(pool, direction, squared=True)), parts, strict=True):
            found[pool.product(tilt, whole)] = list(plain)
    return found


def turned(parts: Sequence[tuple[int, float]]) -> Direction:
    """A direction and its opposite are one."""
    turn = 1.0 if parts[0][1] > 0.0 else -1.0
    return tuple((place, turn * share) for place, share in parts)
