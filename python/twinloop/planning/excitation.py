"""Excitation: a gentle chirp on every command that fades out, so that a flight tells more than its task.

That of a first flight is sized by its controller, the only thing that is known then, and grows from nothing.
"""

from __future__ import annotations

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import sin
from twinloop.controllers import Family
from twinloop.signals import Signals

SLOWEST, FASTEST = (0.5, 2.0), (4.0, 10.0)
"""Cycles per flight at which a chirp begins and ends, the range that is drawn from."""
SHORTEST = 8.0
"""Periods of a cycle at least: faster ones look like noise to a model in steps."""
SHARE = 0.15
"""Share of the envelope that a state must be off for a controller to answer a first flight's largest excitation."""
FIRST = (2.0, 4.0)
"""Cycles per flight at which a first flight's chirps begin: slower ones are where loops resonate."""
GROWTH = 0.25
"""Share of a first flight, at its beginning, over which its excitation grows from nothing."""
NEARBY = 1.0 / 1024.0
"""Share of the envelope by which a state is off where the answer of a controller is asked for: a power of two."""
UNUSED = 1e-6
"""Share of the strongest direction in command space, squared, below which a controller has no use for one."""


def first_chirps(
    family: Family,
    genes: Floats,
    target: Floats,
    steps: int,
    amplitude: float,
    fade: float,
    stream: _core.Stream,
) -> Floats:
    """Chirps for a first flight: only the controller is known.

    A controller that one trusts is made for the authority of its commands: ten times the authority, a tenth of the
    gain. So the size is measured by what the controller itself would do: whatever the phases of the chirps are, it
    would send the same commands for states that are off by at most `SHARE` of their envelopes.

    Args:
        family: of the controllers.
        genes: of the one that flies (size,).
        target: that it leads to (n_x,).
        steps: of the test.
        amplitude: at most, in units of each command's scale.
        fade: share of the flight, at its end, over which the chirps fade to nothing.
        stream: of random numbers.

    Returns:
        What is to be added to the commands (steps, n_u), in their units.
    """
    off = answered(family, genes, target)
    held = amplitude if off * amplitude <= SHARE else SHARE / off
    growing = np.minimum(1.0, np.arange(steps) / max(GROWTH * steps, 1.0))
    return chirps(family.signals, steps, held, fade, stream, FIRST) * growing[:, np.newaxis]


def answered(family: Family, genes: Floats, target: Floats) -> float:
    """For how large an error a controller would send an excitation of one scale on every command.

    Args:
        family: of the controllers.
        genes: of one of them (size,).
        target: around which it is asked (n_x,).

    Returns:
        The largest share of the envelope (of the scale, where a state has none) by which a state is off, over all signs
        of the commands; of all errors that it answers so, the smallest. 0 where it answers no error at all.
    """
    sent = slopes(family, genes, target)
    products = (sent[:, np.newaxis, :] * sent[np.newaxis, :, :]).sum(axis=2)
    values, vectors = _core.eigen(products)
    used = values > UNUSED * values[-1] if values[-1] > 0.0 else np.zeros(len(values), bool)
    # Pseudo-inverse: sentᵀ (sent sentᵀ)⁺, and the sum of each row's magnitudes.
    inverse = np.zeros_like(sent.T)
    for value, vector in zip(values[used], vectors[used], strict=True):
        along = (sent * vector[:, np.newaxis]).sum(axis=0) / value
        inverse += along[:, np.newaxis] * vector[np.newaxis, :]
    return float(np.abs(inverse).sum(axis=1).max())


def slopes(family: Family, genes: Floats, target: Floats) -> Floats:
    """What a controller at rest sends for an error (n_u, n_x), in scales of the commands for shares of the envelope."""
    columns = []
    scales = np.array([command.size for command in family.signals.commands])
    for i, state in enumerate(family.signals.states):
        half = state.scale if state.envelope is None else 0.5 * (state.envelope[1] - state.envelope[0])
        answers = []
        for sign in (1.0, -1.0):
            reading = target.copy()
            reading[i] += sign * NEARBY * half
            answers.append(family.controller(genes).command(reading, target))
        columns.append((answers[0] - answers[1]) / (2.0 * NEARBY * scales))
    return np.stack(columns, axis=1)


def chirps(
    signals: Signals,
    steps: int,
    amplitude: float,
    fade: float,
    stream: _core.Stream,
    slowest: tuple[float, float] = SLOWEST,
) -> Floats:
    """A chirp for each command.

    Args:
        signals: of the system.
        steps: of the test.
        amplitude: in units of each command's scale.
        fade: share of the flight, at its end, over which the chirps fade to nothing.
        stream: of random numbers.
        slowest: cycles per flight at which it begins, the range that is drawn from.

    Returns:
        What is to be added to the commands (steps, n_u), in their units.
    """
    duration = steps * signals.dt
    t = signals.dt * np.arange(steps)
    fading = _fading(signals, steps, fade)
    columns = []
    for command in signals.commands:
        first = stream.uniform(*slowest) / duration
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
