"""Exponentials: what grows by the same factor with each step of something.

A reaction with its temperature (Arrhenius 1889), a current with the voltage across a junction (Shockley 1949), the flow
through a valve of equal percentage with its lift. Over a wide range no polynomial of few terms follows one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.identification.terms.libraries import angles, coordinates
from twinloop.identification.terms.pool import Pool
from twinloop.signals import Signals, rates

RISES = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0, 8.0, -8.0)
"""Changes of an exponent over the runs that are tried; which one it is in between is tuned."""
FINER = ((0.7, 0.85, 1.0, 1.2, 1.4), (0.92, 0.96, 1.0, 1.04, 1.08))
"""Shares of rises that have shown that are tried, one list after the other."""
MOST = 400
"""Exponentials that are tried; where there would be more, they are those without another input."""
WORTH = 10.0
"""Nats that an exponential must gain beside its description: over a short range a square stands in for it."""
CHOICE = float(log(2.0))
"""Nats of the choice whether an input is times an exponential that is there."""
ABSOLUTE = ("K", "kelvin")
"""Units of temperatures of which a reaction's exponent is the inverse."""


@dataclass(frozen=True)
class Exponential:
    """exp(rise (z - at) / size), or of a temperature exp(rise (at / z - 1)), alone or times another input.

    Args:
        input: z.
        rise: by how much the exponent changes over a size, or as much as at / z does.
        at: where it is 1.
        size: a scale of z; of a temperature `at` itself.
        inverse: whether z is a temperature.
        beside: the node that it is times; None: it is alone.
    """

    input: int
    rise: float
    at: float
    size: float
    inverse: bool
    beside: int | None = None

    @property
    def alone(self) -> Exponential:
        """The same, times nothing."""
        return replace(self, beside=None)


def exponentials(pool: Pool, signals: Signals, inputs: Floats) -> list[Exponential]:
    """Exponentials of what the runs had, alone and times each input.

    Args:
        pool: in which inputs are entered.
        signals: of the system.
        inputs: of the model (rows, inputs), states first.

    Returns:
        Of states that are neither angles nor rates, and of commands of one sign, as long as they moved.
    """
    alone = [one for place in _places(signals) for one in _of(place, signals, inputs)]
    others = coordinates(pool, signals)
    if len(alone) * (1 + len(others)) > MOST:
        others = []
    return [replace(one, beside=beside) for one in alone for beside in (None, *others)]


def finer(
    few: Iterable[Exponential], every: Iterable[Exponential], shares: Iterable[float]
) -> list[Exponential]:
    """Exponentials of shares of the rises of some, alone and times all that any are times.

    Args:
        few: those that have shown.
        every: all of which they have.
        shares: of their rises.
    """
    alone, others = dict.fromkeys(one.alone for one in few), dict.fromkeys(one.beside for one in every)
    return [
        replace(one, rise=share * one.rise, beside=other)
        for one in alone
        for share in shares
        for other in others
    ]


def entered(pool: Pool, one: Exponential, tried: int, uses: int = 1) -> int:
    """The node of an exponential, with its price.

    Args:
        pool: that it is entered in.
        one: of the same inputs.
        tried: exponentials that it is chosen from.
        uses: terms that pay for it together.
    """
    place = pool.share(one.input, one.size)
    along, at = (pool.add("/", pool.one, place), 1.0) if one.inverse else (place, one.at / one.size)
    grown = pool.add("exp", pool.product(pool.constant(one.rise), pool.add("+", along, -at)))
    share = (WORTH + float(log(tried))) / uses
    if one.beside is None:
        pool.found[grown] = share
        return grown
    term = pool.product(one.beside, grown)
    pool.found[term] = pool.length(one.beside) + CHOICE + share
    return term


def origins(pool: Pool, terms: Iterable[int]) -> set[int]:
    """Nodes that say where an exponential is 1: to tune that, too, says what the coefficient says.

    Args:
        pool: with the terms.
        terms: some.
    """
    found = set()
    for number in pool.needed(terms):
        risen = pool[pool[number].operands[0]] if pool[number].operation == "exp" else None
        if risen is not None and risen.operation == "*":
            beyond = [part for part in risen.operands if pool.constant_value(part) is None]
            found |= {part for part in beyond if len(beyond) == 1 and pool[part].operation == "+"}
    return found


def _places(signals: Signals) -> Iterator[int]:
    """Inputs that something may grow with."""
    moving = angles(signals) | rates(signals)
    yield from (i for i in range(signals.n_x) if i not in moving)
    yield from (j for j, one in enumerate(signals.commands, signals.n_x) if one.bounds[0] >= 0.0)


def _of(place: int, signals: Signals, inputs: Floats) -> Iterator[Exponential]:
    """Exponentials of one input, alone."""
    values = inputs[:, place]
    low, high, at = float(values.min()), float(values.max()), float(values.mean())
    state = signals.states[place] if place < signals.n_x else None
    inverse = state is not None and state.unit in ABSOLUTE and low > 0.0
    size = at if inverse else 1.0 if state is None else state.scale
    moved = at / low - at / high if inverse else (high - low) / size
    if moved > 0.0:
        yield from (Exponential(place, rise / moved, at, size, inverse) for rise in RISES)
