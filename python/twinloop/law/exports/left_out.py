"""Left out: what a twin's flights do that an exported law leaves to whoever closes the loop around it."""

from __future__ import annotations

from twinloop.law.law import Law
from twinloop.law.levels import in_words as levels_in_words
from twinloop.law.reports import in_words as reports_in_words


def left_out(law: Law) -> list[str]:
    """A line for each command that is sent in levels, and for each state that is not given as it is read.

    Args:
        law: that is exported.
    """
    lines = levels_in_words(law.levels, law.signals) + reports_in_words(law.reports, law.signals)
    return [f"{line}: not done here" for line in lines]
