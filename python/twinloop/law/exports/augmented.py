"""A law whose hidden states that motion fills are states like others: for exports, which step states and no more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.actuation import Actuation, HiddenState, partners, twists
from twinloop.law.expressions import INPUT, Expressions
from twinloop.law.law import Law
from twinloop.law.linear.storage import settled
from twinloop.law.play import FIRM
from twinloop.signals import Signals, State


def augmented(law: Law) -> Law:
    """The same law with its stored hidden states behind the other states, integrated with them by the same steps.

    Args:
        law: whose outputs are derivatives, integrated by Runge and Kutta's method.
    """
    stored, signals = law.actuation.stored, law.signals
    n_x, count = signals.n_x, len(stored)
    names = law.held_symbols[len(law.held_symbols) - count :]
    before = twists(stored)
    added = [
        _held(name, one, place in before.values())
        for place, (name, one) in enumerate(zip(names, stored, strict=True))
    ]
    expressions, made = Expressions(), dict[int, int]()
    presses = {law.inputs - count + twist: twist for twist in before}

    def moved(place: int) -> int:
        """An input's place behind the new states, or among them."""
        kept = law.inputs - count
        return place if place < n_x else place + count if place < kept else n_x + place - kept

    for number in law.expressions.needed(law.outputs):
        node = law.expressions[number]
        if node.operation == INPUT and int(node.value or 0) in presses:
            made[number] = _press(expressions, signals, stored, presses[int(node.value or 0)])
        elif node.operation == INPUT:
            made[number] = expressions.input(moved(int(node.value or 0)))
        else:
            operands = tuple(made[operand] for operand in node.operands)
            made[number] = expressions.enter(node._replace(operands=operands))
    slopes = [_slope(expressions, signals, stored, place) for place in range(count)]
    return Law(
        replace(signals, states=(*signals.states, *added)),
        law.form,
        expressions,
        (*(made[output] for output in law.outputs), *slopes),
        Actuation(law.actuation.actuators, law.actuation.hidden[: len(law.actuation.hidden) - count]),
        (*law.offsets, *[0.0] * count),
        law.levels,
        (*law.reports, *[None] * count) if law.reports else (),
        tuple(
            f"{name} begins {'where it stands still under the first state' if moved_along else 'with 0'}"
            for name, moved_along in zip(names, _along(stored), strict=True)
        ),
    )


def begun(law: Law, state: Floats) -> Floats:
    """A state (n_x,) with what its law's stored hidden states are there at the start of a run."""
    stored = law.actuation.stored
    still = settled(law, state)[len(law.actuation.hidden) - len(stored) :]
    return np.concatenate([state, np.where(_along(stored), still, 0.0)])


def _along(stored: Sequence[HiddenState]) -> list[bool]:
    """Which stored hidden states begin as the first state settles them; the others begin with 0."""
    # What is behind a gap moves along.
    behind = twists(stored).values()
    return [one.settled or place in behind for place, one in enumerate(stored)]


def _held(name: str, one: HiddenState, second: bool) -> State:
    """A stored hidden state as a state; a rate behind a gap is as large as what drives it, in units of its scale."""
    if one.gap:
        return State(name, "" if second else "s", 1.0 if second else one.gap + one.turns)
    return State(name, "s", min(one.time, one.turns or one.time))


def _level(expressions: Expressions, signals: Signals, one: HiddenState, count: int) -> int:
    """The node of what fills one of so many stored hidden states, beyond its rest."""
    make, constant = expressions.add, expressions.constant
    total: int | None = None
    drivers = one.drivers(signals)
    for source, scale in drivers.items():
        # Commands come after the states, and are in units of their scales.
        of_state = source < signals.n_x
        given = expressions.input(source if of_state else source + count)
        given = make("*", given, constant(1.0 / scale)) if of_state else given
        given = make("*", given, given) if one.squared else given
        total = given if total is None else make("+", total, given)
    assert total is not None
    level = make("*", total, constant(1.0 / len(drivers))) if len(drivers) > 1 else total
    return make("-", level, constant(one.rest)) if one.rest else level


def _slope(expressions: Expressions, signals: Signals, stored: Sequence[HiddenState], place: int) -> int:
    """The node of a stored hidden state's derivative."""
    one, make, constant = stored[place], expressions.add, expressions.constant
    partner = partners(stored)[place]

    def itself(of: int) -> int:
        return expressions.input(signals.n_x + of)

    faded = make("/", itself(place), constant(one.time))
    if place in twists(stored):
        return make("-", _level(expressions, signals, one, len(stored)), itself(partner))
    if one.gap:
        pressed = _press(expressions, signals, stored, partner)
        return make("-", make("/", pressed, constant(one.turns * one.turns)), faded)
    slope = make("-", _level(expressions, signals, one, len(stored)), faded)
    if partner == place:
        return slope
    turned = make("/", itself(partner), constant(one.turns))
    return make("-" if partner > place else "+", slope, turned)


def _press(expressions: Expressions, signals: Signals, stored: Sequence[HiddenState], place: int) -> int:
    """The node of what presses beyond the gap of a twist, on one side or on the other."""
    one, make, constant = stored[place], expressions.add, expressions.constant
    twist, none = expressions.input(signals.n_x + place), constant(0.0)
    damped = make("*", _slope(expressions, signals, stored, place), constant(one.damping))
    sides = []
    for beyond, nearer, least in (("-", "min", "max"), ("+", "max", "min")):
        deep = make(beyond, twist, constant(one.gap))
        pressed = make(nearer, make("*", deep, constant(FIRM)), make("+", deep, damped))
        sides.append(make(least, pressed, none))
    return make("+", *sides)
