"""Gains of a law: bounds or a fixed number, by name and with a unit, as every family takes and tells them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import number
from twinloop.errors import InvalidInput, unknown
from twinloop.signals import ordered

GainBounds = float | tuple[float, float] | tuple[float, float, str]
"""A number that fixes a gain, (low, high), or (low, high, "log") where decades matter."""


@dataclass(frozen=True)
class Gain:
    """One parameter of a family.

    Args:
        name: such as "roll.kp".
        unit: such as "N m/rad".
        low: smallest value, in its unit.
        high: largest value, in its unit.
        logarithmic: whether a search treats it on a logarithmic scale.
    """

    name: str
    unit: str
    low: float
    high: float
    logarithmic: bool = False

    @property
    def engine(self) -> tuple[float, float, bool]:
        """The same as numbers, for the native engine."""
        return self.low, self.high, self.logarithmic


@dataclass(frozen=True)
class FixedGain:
    """A fixed gain of a family: no parameter, and no gene.

    Args:
        name: such as "roll.ki".
        unit: such as "N m/(rad s)".
        value: in its unit.
    """

    name: str
    unit: str
    value: float

    @property
    def engine(self) -> float:
        """The same as a number, for the native engine."""
        return self.value


def gain_of(name: str, unit: str, bounds: GainBounds) -> Gain | FixedGain:
    """A gain between checked bounds, or fixed at a number.

    Args:
        name: such as "roll.kp".
        unit: such as "N m/rad".
        bounds: what `gain_bounds` returned, in that unit.
    """
    if isinstance(bounds, tuple):
        low, high, *scale = bounds
        return Gain(name, unit, float(low), float(high), scale == ["log"])
    return FixedGain(name, unit, bounds)


def bounds_by_name(family: str, bounds: object, names: Sequence[str]) -> dict[str, GainBounds]:
    """Bounds of all gains of a family.

    Args:
        family: how to call it in an error.
        bounds: (low, high) or (low, high, "log") by name, or a number that fixes a gain.
        names: of the gains, in the order of the law.

    Returns:
        Checked bounds by name, in the order of the law.

    Raises:
        InvalidInput: no dict, an unknown or missing name, or bounds the wrong way round.
    """
    if not isinstance(bounds, Mapping):
        raise InvalidInput(
            f"{family}, gains: expected a dict of bounds by name, found {bounds!r}; name every gain."
        )
    for name in bounds:
        if name not in names:
            raise unknown("gain", name, names)
    missing = [name for name in names if name not in bounds]
    if missing:
        raise InvalidInput(
            f"{family}, gains: expected bounds for all {len(names)}, found none for {', '.join(missing)}; add"
            " them, or a number such as 0 that fixes a gain."
        )
    return {name: gain_bounds(f"Gain {name!r}, bounds", bounds[name]) for name in names}


def gain_bounds(what: str, bounds: object) -> GainBounds:
    """Bounds of one gain.

    Args:
        what: how to call them in an error.
        bounds: (low, high), or (low, high, "log") where decades matter; or the number that it is fixed at.

    Returns:
        The same, as floats.

    Raises:
        InvalidInput: anything else, the wrong way round, or a logarithm of what is not above 0.
    """
    if isinstance(bounds, (int, float, np.integer, np.floating)):
        return number(what, bounds)
    items = tuple(bounds) if isinstance(bounds, Iterable) and not isinstance(bounds, str) else ()
    if len(items) == 3 and items[2] != "log":
        raise InvalidInput(
            f'{what}: expected "log" as the third item, found {items[2]!r}; write "log" or leave it out.'
        )
    if len(items) not in (2, 3):
        raise InvalidInput(
            f'{what}: expected (low, high), (low, high, "log") or a number that fixes it, found {bounds!r}; write'
            " both bounds."
        )
    low, high = ordered(what, items[:2])
    if len(items) == 3 and number(what, low) <= 0.0:
        raise InvalidInput(
            f'{what}: expected low > 0 with "log", found {low:g}; raise it, or leave "log" out.'
        )
    return (low, high, "log") if len(items) == 3 else (low, high)


def gain_units(output: str, state: str) -> tuple[str, str, str]:
    """Units of the gains on an error, on its integral and on its rate.

    Args:
        output: unit of what the controller asks for.
        state: unit of what it controls.

    Returns:
        The three units, such as "N m/rad", "N m/(rad s)" and "N m s/rad"; "1/rad", "1/(rad s)" and "s/rad" of an
        output without a unit.
    """
    top = f"({output})" if "/" in output else output or "1"
    bottom = f"({state})" if "/" in state or " " in state else state or "1"
    over = "s" if top == "1" else f"{top} s"
    if bottom == "1":
        return top, f"{top}/s", over
    return f"{top}/{bottom}", f"{top}/({bottom} s)", f"{over}/{bottom}"
