"""Excitation: a gentle chirp on every command that fades out, so that a flight tells more than its task."""

from __future__ import annotations

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.elementary import sin
from twinloop.signals import Signals

SLOWEST, FASTEST = (0.5, 2.0), (4.0, 10.0)
"""Cycles per flight at which a chirp begins and ends, the range that is drawn from."""
SHORTEST = 8.0
"""Periods of a cycle at least: faster ones look like noise to a model in steps."""


def chirps(signals: Signals, steps: int, amplitude: float, fade: float, stream: _core.Stream) -> Floats:
    """A chirp for each command.

    Args:
        signals: of the system.
        steps: of the test.
        amplitude: in units of each command's scale.
        fade: share of the flight, at its end, over which the chirps fade to nothing.
        stream: of random numbers.

    Returns:
        What is to be added to the commands (steps, n_u), in their units.
    """
    duration = steps * signals.dt
    t = signals.dt * np.arange(steps)
    fading = _fading(signals, steps, fade)
    columns = []
    for command in signals.commands:
        first = stream.uniform(*SLOWEST) / duration
        last = min(stream.uniform(*FASTEST) / duration, 1.0 / (SHORTEST * signals.dt))
        phase = stream.uniform(0.0, 2.0 * np.pi)
        angle = 2.0 * np.pi * (first * t + (last - first) * t * t / (2.0 * duration)) + phase
        columns.append(amplitude * command.size * sin(angle) * fading)
    return np.stack(columns, axis=1)


def binary(signals: Signals, steps: int, amplitude: float, fade: float, stream: _core.Stream) -> Floats:
    """A pseudo-random binary sequence for each command, faded likewise: a baseline for tests.

    Args:
        signals: of the system.
        steps: of the test.
        amplitude: in units of each command's scale.
        fade: share of the flight, at its end, over which the sequences fade to nothing.
        stream: of random numbers.

    Returns:
        What is to be added to the commands (steps, n_u), in their units.
    """
    held = max(1, steps // 20)
    signs = np.where(stream.uniforms(steps // held + 1, signals.n_u) < 0.5, -1.0, 1.0)
    sizes = np.array([command.size for command in signals.commands])
    fading = _fading(signals, steps, fade)[:, np.newaxis]
    added: Floats = amplitude * sizes * np.repeat(signs, held, axis=0)[:steps] * fading
    return added


def _fading(signals: Signals, steps: int, fade: float) -> Floats:
    """1, and towards the end of a flight down to 0 over a share of it (steps,)."""
    duration = steps * signals.dt
    left = duration - signals.dt * np.arange(steps)
    return np.clip(left / max(fade * duration, signals.dt), 0.0, 1.0)
