"""Times of machines, for a person: an actuator acts within milliseconds, a column of a plant within hours."""

from __future__ import annotations

import math
from collections.abc import Iterable

UNITS = ((3600.0, "h", 7200.0), (60.0, "min", 600.0), (1.0, "s", 1.0))
"""Seconds in a unit, its name, and the seconds from which on it is used; below these milliseconds are."""


def time_unit(seconds: Iterable[float]) -> tuple[float, str]:
    """A unit for times that stand in one column: that of the longest finite one.

    Args:
        seconds: s, of either sign.

    Returns:
        By what seconds are multiplied, and the unit's name.
    """
    longest = max((abs(each) for each in seconds if math.isfinite(each)), default=0.0)
    for length, name, least in UNITS:
        if longest >= least:
            return 1.0 / length, name
    return 1e3, "ms"


def moment(t: float, apart: float) -> str:
    """A time in a log, which may count from 1970, with digits enough to find its row.

    Args:
        t: s.
        apart: how far it is from the time that it must not be taken for, s; 0: there is none, and it is shown to a
            tenth of a microsecond.

    Returns:
        Such as "1.45", or "1700000000.02": six digits, or as many as tell a tenth of `apart`.
    """
    for digits in range(6, 18):
        shown = f"{t:.{digits}g}"
        if "e+" not in shown and abs(float(shown) - t) <= 0.1 * (apart or 1e-6):
            return shown
    return f"{t:g}"


def shown_time(seconds: float, digits: int = 3) -> str:
    """A time in the unit that suits it.

    Args:
        seconds: s, of either sign.
        digits: that count.

    Returns:
        Such as "12.5 ms", "40.1 s" or "25 min"; in hours from two of them on.
    """
    factor, unit = time_unit([seconds])
    number = factor * seconds
    whole = abs(number) >= 10.0 ** (digits - 1)
    return f"{number:.0f} {unit}" if whole else f"{number:.{digits}g} {unit}"
