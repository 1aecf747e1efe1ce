"""Steps of the preset `default`, by which it says what it is doing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

Step = Literal[
    "form",
    "noise",
    "actuators",
    "hidden",
    "terms",
    "evolution",
    "smoothed",
    "parts",
    "disturbances",
    "committee",
    "gains",
    "candidates",
]
"""What it does after each experiment, in order; not all of it after every one."""
STEPS: tuple[Step, ...] = get_args(Step)
Watch = Callable[[Step], None]
"""Called with each step that begins."""


def unwatched(step: Step) -> None:
    """Tells nobody."""
