"""Seeds of many campaigns, as they are typed: a range or one of them."""

from __future__ import annotations

from twinloop.errors import InvalidInput


def seeds_of(text: str) -> range:
    """The seeds of a range that is typed.

    Args:
        text: FIRST:LAST+1, or one seed.

    Raises:
        InvalidInput: no such range, or one without a seed.
    """
    first, colon, last = text.partition(":")
    if first.isdecimal() and (last.isdecimal() or not colon):
        found = range(int(first), int(last) if colon else int(first) + 1)
        if found:
            return found
    raise InvalidInput(f"--seeds: expected FIRST:LAST+1 or one seed, found {text!r}; such as --seeds 10:35.")
