"""Poles as an engineer reads them: natural frequency, damping and time constant."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

FAR = 1e-3
"""Poles of discrete time nearer to 0 than this are memories of which a thousandth is left after a period, at most: what
is over within one has no rate that anybody could see."""
ROUNDING = 1e-9
"""Of the fastest pole, or of 1 / dt: what is smaller is rounding, in whatever unit time is."""


@dataclass(frozen=True)
class Pole:
    """A pole s, or a pair of poles; its motion is exp(s t).

    Args:
        real: of s, 1/s.
        imaginary: of s, rad/s, 0 or more.
        frequency: |s|, rad/s.
        damping: −real / |s|; 1 without oscillation, −1 if it grows without oscillation.
        time: time constant, s; infinite without decay, negative if the motion grows.
    """

    real: float
    imaginary: float
    frequency: float
    damping: float
    time: float


def poles(values: np.ndarray, dt: float | None = None) -> tuple[Pole, ...]:
    """Poles in the order of their speed, one for each conjugate pair.

    Args:
        values: eigenvalues (n,).
        dt: period, s, where they are those of discrete time.
    """
    rates = np.asarray(values, dtype=complex)
    if dt is not None:
        rates = np.log(rates[np.abs(rates) >= FAR]) / dt
    fastest = np.abs(rates).max(initial=0.0) if dt is None else 1.0 / dt
    found = []
    for value in rates:
        size = float(abs(value))
        still = size <= ROUNDING * fastest
        if value.imag < -ROUNDING * (fastest if still else size):
            continue
        found.append(
            Pole(
                float(value.real),
                float(max(0.0, value.imag)),
                size,
                1.0 if still else float(-value.real) / size,
                math.inf if still or value.real == 0.0 else -1.0 / float(value.real),
            )
        )
    return tuple(sorted(found, key=lambda pole: pole.frequency))
