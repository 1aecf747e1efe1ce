"""The plain form of values: numbers, texts, lists and dicts that JSON holds without loss."""

from twinloop.records.differing import check_same, differences
from twinloop.records.reading import from_text
from twinloop.records.recorded import (
    KINDS,
    Record,
    Recorded,
    beside,
    checked_record,
    plain,
    read,
    to_text,
    with_names,
)

__all__ = [
    "KINDS",
    "Record",
    "Recorded",
    "beside",
    "check_same",
    "checked_record",
    "differences",
    "from_text",
    "plain",
    "read",
    "to_text",
    "with_names",
]
