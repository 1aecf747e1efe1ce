"""Bounds and units of gains, as every family of controllers takes and tells them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from twinloop.arrays import number
from twinloop.errors import InvalidInput, unknown
from twinloop.signals import ordered

GainBounds = tuple[float, float] | tuple[float, float, str]


def bounds_by_name(family: str, bounds: object, names: Sequence[str]) -> dict[str, GainBounds]:
    """Bounds of all gains of a family.

    Args:
        family: how to call it in an error.
        bounds: (low, high) or (low, high, "log") by name.
        names: of the gains, in the order of the genes.

    Returns:
        Checked bounds by name, in the order of the genes.

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
            " them."
        )
    return {name: gain_bounds(f"Gain {name!r}, bounds", bounds[name]) for name in names}


def gain_bounds(what: str, bounds: object) -> GainBounds:
    """Bounds of one gain.

    Args:
        what: how to call them in an error.
        bounds: (low, high), or (low, high, "log") where decades matter.

    Returns:
        The same, as floats.

    Raises:
        InvalidInput: anything else, the wrong way round, or a logarithm of what is not above 0.
    """
    items = tuple(bounds) if isinstance(bounds, Iterable) and not isinstance(bounds, str) else ()
    if len(items) == 3 and items[2] != "log":
        raise InvalidInput(
            f'{what}: expected "log" as the third item, found {items[2]!r}; write "log" or leave it out.'
        )
    if len(items) not in (2, 3):
        raise InvalidInput(
            f'{what}: expected (low, high) or (low, high, "log"), found {bounds!r}; write both numbers.'
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
        The three units, such as "N m/rad", "N m/(rad s)" and "N m s/rad".
    """
    top = f"({output})" if "/" in output else output or "1"
    bottom = f"({state})" if "/" in state or " " in state else state or "1"
    return f"{top}/{bottom}", f"{top}/({bottom} s)", f"{top} s/{bottom}"
