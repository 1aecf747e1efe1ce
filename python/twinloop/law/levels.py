"""Levels: commands that a machine sends in a few values only, as a relay or an on-off valve does."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats
from twinloop.signals import Signals

Levels = tuple[tuple[float, ...], ...]
"""Values in which each command is sent, rising; none of one that is sent as it is. Empty where all are."""


def nearest(values: ArrayLike, commands: Floats) -> Floats:
    """The level that is nearest to each of one command's values (n,), half-way between two of them the lower one."""
    levels = np.asarray(values, dtype=np.float64)
    return levels[np.searchsorted(0.5 * (levels[1:] + levels[:-1]), commands)]


def in_words(levels: Levels, signals: Signals) -> list[str]:
    """What is said of each command that is sent in levels.

    Args:
        levels: of a law.
        signals: of the system.
    """
    lines = []
    for command, values in zip(signals.commands, levels, strict=False):
        if values:
            *others, last = (f"{value:.6g}" for value in values)
            lines.append(f"{command.name} is sent as {', '.join(others)} or {last}, whichever is nearest")
    return lines
