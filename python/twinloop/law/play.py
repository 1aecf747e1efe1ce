"""A gap before a mass: what presses on it by the twist of what drives it, as the engine has it."""

from __future__ import annotations

from typing import Any

import numpy as np

FIRM = 100.0
"""By how much what presses stiffens where it just touches, so that nothing jumps."""


def press(twist: Any, rate: Any, gap: Any, damping: Any) -> Any:
    """What presses on either side of a gap: a spring and a damper that never pull.

    Args:
        twist: of what drives against the mass, numbers or arrays.
        rate: at which it changes.
        gap: half of it, in units of the twist.
        damping: over the stiffness, s.
    """
    beyond = np.abs(twist) - gap
    pressed = np.maximum(
        0.0, np.minimum(FIRM * beyond, beyond + damping * np.where(twist < 0.0, -rate, rate))
    )
    return np.where(twist < 0.0, -pressed, pressed)
