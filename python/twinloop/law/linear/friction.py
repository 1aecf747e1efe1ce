"""Dry friction around a point: a law as it sticks, and as it slides.

At rest tanh(v / w) is steep and looks like a strong damper, but only to motion that is slower than its width w. Against
all other motion it pushes as hard as it can, with a slope of 0. A loop meets every slope between the two, by the
amplitude of its motion (describing functions; Åström and Murray 2008, section 9.5).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.expressions import INPUT, Expressions, Node
from twinloop.law.law import Law
from twinloop.law.linear.jacobian import jacobian
from twinloop.signals import rates

STEEP = 5.0
"""Slope at rest, over a speed's scale, from which a tanh is dry friction: it is all there at a fifth of the scale."""


def has_friction(law: Law) -> bool:
    """Whether a law has dry friction.

    Args:
        law: of a twin.
    """
    return bool(_frictions(law))


def sliding(law: Law, state: Floats) -> Law:
    """A law as its dry friction slides: the force of each is held at what it is at a point.

    Args:
        law: of a twin.
        state: the point (n_x,).

    Returns:
        The same for small departures from the point, without the slopes of dry friction; the law itself if it has none.
    """
    frictions = _frictions(law)
    if not frictions:
        return law
    point = np.zeros(law.inputs)
    point[: law.signals.n_x] = state
    forces = dict(zip(frictions, jacobian(law.expressions, frictions, point)[0].tolist(), strict=True))
    slides, placed = Expressions(), dict[int, int]()
    for number in law.expressions.needed(law.outputs):
        operation, operands, value = law.expressions[number]
        placed[number] = (
            slides.constant(forces[number])
            if number in forces
            else slides.enter(Node(operation, tuple(placed[operand] for operand in operands), value))
        )
    return replace(law, expressions=slides, outputs=tuple(placed[number] for number in law.outputs))


def _frictions(law: Law) -> list[int]:
    """Nodes of dry friction: steep tanh of speeds alone. Where no rates are declared every state may be a speed."""
    speeds = rates(law.signals) or set(range(law.signals.n_x))
    moved_by: dict[int, set[int]] = {}
    found = []
    for number in law.expressions.needed(law.outputs):
        operation, operands, value = law.expressions[number]
        given = (moved_by[operand] for operand in operands)
        moved_by[number] = {int(value)} if operation == INPUT else set().union(*given)
        if operation == "tanh" and moved_by[number] and moved_by[number] <= speeds:
            found.append(number)
    scales = np.array([state.scale for state in law.signals.states])
    slopes = np.abs(jacobian(law.expressions, found, np.zeros(law.inputs))[1][:, : len(scales)] * scales)
    return [
        number
        for number, steepest in zip(found, slopes.max(axis=1, initial=0.0), strict=True)
        if steepest >= STEEP
    ]
