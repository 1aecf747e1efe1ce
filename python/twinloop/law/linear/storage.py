"""Hidden states that motion fills, around a point: what fills them, and where they settle."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.actuation import partners
from twinloop.law.law import Law
from twinloop.law.linear.dual import Dual


def fading(law: Law) -> Floats:
    """How fast the hidden states that states fill fade, and turn into each other (stored, stored), 1/s."""
    stored = law.actuation.stored
    rates = np.diag([1.0 / one.time for one in stored])
    for place, partner in enumerate(partners(stored)):
        if partner != place:
            rates[place, partner] = (1.0 if partner > place else -1.0) / stored[place].turns
    return rates


def filling(law: Law, states: Dual) -> Dual:
    """What fills each of these hidden states beyond its rest, with its slopes.

    Args:
        law: of a twin.
        states: of the signals, the first rows.
    """
    stored = law.actuation.stored
    values, slopes = np.empty(len(stored)), np.empty((len(stored), states.slopes.shape[1]))
    for row, one in enumerate(stored):
        scales = np.array([law.signals.states[place].scale for place in one.states])
        given = states.rows(one.states) * (1.0 / scales)
        given = given * given if one.squared else given
        values[row] = given.values.mean() - (one.rest or 0.0)
        slopes[row] = given.slopes.mean(axis=0)
    return Dual(values, slopes)


def settled(law: Law, state: Floats) -> Floats:
    """All hidden states at a point: those that commands fill at 0, the others where they settle there.

    Args:
        law: of a twin.
        state: (n_x,), SI units, radians.
    """
    filled = filling(law, Dual(state, np.zeros((len(state), 0)))).values
    stored = np.linalg.solve(fading(law), filled)
    return np.concatenate([np.zeros(len(law.actuation.hidden) - len(stored)), stored])
