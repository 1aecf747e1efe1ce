"""Poles: where a denominator is zero, a law is infinite, and no machine is that anywhere in its envelope."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.terms.denominators import Denominator
from twinloop.identification.terms.pool import Pool
from twinloop.signals import Bounds, Signals

POINTS = 400
"""At which a denominator is looked at, about; never fewer than the two ends of each state."""
CROSSES = 0.05
"""Share of its readings that a state has beyond 0 at least if it changes its sign, rather than its noise."""


def room(signals: Signals, states: Floats) -> tuple[Bounds, ...]:
    """Within which bounds a law is to hold: the envelope, a whole turn, or where the runs were, if that is wider.

    A state that never changed its sign, such as a concentration, is not taken to: envelopes often leave it some space
    beyond 0, where its law has poles that nothing meets.

    Args:
        signals: of the system.
        states: readings of all runs (rows, n_x).
    """
    bounds = []
    for state, seen in zip(signals.states, states.T, strict=True):
        low, high = float(seen.min()), float(seen.max())
        if state.envelope is not None:
            least, most = state.envelope
            low = min(low, least if (seen < 0.0).mean() >= CROSSES else max(least, 0.0))
            high = max(high, most if (seen > 0.0).mean() >= CROSSES else min(most, 0.0))
        elif state.period is not None:
            low, high = min(low, -0.5 * state.period), max(high, 0.5 * state.period)
        bounds.append((low, high))
    return tuple(bounds)


def vanishes_nowhere(pool: Pool, denominator: Denominator, room: Sequence[Bounds]) -> bool:
    """Whether a denominator stays above 0 on a grid over the room of its states.

    Args:
        pool: with its nodes.
        denominator: of states.
        room: bounds of each state; empty: nothing is known of it.
    """
    nodes, weights = [node for node, _ in denominator], np.array([weight for _, weight in denominator])
    return not room or bool((1.0 + (_on_grid(pool, nodes, room) * weights).sum(axis=1)).min() > 0.0)


def _on_grid(pool: Pool, nodes: Sequence[int], room: Sequence[Bounds]) -> Floats:
    """Values of nodes of states on a grid over their room (points, nodes)."""
    used = sorted({leaf for node in nodes for leaf in pool.leaves(node) if leaf is not None})
    ends = 2
    while used and (ends + 1) ** len(used) <= POINTS:
        ends += 1
    grid = np.array(list(product(*(np.linspace(*room[i], ends) for i in used))))
    rows = np.zeros((len(grid), pool.inputs))
    rows[:, used] = grid
    return pool.values(nodes, rows)
