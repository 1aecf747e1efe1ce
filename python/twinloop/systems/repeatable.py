"""Built-in systems can be written down: what they were made with, and how many runs they have made."""

from __future__ import annotations

import inspect
from typing import TypeVar

from twinloop._ground.arrays import whole
from twinloop.records import Recorded, checked_record

Built = TypeVar("Built", bound="Repeatable")


class Repeatable(Recorded):
    """A system whose next run depends on its arguments and on the number of its runs, `runs`, and on nothing else.

    Its arguments are attributes of the same names.
    """

    runs: int

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has: the arguments, then `runs`."""
        return *(name for name in inspect.signature(cls).parameters), "runs"

    @classmethod
    def _read(cls: type[Built], record: object, where: str, given: tuple[object, ...]) -> Built:
        found = checked_record(record, cls, cls.recorded_fields(), where)
        runs = whole(f"Record {where}.runs", found.pop("runs"))
        system = cls(**found)
        system.runs = runs
        return system
