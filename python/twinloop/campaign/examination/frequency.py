"""Frequency responses as the flights show them, with their coherence (Bendat and Piersol 2010, chapter 7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats

MOST = 128
"""Periods of a segment at most."""
BELIEVED = 0.6
"""Smallest coherence of a response that is accepted."""
FEWEST = 16
"""Periods that a segment must have."""


@dataclass(frozen=True, eq=False)
class Responses:
    """Frequency responses from inputs to outputs.

    Args:
        frequencies: (f,), rad/s.
        gains: complex (f, outputs, inputs).
        coherence: share of each output that all inputs together explain (f, outputs), minus the value that the same
            number of segments gives by chance, and at most the share that is not sensor noise.
        needed: smallest coherence of a response that is accepted: 0.6 (Tischler and Remple 2012, section 7.5), or the
            value that chance exceeds once in a hundred times.
    """

    frequencies: Floats
    gains: np.ndarray
    coherence: Floats
    needed: float


def frequency_responses(
    inputs: Sequence[Floats], outputs: Sequence[Floats], dt: float, sensors: Floats | None = None
) -> Responses | None:
    """Least squares over segments of all flights: gains that explain the outputs best (H1).

    In closed loop the sensors' noise is fed back to the inputs: where it is most of what is read, the gains are those
    of the controller's inverse, with a coherence that is high. What is known to be noise is thus held against it.

    Args:
        inputs: (n, m) of each flight.
        outputs: (n, p) of each, in the same periods.
        dt: period, s.
        sensors: standard deviation of each output's noise (p,); None where it is not known.

    Returns:
        The responses; None where flights are too short for more segments than there are inputs.
    """
    length = min((len(x) for x in inputs), default=0)
    size = min(MOST, length // 4 * 2)
    if size < FEWEST:
        return None
    window = np.hanning(size + 1)[:size, np.newaxis]
    rows: list[tuple[np.ndarray, np.ndarray]] = []
    for u, y in zip(inputs, outputs, strict=True):
        for first in range(0, len(u) - size + 1, size // 2):
            parts = (values[first : first + size] for values in (u, y))
            found = [np.fft.rfft(window * (part - part.mean(axis=0)), axis=0) for part in parts]
            rows.append((found[0], found[1]))
    count, width = len(rows), inputs[0].shape[1]
    if count < width + 2:
        return None
    given, seen = (np.stack([row[i] for row in rows], axis=1) for i in (0, 1))  # (f, segments, columns)
    given, seen = given[1:-1], seen[1:-1]
    gains = np.linalg.pinv(given, rcond=1e-6) @ seen
    residual = np.square(np.abs(seen - given @ gains)).sum(axis=1)
    total = np.square(np.abs(seen)).sum(axis=1)
    unexplained = np.divide(residual, total, out=np.ones_like(total), where=total > 0.0)
    # As many inputs explain their share of any segments: degrees of freedom are put right.
    coherence = np.clip(1.0 - unexplained * count / (count - width), 0.0, 1.0)
    if sensors is not None:
        noise = np.square(sensors) * float(np.square(window).sum()) * count
        share = np.divide(noise, total, out=np.ones_like(total), where=total > 0.0)
        coherence = np.minimum(coherence, np.clip(1.0 - share, 0.0, 1.0))
    # The share that is left of noise alone is beta distributed: below its 1 % point it is more than chance.
    needed = max(BELIEVED, 1.0 - 0.01 ** (1.0 / max(1, count - width)))
    frequencies = np.asarray(2.0 * np.pi * np.fft.rfftfreq(size, dt)[1:-1], dtype=np.float64)
    return Responses(frequencies, np.swapaxes(gains, 1, 2), coherence, needed)
