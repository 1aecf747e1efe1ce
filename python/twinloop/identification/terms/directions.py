"""Directions of commands: how alike commands act together, as a controller's mixer or the best model so far says.

Rotors, wheels and rudders share their work. What one output feels of them all, their sum or the difference of two
sides, acts elsewhere, too: times a rate, times a hidden state, in squares. One term says so where it would take one for
each command, and holds where the commands are no longer tied to each other, as when one of them saturates.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import alike_commands
from twinloop.signals import Signals

EQUAL = 0.8
"""Commands that move an output at least this much as strongly as the strongest do it equally."""
LEAST = 0.1
"""Those that move it less than this do not."""
STEP = 0.01
"""Of a command, in units of its scale, by which it is found how strongly it moves an output."""

Direction = tuple[tuple[int, float], ...]
"""Shares of inputs of which at least two are not 0: the first one is positive, the largest 1 or -1."""


def directions(problem: Problem, sums: Sequence[Sum], signals: Signals) -> list[Direction]:
    """How alike commands move each output in the middle of the runs, and all of them alike.

    Args:
        problem: of the sums.
        sums: of the best model so far.
        signals: of the system.

    Returns:
        Directions without repetition; none where no commands are alike.
    """
    found = []
    middle = problem.stages.start.mean(axis=0)
    for group in (group for group in alike_commands(signals) if len(group) > 1):
        places = [signals.n_x + i for i in group]
        rows = np.repeat(middle[np.newaxis], 2 * len(group), axis=0)
        for row, place in enumerate(places):
            rows[2 * row, place] += STEP
            rows[2 * row + 1, place] -= STEP
        answers = [*(_answers(problem, sum_, rows) for sum_ in sums), np.ones(len(group))]
        found += [_direction(places, shares) for shares in answers]
    return [direction for direction in dict.fromkeys(found) if len(direction) > 1]


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
            found.append(_turned([(signals.n_x + i, shares[i]) for i in sorted(moved)]))
    return list(dict.fromkeys(found))


def terms_of(pool: Pool, direction: Direction, states: Iterable[int]) -> dict[int, list[int]]:
    """Terms that a direction makes: itself, its squares, and itself times states.

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
    return found


def _answers(problem: Problem, found: Sum, rows: Floats) -> Floats:
    """How strongly an output answers to each command, from rows a step above and a step below its middle in turn."""
    known = dict.fromkeys(problem.priors.fixed.get(found.chain.states[0], ()), 1.0)
    terms = [*found.weights.items(), *known.items()]
    # Summed row by row: a product of matrices rounds differently from processor to processor.
    weighted = problem.pool.values([term for term, _ in terms], rows) * np.array([w for _, w in terms])
    values: Floats = weighted.sum(axis=1)
    with np.errstate(invalid="ignore"):  # what is not finite is no answer
        return values[::2] - values[1::2]


def _direction(places: Sequence[int], shares: Floats) -> Direction:
    """Inputs by their shares, of which nearly equal ones are equal; empty where nothing answers."""
    largest = float(np.abs(shares).max())
    if not (np.isfinite(largest) and largest > 0.0):
        return ()
    parts = [
        (place, float(np.sign(share)) * (1.0 if abs(share) >= EQUAL else round(abs(share), 1)))
        for place, share in zip(places, (shares / largest).tolist(), strict=True)
        if abs(share) >= LEAST
    ]
    return _turned(parts)


def _turned(parts: Sequence[tuple[int, float]]) -> Direction:
    """A direction and its opposite are one."""
    turn = 1.0 if parts[0][1] > 0.0 else -1.0
    return tuple((place, turn * share) for place, share in parts)
