"""Reading plain values that may come from anywhere: every type is checked, every size is bounded."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput, unknown

MOST_ITEMS = 10_000_000
"""Items of a list, characters of a text: more are refused."""
LARGEST = 1 << 30
"""Bytes of a file that is read."""
NOT_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}
"""Numbers that JSON has no way to write, by the text that stands for them."""


def from_text(text: str, what: str) -> Any:
    """What JSON says, from a source that need not be trusted.

    Args:
        text: JSON.
        what: how to call it in an error.

    Returns:
        Plain values.

    Raises:
        InvalidInput: no JSON, or nested without end.
    """
    try:
        return json.loads(text, parse_constant=_refused)
    except (ValueError, RecursionError) as reason:
        raise InvalidInput(
            f"{what}: expected JSON, found {type(reason).__name__}: {reason}; it is damaged, or none of Twinloop's."
        ) from reason


def _refused(constant: str) -> float:
    raise ValueError(f"{constant}, which JSON does not have")


def text_of(path: Path, what: str) -> str:
    """The text of a file that need not be trusted.

    Args:
        path: of the file.
        what: how to call it in an error.

    Raises:
        InvalidInput: no such file, one that is too large, or one that is no text.
    """
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise InvalidInput(
                f"{what}: expected at most {LARGEST} bytes, found {size}; it is none of Twinloop's."
            )
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as reason:
        raise InvalidInput(f"{what}: expected a file that can be read, found: {reason}.") from reason


def read_array(value: object, where: str) -> Floats:
    """An array of numbers from nested lists.

    Args:
        value: plain, from anywhere.
        where: how to call it in an error.

    Returns:
        The array; its shape is still to be checked.

    Raises:
        InvalidInput: no numbers, or lists of different lengths.
    """
    if isinstance(value, Mapping):
        return _empty(value, where)
    items = read_list(value, where)
    try:
        array = np.array(items)
        if array.dtype.kind not in "if":
            # Texts that stand for numbers, numbers beyond 64 bits, or something else altogether.
            array = np.array(_numbers(items, where, 3))
    except ValueError as reason:
        if isinstance(reason, InvalidInput):
            raise
        raise InvalidInput(f"Record {where}: expected lists of one length each, found others.") from reason
    return np.asarray(array, dtype=np.float64)


def read_list(value: object, where: str) -> list[Any]:
    """A list of bounded length.

    Args:
        value: plain, from anywhere.
        where: how to call it in an error.

    Returns:
        The list.

    Raises:
        InvalidInput: no list, or one that is too long.
    """
    if not isinstance(value, (list, tuple)):
        raise InvalidInput(f"Record {where}: expected a list, found {shown(value)}.")
    if len(value) > MOST_ITEMS:
        raise InvalidInput(f"Record {where}: expected at most {MOST_ITEMS} items, found {len(value)}.")
    return list(value)


def keys(
    value: object, names: tuple[str, ...], where: str, optional: tuple[str, ...] = ()
) -> Mapping[str, Any]:
    """A dict of exactly these keys.

    Args:
        value: plain, from anywhere.
        names: that it must have.
        where: how to call it in an error.
        optional: that it may have.

    Returns:
        The dict.

    Raises:
        InvalidInput: no dict, an unknown key or a missing one.
    """
    if not isinstance(value, Mapping):
        raise InvalidInput(f"Record {where}: expected a dict, found {shown(value)}.")
    for key in value:
        if key not in names + optional:
            raise unknown(f"key in the record {where}", str(key)[:60], names + optional)
    missing = [key for key in names if key not in value]
    if missing:
        raise InvalidInput(f"Record {where}: expected {', '.join(missing)}, found none; add them.")
    return value


def read_number(value: object, where: str) -> float:
    """A number, or the text that stands for one that is not finite."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            pass
    if isinstance(value, str) and value in NOT_FINITE:
        return NOT_FINITE[value]
    raise InvalidInput(f"Record {where}: expected a number, found {shown(value)}.")


def read_whole(value: object, where: str) -> int:
    """A whole number."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**64:
        return value
    raise InvalidInput(f"Record {where}: expected a whole number, found {shown(value)}.")


def read_text(value: object, where: str) -> str:
    """A text of bounded length."""
    if not isinstance(value, str):
        raise InvalidInput(f"Record {where}: expected a text, found {shown(value)}.")
    if len(value) > MOST_ITEMS:
        raise InvalidInput(f"Record {where}: expected at most {MOST_ITEMS} characters, found {len(value)}.")
    return value


def read_flag(value: object, where: str) -> bool:
    """True or false."""
    if isinstance(value, bool):
        return value
    raise InvalidInput(f"Record {where}: expected true or false, found {shown(value)}.")


def shown(value: object) -> str:
    """Something from elsewhere, short enough for a message."""
    if isinstance(value, int) and abs(value) >= 2**64:
        return "a number beyond 64 bits"
    text = repr(value) if isinstance(value, (int, float, str, type(None))) else type(value).__name__
    return text if len(text) <= 60 else f"{text[:60]}…"


def _empty(value: Mapping[Any, Any], where: str) -> Floats:
    shape = value.get("shape")
    sizes = shape if isinstance(shape, list) and len(shape) <= 3 else [1]
    whole = all(isinstance(n, int) and not isinstance(n, bool) and 0 <= n <= MOST_ITEMS for n in sizes)
    if set(value) != {"shape"} or not whole or 0 not in sizes:
        raise InvalidInput(
            f"Record {where}: expected nested lists of numbers, or the shape of an empty array, found a dict."
        )
    return np.zeros(sizes)


def _numbers(value: object, where: str, depth: int) -> Any:
    if isinstance(value, (list, tuple)):
        if depth == 0:
            raise InvalidInput(f"Record {where}: expected lists nested at most 3 deep, found more.")
        return [_numbers(item, where, depth - 1) for item in value]
    return read_number(value, where)
