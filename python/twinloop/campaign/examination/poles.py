"""Poles as an engineer reads them: natural frequency, damping and time constant."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

FAR = 1e-9
"""Poles of discrete time nearer to 0 than this are memories that are gone after a period: they have no rate."""


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
    found = []
    for value in np.asarray(values, dtype=complex):
        if dt is not None:
            if abs(value) < FAR:
                continue
            value = np.log(value) / dt
        if value.imag < -1e-9 * max(1.0, abs(value)):
            continue
        size = float(abs(value))
        still = size < 1e-9
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
