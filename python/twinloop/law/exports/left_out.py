"""Left out: what an exported law leaves to whoever uses it: how hidden states begin, what is sent and what is read."""

from __future__ import annotations

from twinloop.law.law import Law
from twinloop.law.levels import in_words as levels_in_words
from twinloop.law.reports import in_words as reports_in_words


def left_out(law: Law) -> list[str]:
    """A line for each hidden state that is one of the states, command in levels, and state not given as it is read.

    Args:
        law: that is exported.
    """
    lines = levels_in_words(law.levels, law.signals) + reports_in_words(law.reports, law.signals)
    return [*law.begins, *(f"{line}: not done here" for line in lines)]
