"""Hidden states that motion fills, around a point: what fills them, and where they settle."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.law import Law
from twinloop.law.linear.dual import Dual


def times(law: Law) -> Floats:
    """Time of each hidden state that states fill, s."""
    return np.array([one.time for one in law.actuation.stored])


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
    stored = filling(law, Dual(state, np.zeros((len(state), 0)))).values * times(law)
    return np.concatenate([np.zeros(len(law.actuation.hidden) - len(stored)), stored])
