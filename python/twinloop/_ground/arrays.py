"""The one door through which numbers come in: float64, C order, finite, copied, read-only."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twinloop.errors import InvalidInput

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def floats(what: str, values: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """Numbers that can be trusted from here on.

    Args:
        what: how to call them in an error, such as "Trajectory.states".
        values: the numbers.
        shape: the expected shape; None where any length will do.

    Returns:
        A read-only copy, float64, C order.

    Raises:
        InvalidInput: they are not real numbers, have another shape or gaps, or are not all finite.
    """
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        gaps = int(np.sum(np.ma.getmaskarray(values)))
        raise InvalidInput(
            f"{what}: expected numbers without gaps, found a masked array that hides {gaps} of them; cut the data"
            " before the gap, or fill it and pass a plain array."
        )
    try:
        raw = np.asarray(values)
        if raw.dtype.kind not in "iufb":
            raise TypeError(f"numbers of type {raw.dtype}")
        array = np.array(raw, dtype=np.float64, order="C")
    except (TypeError, ValueError) as reason:
        raise InvalidInput(
            f"{what}: expected real numbers, found {reason}; pass an array of floats."
        ) from reason
    if array.ndim != len(shape) or any(
        n is not None and n != m for n, m in zip(shape, array.shape, strict=True)
    ):
        expected = (
            "("
            + ", ".join("any" if n is None else str(n) for n in shape)
            + ("," if len(shape) == 1 else "")
            + ")"
        )
        raise InvalidInput(
            f"{what}: expected the shape {expected}, found {array.shape}; check the order of the axes."
        )
    if not np.isfinite(array).all():
        where = [int(i) for i in np.argwhere(~np.isfinite(array))[0]]
        raise InvalidInput(
            f"{what}: expected finite numbers, found {array[tuple(where)]} at index {where}; "
            "remove it, or cut the data before it."
        )
    array.flags.writeable = False
    return array


def number(what: str, value: object, *, above: float | None = None) -> float:
    """A finite real number.

    Args:
        what: how to call it in an error.
        value: the number.
        above: what it must be greater than, if anything.

    Returns:
        The number as a float.

    Raises:
        InvalidInput: it is not a finite real number, or not above the limit.
    """
    limit = "" if above is None else f" above {above:g}"
    if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        try:
            found = float(value)
        except OverflowError as reason:
            raise InvalidInput(
                f"{what}: expected a finite number{limit}, found one beyond 1.8e308; change it."
            ) from reason
        if np.isfinite(found) and (above is None or found > above):
            return found
    raise InvalidInput(f"{what}: expected a finite number{limit}, found {value!r}; change it.")


def at_least_zero(what: str, value: object) -> float:
    """A number that may be nothing, but not less.

    Args:
        what: how to call it in an error.
        value: the number.

    Returns:
        The number as a float.

    Raises:
        InvalidInput: it is not a finite real number, or below 0.
    """
    found = number(what, value)
    if found < 0.0:
        raise InvalidInput(f"{what}: expected at least 0, found {value}; change its sign.")
    return found


def share(what: str, value: object) -> float:
    """A number between nothing and all, such as a probability.

    Args:
        what: how to call it in an error.
        value: the number.

    Returns:
        The number as a float.

    Raises:
        InvalidInput: it is not a finite real number from 0 to 1.
    """
    found = number(what, value)
    if not 0.0 <= found <= 1.0:
        raise InvalidInput(f"{what}: expected a number from 0 to 1, found {value}; change it.")
    return found


def whole(what: str, value: object, *, least: int = 0) -> int:
    """A whole number that is not too small.

    Args:
        what: how to call it in an error.
        value: the number.
        least: the smallest that is allowed.

    Returns:
        The number as an int.

    Raises:
        InvalidInput: it is not whole, or too small.
    """
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and value >= least:
        return int(value)
    raise InvalidInput(f"{what}: expected a whole number of at least {least}, found {value!r}; change it.")
