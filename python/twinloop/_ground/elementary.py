"""Elementary functions and products, with the same bits on every processor; others differ in the last one."""

from __future__ import annotations

import numpy as np

from twinloop._core import cos, exp, log, power, sin, tanh
from twinloop._ground.arrays import Floats

__all__ = ["cos", "exp", "log", "power", "product", "sin", "tanh"]


def product(left: Floats, right: Floats) -> Floats:
    """The product of two matrices, summed in a fixed order.

    Args:
        left: (n, k).
        right: (k, m).

    Returns:
        (n, m).
    """
    total = np.zeros((left.shape[0], right.shape[1]))
    for i in range(left.shape[1]):
        total = total + left[:, i : i + 1] * right[i : i + 1]
    return total
