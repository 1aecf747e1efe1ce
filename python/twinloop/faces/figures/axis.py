"""One axis: its ends, its ticks, and where a value stands on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats

ROOM = 0.06
"""Share of an axis that is left free on either side of what is drawn."""
DECADES = 12.0
"""Of a logarithmic axis at most, counted from above."""


@dataclass(frozen=True)
class Axis:
    """One axis.

    Args:
        low: its lower end, in the data's unit.
        high: its upper end.
        log: whether it is logarithmic.
        length: in units of the drawing.
        ticks: values that are marked, with their texts.
    """

    low: float
    high: float
    log: bool
    length: float
    ticks: tuple[tuple[float, str], ...]

    def place(self, values: Floats) -> Floats:
        """Where values stand, from 0 at the lower end to `length`; not finite where they cannot be shown."""
        low, high = self._moved(np.array([self.low, self.high]))
        moved = self._moved(np.asarray(values, dtype=np.float64))
        return np.asarray((moved - low) / (high - low) * self.length, dtype=np.float64)

    def _moved(self, values: Floats) -> Floats:
        if not self.log:
            return values
        # What is 0 or below stands far under the axis, where it is clipped.
        return np.log10(np.maximum(values, 1e-300))


def axis(
    values: Sequence[Floats],
    length: float,
    log: bool = False,
    ends: tuple[float, float] | None = None,
    names: Sequence[str] = (),
    whole: bool = False,
    count: int = 4,
) -> Axis:
    """An axis for values.

    Args:
        values: that it should show.
        length: of it, in units of the drawing.
        log: whether it is logarithmic.
        ends: that it has; None: those of the values with some room.
        names: of 0, 1, 2 and so on, instead of numbers.
        whole: whether it counts.
        count: of ticks, about.
    """
    if names:
        ticks = tuple((float(i), name) for i, name in enumerate(names))
        return Axis(-0.5, len(names) - 0.5, False, length, ticks)
    low, high = _ends(values, log) if ends is None or not ends[0] < ends[1] else ends
    if log:
        return Axis(low, high, True, length, _decades(low, high))
    return Axis(low, high, False, length, _even(low, high, count, whole))


def _ends(values: Sequence[Floats], log: bool) -> tuple[float, float]:
    every = np.concatenate([np.ravel(each) for each in values]) if values else np.zeros(0)
    every = every[np.isfinite(every) & ((every > 0.0) if log else True)]
    if every.size == 0:
        return (0.1, 10.0) if log else (0.0, 1.0)
    low, high = float(every.min()), float(every.max())
    if log:
        low = max(low, high * 10.0**-DECADES)
        room = (high / low) ** ROOM if high > low else 3.0
        return low / room, high * room
    room = ROOM * (high - low) if high > low else max(0.5 * abs(high), 0.5)
    return low - room, high + room


def _even(low: float, high: float, count: int, whole: bool) -> tuple[tuple[float, str], ...]:
    rough = (high - low) / max(1, count)
    size = 10.0 ** math.floor(math.log10(rough)) if rough > 0.0 else 1.0
    step = next((m * size for m in (1.0, 2.0, 5.0, 10.0) if m * size >= rough * 0.999), 10.0 * size)
    step = max(1.0, step) if whole else step
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple((k * step, shown(k * step, step)) for k in range(first, min(last, first + 20) + 1))


def _decades(low: float, high: float) -> tuple[tuple[float, str], ...]:
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    if last - first >= 2:
        skip = max(1, -(-(last - first + 1) // 5))
        return tuple((10.0**k, shown(10.0**k, 10.0**k)) for k in range(first, last + 1, skip))
    base = math.floor(math.log10(low))
    fine = [m * 10.0**k for k in range(base, base + 4) for m in (1, 2, 5) if low <= m * 10.0**k <= high]
    return tuple((value, shown(value, value)) for value in fine)


def shown(value: float, step: float) -> str:
    """A number of an axis, with as many digits as its step asks for."""
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if size >= 5 or size < -3:
        mantissa = value / 10.0**size
        exponent = str(size).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        front = "" if abs(mantissa - 1.0) < 1e-9 else f"{mantissa:.3g}·"
        return f"{front}10{exponent}".replace("-", "−")
    digits = max(0, -math.floor(math.log10(abs(step)) + 1e-9))
    return f"{value:.{digits}f}".replace("-", "−")
