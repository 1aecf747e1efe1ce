"""Hinges: terms that are 0 on one side of a place and grow from there on the other.

A stop pushes once it is touched, a gear turns its load once the play is used up, a valve lets nothing through before it
is a little open. No polynomial says so. A hinge max(0, z - c) does (Friedman 1991), and times the rate of z it is what
a contact loses (Hunt and Crossley 1975); or a damper stands beside the spring, and neither pulls. At a speed v a motor
of limited power gives u - max(0, u v - c) / v. A servo that turns only so fast follows z = k (u - x) by
z - max(0, z - c) + max(0, -z - c).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import combinations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.identification.terms.libraries import periodic
from twinloop.identification.terms.pool import Pool
from twinloop.law.expressions import CONSTANT, SHARE
from twinloop.law.play import FIRM
from twinloop.signals import Signals, rates

PLACES = 16
"""Places that are tried between the least and the largest value of a coordinate, and as many among its readings."""
LIMITS = 6
"""Places that are tried between the least and the largest of what drives a chain, and as many among its values."""
PROPORTION = 5.0
"""Nats that a hinge must gain for each weight of a drive and for a damping, which were estimated."""
DAMPINGS = (0.1, 0.3, 1.0, 3.0)
"""What holds back over what pushes back, periods, that is tried: a contact of which more is seen than one reading."""
NEGLIGIBLE = 0.02
"""Share of what the strongest input of a drive moves that another one has to move to count."""
MOST = 400
"""Hinges that are tried; where there would be more, fewer places are."""
SLOW = 0.05
"""Share of its largest value that a state is above where a command is limited by what it is times that state."""
WORTH = 10.0
"""Nats that a hinge must gain beside its description: with a few of them anything can be drawn."""


@dataclass(frozen=True)
class Hinge:
    """A place of a coordinate z at which something begins.

    Args:
        inputs: those that z is a weighted sum of.
        weights: theirs.
        rates: the inputs that are the derivatives of those; none where there are none, or the term is without them.
        side: 1 if it grows above the place, -1 below it, 0 on both sides of 0 alike.
        place: c.
        over: a state and its scale that z is the input times, and the term is over: what a limited power takes from the
            input; None: there is none.
        damping: of what pushes back, over its stiffness, s; 0: without a damper.
    """

    inputs: tuple[int, ...]
    weights: tuple[float, ...]
    rates: tuple[int, ...]
    side: int
    place: float = 0.0
    over: tuple[int, float] | None = None
    damping: float = 0.0

    @property
    def is_plain(self) -> bool:
        """Whether z is an input or the difference of two: its weights are units, and were not estimated."""
        first, *others = self.weights
        return not others or others == [-first]


def hinges(signals: Signals, inputs: Floats) -> list[Hinge]:
    """Hinges where the runs have been.

    Args:
        signals: of the system.
        inputs: of the model (rows, inputs), states first.

    Returns:
        Of states that are no rates and do not wrap, and of commands of one sign, to either side; of differences of two
        states of one unit, and of commands of two signs, to both sides alike. Those of states and of differences also
        times their rate. Of differences of two declared derivatives of one unit, to one side at rest, and to either
        elsewhere. Of commands times a state that keeps away from 0, over that state: what a limited power takes from
        them.
    """
    kinds = list(_kinds(signals, [i for i in range(signals.n_x) if _keeps_away_from_zero(inputs[:, i])]))
    count = min(PLACES, MOST // (2 * max(1, len(kinds))))
    found = list(_dampers(signals, inputs))
    for kind in kinds:
        values = _values(kind, inputs)
        if kind.over is not None:
            values = values * (inputs[:, kind.over[0]] / kind.over[1])
        places = _places(values if kind.side else np.abs(values), count)
        found += [replace(kind, place=place) for place in places]
    return found


def limits(drives: Iterable[Mapping[int, float]], inputs: Floats) -> list[Hinge]:
    """Hinges where what drives a chain may be limited, to both sides alike and to one.

    Args:
        drives: coefficients of two inputs or more that drive a chain together.
        inputs: of the model (rows, inputs).
    """
    found = []
    for weights in drives:
        moved = {i: abs(weight) * float(inputs[:, i].std()) for i, weight in weights.items()}
        counting = tuple(i for i in weights if moved[i] > NEGLIGIBLE * max(moved.values()))
        values = (inputs[:, list(counting)] * [weights[i] for i in counting]).sum(axis=1)
        largest = float(np.abs(values).max())
        for side in (0, 1) if len(counting) > 1 else ():
            kind = Hinge(counting, tuple(weights[i] / largest for i in counting), (), side)
            places = _places((values if side else np.abs(values)) / largest, LIMITS)
            found += [replace(kind, place=place) for place in places]
    return found


def entered(pool: Pool, hinge: Hinge, tried: int) -> int:
    """The node of a hinge, with its price.

    Args:
        pool: that it is entered in.
        hinge: of the same inputs.
        tried: hinges that it is chosen from.
    """
    coordinate = _coordinate(pool, hinge)
    speed = None if hinge.over is None else pool.share(*hinge.over)
    if speed is not None:
        coordinate = pool.product(coordinate, speed)
    above, below = (_depth(pool, hinge, coordinate, sign) for sign in (1, -1))
    if hinge.side:
        force = depth = above if hinge.side > 0 else below
    else:
        force, depth = pool.add("-", above, below), pool.add("+", above, below)
    if hinge.rates and not hinge.damping:
        force = pool.product(depth, _difference(pool, hinge.rates))
    if speed is not None:
        force = pool.add("/", force, speed)
    estimated = len(hinge.inputs) * (not hinge.is_plain) + (hinge.damping > 0.0)
    pool.found.setdefault(force, WORTH + float(log(tried)) + PROPORTION * estimated)
    return force


def begun(pool: Pool, terms: Iterable[int], signals: Signals) -> list[Hinge]:
    """Hinges of states that some terms are made of.

    Args:
        pool: with the terms.
        terms: some.
        signals: of the system.
    """
    found = []
    for number in pool.needed(terms):
        beyond = pool[number].operands[0] if pool[number].operation == "max" else pool.one
        if pool[beyond].operation == "-":
            above = pool[beyond].operands
            for side, (coordinate, place) in ((1, above), (-1, above[::-1])):
                state = pool[coordinate].operands[0] if pool[coordinate].operation == SHARE else pool.one
                if state < signals.n_x and pool[place].operation == CONSTANT:
                    weight = 1.0 / signals.states[state].scale
                    found.append(Hinge((state,), (weight,), (), side, pool[place].value))
    return found


def damped(few: Iterable[Hinge], signals: Signals) -> list[Hinge]:
    """What pushes back with a damper where one of some hinges begins, of those whose coordinate has a rate.

    Args:
        few: hinges that may be there.
        signals: of the system.
    """
    begins = [hinge for hinge in few if hinge.is_plain and hinge.over is None and hinge.place]
    own = [(hinge, _rates_of(signals, hinge.inputs)) for hinge in begins]
    places = dict.fromkeys(replace(hinge, rates=rates) for hinge, rates in own if rates)
    return [replace(one, damping=share * signals.dt) for one in places for share in DAMPINGS]


def _depth(pool: Pool, hinge: Hinge, coordinate: int, sign: int) -> int:
    """The node of how far a coordinate is beyond the place on one side, with what its damper adds; never below 0."""
    if sign > 0:
        # At rest there is no place that could be tuned.
        beyond = pool.add("-", coordinate, hinge.place) if hinge.place else coordinate
    else:
        place = hinge.place if hinge.side else -hinge.place
        beyond = pool.add("-", pool.constant(place), coordinate)
    if hinge.damping:
        rate = pool.share(_difference(pool, hinge.rates), 1.0 / hinge.weights[0])
        pushed = pool.add("+", beyond, pool.product(rate, pool.constant(sign * hinge.damping)))
        beyond = pool.add("min", pool.share(beyond, 1.0 / FIRM), pushed)
    return pool.add("max", beyond, 0.0)


def _difference(pool: Pool, inputs: Sequence[int]) -> int:
    """The node of an input, or of one less another."""
    first, *second = inputs
    return pool.add("-", first, second[0]) if second else first


def _coordinate(pool: Pool, hinge: Hinge) -> int:
    """The node of z; where it is no input and no difference of two, its weights are constants that may be tuned."""
    if hinge.is_plain:
        return pool.share(_difference(pool, hinge.inputs), 1.0 / hinge.weights[0])
    parts = [
        pool.product(pool.constant(weight), each)
        for weight, each in zip(hinge.weights, hinge.inputs, strict=True)
    ]
    return reduce(partial(pool.add, "+"), parts)


def _dampers(signals: Signals, inputs: Floats) -> Iterator[Hinge]:
    """Hinges of differences of two declared derivatives of one unit: at rest to one side, elsewhere to either.

    A damper between two bodies holds back less one way than the other, and less once its valves have opened. Of a
    single rate there are none: where a stop is touched on a few readings, they would stand in for it.
    """
    states = signals.states
    moving = [i for i, state in enumerate(states) if state.derivative_of is not None]
    for i, j in combinations(moving, 2):
        if states[i].unit != states[j].unit:
            continue
        weight = 1.0 / states[i].scale
        kind = Hinge((i, j), (weight, -weight), (), 1)
        values = _values(kind, inputs)
        if values.min() < 0.0 < values.max():
            yield kind
        for place in _places(np.abs(values), LIMITS // 2):
            yield from (
                replace(kind, side=side, place=side * place)
                for side in (1, -1)
                if place < (side * values).max()
            )


def _values(kind: Hinge, inputs: Floats) -> Floats:
    """Values of z (rows,)."""
    values: Floats = (inputs[:, list(kind.inputs)] * kind.weights).sum(axis=1)
    return values


def _keeps_away_from_zero(values: Floats) -> bool:
    """Whether all are above zero, the least by a good share of the largest."""
    return float(values.min()) > SLOW * float(np.abs(values).max())


def _kinds(signals: Signals, positive: Sequence[int]) -> Iterator[Hinge]:
    """Coordinates, sides and rates of hinges; their places are still to be found.

    Args:
        signals: of the system.
        positive: states that a command may be limited by its product with.
    """
    states, moving = signals.states, rates(signals)
    resting = [i for i in range(signals.n_x) if i not in moving and i not in periodic(signals)]
    alone = [((i,), (1, -1)) for i in resting]
    between = [((i, j), (0,)) for i, j in combinations(resting, 2) if states[i].unit == states[j].unit]
    for inputs, sides in (*alone, *between):
        own = _rates_of(signals, inputs)
        for side in sides:
            for moved in dict.fromkeys(((), own)):
                weight = 1.0 / states[inputs[0]].scale
                yield Hinge(inputs, (weight, -weight)[: len(inputs)], moved, side)
    for place, command in enumerate(signals.commands, signals.n_x):
        for side in (0,) if command.bounds[0] < 0.0 < command.bounds[1] else (1, -1):
            yield Hinge((place,), (1.0,), (), side)
        for state in positive:
            for side in (1, -1) if state not in periodic(signals) else ():
                yield Hinge((place,), (1.0,), (), side, over=(state, states[state].scale))


def _rates_of(signals: Signals, inputs: Sequence[int]) -> tuple[int, ...]:
    """States that are declared the derivatives of some inputs; none where one has none."""
    of = {state.derivative_of: i for i, state in enumerate(signals.states) if state.derivative_of is not None}
    names = [signals.states[i].name for i in inputs if i < signals.n_x]
    fits = len(names) == len(inputs) and all(name in of for name in names)
    return tuple(of[name] for name in names) if fits else ()


def _places(values: Floats, count: int) -> list[float]:
    """Places within some values: evenly between their ends, and so that as many readings lie between any two."""
    low, high = float(values.min()), float(values.max())
    if count < 1 or not high > low:
        return []
    ordered = np.sort(values)
    evenly = [low + (high - low) * (k + 1) / (count + 1) for k in range(count)]
    among = [float(ordered[(k + 1) * len(ordered) // (count + 1)]) for k in range(count)]
    return sorted({place for place in (*evenly, *among) if low < place < high})
