"""Poles: where a denominator is zero, a law is infinite, and no machine is that anywhere in its envelope."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.terms.denominators import Denominator
from twinloop.identification.terms.pool import Pool
from twinloop.law.expressions import CONSTANT, SHARE
from twinloop.signals import Bounds, Signals

POINTS = 400
"""At which a denominator is looked at, about; never fewer than the two ends of each input."""
CROSSES = 0.05
"""Share of its readings that a state has beyond 0 at least if it changes its sign, rather than its noise."""
OFF = 1e-3
"""Share of its room that a state is away from 0 at least where its room ends there."""

FACTORS = ("*", "/", "abs", "sqrt", SHARE)
"""Operations that give 0 where an operand is 0, or is divided by nearly nothing, and nowhere else."""


def room(signals: Signals, states: Floats) -> tuple[Bounds, ...]:
    """Within which bounds of its inputs a law is to hold.

    Of a state that is the envelope, a whole turn, or where the runs were, if that is wider. A state that never changed
    its sign, such as a concentration, is not taken to: envelopes often leave it some space beyond 0, where its law has
    poles that nothing meets. A command may be all that it is allowed to be, in units of its scale.

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
    return (*bounds, *((u.bounds[0] / u.size, u.bounds[1] / u.size) for u in signals.commands))


def divides(pool: Pool, node: int, states: int, room: Sequence[Bounds]) -> bool:
    """Whether a node keeps its sign over the room of its inputs, so that one may divide by it.

    A command that may be 0 does not, a state whose room only ends there does. Of a hidden state, which begins at 0,
    nothing keeps its sign.

    Args:
        pool: with the node.
        node: an expression.
        states: how many inputs are states, the first.
        room: bounds of each input; empty: nothing is known of it.
    """
    if not room or pool.is_hidden(node):
        return not room
    operation, operands, value = pool[node]
    if operation == CONSTANT:
        return value != 0.0
    # What touches 0 and turns back, as a size does, shows in what it is made of.
    if operation in FACTORS:
        return all(divides(pool, operand, states, room) for operand in operands)
    inside = [_off_zero(bounds) if i < states else bounds for i, bounds in enumerate(room)]
    values = _on_grid(pool, [node], inside)
    return bool(values.min() > 0.0 or values.max() < 0.0)


def _off_zero(bounds: Bounds) -> Bounds:
    """Bounds that end near 0 where they did at 0."""
    low, high = bounds
    return (OFF * high if low == 0.0 else low), (OFF * low if high == 0.0 else high)


def vanishes_nowhere(pool: Pool, denominator: Denominator, room: Sequence[Bounds]) -> bool:
    """Whether a denominator stays above 0 on a grid over the room of its inputs; a state alone may end there.

    Args:
        pool: with its nodes.
        denominator: of states.
        room: bounds of each input; empty: nothing is known of it.
    """
    if not room:
        return True
    weights = np.array([weight for _, weight in denominator.parts])
    values = denominator.one + (_on_grid(pool, denominator.nodes, room) * weights).sum(axis=1)
    least = float(values.min())
    return least > 0.0 or (least == 0.0 and not denominator.one)


def _on_grid(pool: Pool, nodes: Sequence[int], room: Sequence[Bounds]) -> Floats:
    """Values of nodes on a grid over the room of their inputs (points, nodes)."""
    used = sorted({leaf for node in nodes for leaf in pool.leaves(node) if leaf is not None})
    ends = 2
    while used and (ends + 1) ** len(used) <= POINTS:
        ends += 1
    axes = np.meshgrid(*(np.linspace(*room[i], ends) for i in used), indexing="ij")
    rows = np.zeros((ends ** len(used), pool.inputs))
    for i, axis in zip(used, axes, strict=True):
        rows[:, i] = axis.ravel()
    return pool.values(nodes, rows)
