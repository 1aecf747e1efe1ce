"""Whether a flight comes to its target, and which commands have nothing left at its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import in_unit
from twinloop.campaign.examination.use import AT_A_BOUND
from twinloop.signals import Command, Signals, State
from twinloop.trajectory import Trajectory

END = 0.1
"""Share of a flight, its last one, over which its end is averaged."""
REACHED = 0.1
"""Share of the way to the target, or of the scale of a state that has none, within which a state has come there."""
NOISE = 3.0
"""Standard deviations of its sensor that are no distance."""


@dataclass(frozen=True)
class Miss:
    """A state that does not come to its target.

    Args:
        state: that counts in the quality.
        target: where it should end, in its unit.
        off: how far from there it ends, in its unit.
        share: the same over the way from its start, or over its scale where it starts at its target.
    """

    state: State
    target: float
    off: float
    share: float

    def __str__(self) -> str:
        off, target = (in_unit(text, self.state.unit) for text in (f"{self.off:.3g}", f"{self.target:.4g}"))
        return f"{off} from {self.state.name}'s target of {target}"


@dataclass(frozen=True)
class Ending:
    """The end of a flight.

    Args:
        misses: states that do not come to their targets.
        held: commands at a bound to the end, each with that bound.
    """

    misses: tuple[Miss, ...]
    held: tuple[tuple[Command, float], ...]

    def __str__(self) -> str:
        """Where it ends, if that is not at the target; else empty."""
        if not self.misses:
            return ""
        held = [
            f"{command.name} at its bound of {in_unit(f'{bound:.4g}', command.unit)}"
            for command, bound in self.held
        ]
        return f"It ends {', '.join(map(str, self.misses))}{', with ' * bool(held)}{', '.join(held)}."


def ending(
    flight: Trajectory,
    signals: Signals,
    start: Floats,
    target: Floats,
    weights: Floats,
    sensors: Floats | None,
) -> Ending:
    """The end of a flight that was flown, or predicted, as long as it was planned.

    Args:
        flight: without excitation.
        signals: of the system.
        start: where it begins (n_x,).
        target: where it should end (n_x,).
        weights: of the states in the quality (n_x,); one without any may end where it likes.
        sensors: standard deviation of each reading (n_x,); None: unknown.
    """
    last = max(1, round(END * flight.steps))
    off = np.abs(signals.difference(flight.states[-last:], target).mean(axis=0))
    ways = np.abs(signals.difference(target, start))
    scales = np.array([state.scale for state in signals.states])
    shares = off / np.where(ways > 1e-3 * scales, ways, scales)
    noise = np.zeros(signals.n_x) if sensors is None else NOISE * sensors
    misses = tuple(
        Miss(signals.states[i], float(target[i]), float(off[i]), float(shares[i]))
        for i in np.flatnonzero((weights != 0.0) & (shares > REACHED) & (off > noise)).tolist()
    )
    return Ending(misses, _held(flight.commands[-last:], signals.commands))


def _held(sent: Floats, commands: Sequence[Command]) -> tuple[tuple[Command, float], ...]:
    found = []
    for command, values in zip(commands, sent.T, strict=True):
        low, high = command.bounds
        for bound in command.bounds:
            if (np.abs(values - bound) <= AT_A_BOUND * (high - low)).all():
                found.append((command, bound))
    return tuple(found)
