"""Hidden states that motion fills, around a point: what fills them, what a law sees of them, and where they settle."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.actuation import partners, twists
from twinloop.law.law import Law
from twinloop.law.linear.dual import Dual
from twinloop.law.play import FIRM, press


def fading(law: Law) -> Floats:
    """How fast the hidden states that are integrated fade, and turn into each other (stored, stored), 1/s.

    Of a twist before a gap it is how fast the rate behind it lessens the twist.
    """
    stored = law.actuation.stored
    rates = np.diag([1.0 / one.time for one in stored])
    for place, partner in enumerate(partners(stored)):
        if partner != place and not stored[place].gap:
            rates[place, partner] = (1.0 if partner > place else -1.0) / stored[place].turns
    for twist, rate in twists(stored).items():
        rates[twist, [twist, rate]] = 0.0, 1.0
    return rates


def filling(law: Law, inputs: Dual) -> Dual:
    """What fills each of these hidden states beyond its rest, with its slopes; nothing fills a rate behind a gap.

    Args:
        law: of a twin.
        inputs: states of the signals, then effects of commands in units of their scales.
    """
    stored = law.actuation.stored
    values, slopes = np.zeros(len(stored)), np.zeros((len(stored), inputs.slopes.shape[1]))
    behind = twists(stored).values()
    for row, one in enumerate(stored):
        if row in behind:
            continue
        drivers = one.drivers(law.signals)
        given = inputs.rows(list(drivers)) * (1.0 / np.array(list(drivers.values())))
        given = given * given if one.squared else given
        values[row] = given.values.mean() - (one.rest or 0.0)
        slopes[row] = given.slopes.mean(axis=0)
    return Dual(values, slopes)


def seen(law: Law, inputs: Dual, held: Dual) -> Dual:
    """What the law sees of these hidden states: themselves, but of a twist before a gap what presses beyond it.

    Args:
        law: of a twin.
        inputs: states of the signals, then effects of commands in units of their scales.
        held: these hidden states.
    """
    stored, found = law.actuation.stored, held
    turning = filling(law, inputs) - held.mapped(fading(law))
    for twist in twists(stored):
        one, here = stored[twist], [twist]
        found = found.put(here, _pressed(held.rows(here), turning.rows(here), one.gap, one.damping))
    return found


def moved(law: Law, inputs: Dual, held: Dual) -> Dual:
    """Derivatives of these hidden states, by what fills them and by themselves.

    Args:
        law: of a twin.
        inputs: states of the signals, then effects of commands in units of their scales.
        held: these hidden states.
    """
    stored, found = law.actuation.stored, filling(law, inputs) - held.mapped(fading(law))
    presses = seen(law, inputs, held)
    for twist, rate in twists(stored).items():
        pressed = presses.rows([twist]) * (1.0 / (stored[rate].turns * stored[rate].turns))
        found = found.put([rate], found.rows([rate]) + pressed)
    return found


def settled(law: Law, state: Floats, effects: Floats | None = None) -> Floats:
    """All hidden states at a point: those that commands fill by themselves at 0, the others where they settle there.

    A mass behind a gap moves along; its twist is such that what presses keeps it so, in the middle if nothing has to.

    Args:
        law: of a twin.
        state: (n_x,), SI units, radians.
        effects: of commands in units of their scales (n_u,); None: there are none.
    """
    stored = law.actuation.stored
    filled = filling(law, _inputs(law, state, effects)).values
    fades, bound = fading(law), filled
    for twist, rate in twists(stored).items():
        # Their own equation is no linear one.
        fades[[twist, rate]] = 0.0
        fades[twist, twist] = fades[rate, rate] = 1.0
        bound[rate] = filled[twist]
        pressed = filled[twist] * stored[rate].turns ** 2 / stored[rate].time
        bound[twist] = pressed + np.sign(pressed) * stored[twist].gap
    found = np.linalg.solve(fades, bound)
    return np.concatenate([np.zeros(len(law.actuation.hidden) - len(found)), found])


def settled_as_seen(law: Law, state: Floats, effects: Floats) -> Floats:
    """The same as the law sees them."""
    every, stored = settled(law, state, effects), len(law.actuation.stored)
    kept = len(every) - stored
    held = Dual(every[kept:], np.zeros((stored, 0)))
    return np.concatenate([every[:kept], seen(law, _inputs(law, state, effects), held).values])


def _inputs(law: Law, state: Floats, effects: Floats | None) -> Dual:
    """States and effects of commands, without slopes."""
    given = np.zeros(law.signals.n_u) if effects is None else effects
    values = np.concatenate([state[: law.signals.n_x], given])
    return Dual(values, np.zeros((len(values), 0)))


def _pressed(twist: Dual, rate: Dual, gap: float, damping: float) -> Dual:
    """What presses at a twist that changes at a rate."""
    side = np.where(twist.values < 0.0, -1.0, 1.0)
    beyond = side * twist.values - gap
    touching = FIRM * beyond < beyond + damping * side * rate.values
    pressed = press(twist.values, rate.values, gap, damping)
    slopes = np.where(touching[:, np.newaxis], FIRM * twist.slopes, twist.slopes + damping * rate.slopes)
    return Dual(pressed, np.where(pressed[:, np.newaxis] == 0.0, 0.0, slopes))
