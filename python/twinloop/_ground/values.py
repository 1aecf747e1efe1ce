"""Values that never change: a copy of one is the value itself."""

from __future__ import annotations

from typing import TypeVar

Same = TypeVar("Same", bound="Value")


class Value:
    """Something that never changes once it is made, so that two holders of it need no copy.

    What it has in the native engine could not be copied either.
    """

    def __copy__(self: Same) -> Same:
        return self

    def __deepcopy__(self: Same, memo: dict[int, object]) -> Same:
        return self
