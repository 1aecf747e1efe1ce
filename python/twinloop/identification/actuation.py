"""What stands between commands and a model: actuators that lag, and hidden states that commands fill."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.signals import Signals

Actuator = tuple[float, int, "float | None"]
"""(lag in s, delay in periods, command whose effect is there at the start or None for the first)."""
Hidden = tuple[Sequence[int], bool, "float | None", float]
"""(commands that fill it, whether with their squares, their mean at rest or None for the first, time in s)."""


@dataclass(frozen=True)
class Actuation:
    """What a model sees of commands: their effects, then the states that they fill.

    Args:
        actuators: one a command.
        hidden: states h with dh/dt = mean over their commands, or their squares, − the mean at rest − h / time.
    """

    actuators: tuple[Actuator, ...]
    hidden: tuple[Hidden, ...] = ()

    @staticmethod
    def direct(signals: Signals) -> Actuation:
        """Commands that act at once."""
        return Actuation(((0.0, 0, None),) * signals.n_u)

    @staticmethod
    def of(model: _core.Model, signals: Signals) -> Actuation:
        """That of a model, with an actuator for each command even where all act at once."""
        if not model.actuators:
            return Actuation.direct(signals)
        return Actuation(tuple(model.actuators), tuple(model.hidden))

    def effects(self, signals: Signals, commands: Floats) -> list[Floats]:
        """What arrives of commands (n, n_u), then hidden states, at the start, middle and end of each period."""
        scales = np.array([command.size for command in signals.commands])
        return _core.command_effects(self.actuators, self.hidden, scales, signals.dt, commands)

    def bare(self) -> Actuation:
        """The same without hidden states."""
        return replace(self, hidden=())


def groups(signals: Signals) -> list[list[int]]:
    """Commands that are alike, by unit and bounds; they share a lag and a delay, and fill hidden states together."""
    found: dict[tuple[object, ...], list[int]] = {}
    for i, command in enumerate(signals.commands):
        found.setdefault((command.unit, command.bounds, command.size), []).append(i)
    return list(found.values())
