"""Units of a face: degrees instead of radians."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from twinloop.planning.quality import quality_unit

if TYPE_CHECKING:
    from twinloop.campaign.examination.examination import Examination


def shown_unit(unit: str) -> tuple[float, str]:
    """The unit of a face: degrees instead of radians.

    Args:
        unit: of a signal.

    Returns:
        What to multiply with, and the unit that is shown.
    """
    if unit == "rad" or unit.startswith("rad/"):
        return 180.0 / math.pi, "°" + unit[3:]
    return 1.0, unit or "1"


def words(name: str) -> str:
    """The name of a signal with spaces."""
    return name.replace("_", " ")


def labelled(name: str, unit: str) -> tuple[float, str]:
    """What to multiply with, and a name with its shown unit."""
    factor, shown = shown_unit(unit)
    return factor, f"{words(name)} ({shown})"


def quality_label(found: Examination) -> str:
    """The quality with its unit, where it has one."""
    unit = quality_unit(found.setup.quality)
    return f"quality ({unit})" if unit else "quality"


def said(number: int | None) -> str:
    """What a flight is called."""
    return "log" if number is None else f"test {number}"


def in_words(number: int | None) -> str:
    """What a flight is called in a sentence."""
    return "a log" if number is None else said(number)
