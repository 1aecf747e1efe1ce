"""Names and units as a face shows them: in the units that are declared, as equations, tables and texts are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twinloop.planning.quality import quality_unit

if TYPE_CHECKING:
    from twinloop.campaign.examination.examination import Examination

MOST = 28
"""Letters of a flight's name in a title."""


def words(name: str) -> str:
    """The name of a signal with spaces."""
    return name.replace("_", " ")


def shortened(name: str) -> str:
    """What a flight is called, as far as the title of a panel has room for it: files differ at their end."""
    return name if len(name) <= MOST else f"…{name[1 - MOST :]}"


def labelled(name: str, unit: str) -> str:
    """A name with its unit."""
    return f"{words(name)} ({unit or '1'})"


def quality_label(found: Examination) -> str:
    """The quality with its unit, where it has one."""
    unit = quality_unit(found.setup.quality)
    return f"quality ({unit})" if unit else "quality"
