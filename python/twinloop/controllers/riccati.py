"""The discrete algebraic Riccati equation, with the same bits on every machine: no BLAS, no LAPACK."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import product

DOUBLINGS = 24
"""Periods are looked ahead by powers of two; what has not settled after 2^24 of them will not settle."""
SETTLED = 1e-9
"""Share of a deviation that may be left when the equation counts as solved."""


def solve_riccati(a: Floats, b: Floats, q: Floats, r: Floats) -> Floats | None:
    """The stabilising solution X of X = Aᵀ X A − Aᵀ X B (R + Bᵀ X B)⁻¹ Bᵀ X A + Q.

    Structure-preserving doubling (E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, 2004, International Journal
    of Control 77:767): step k solves the problem over a horizon of 2^k periods.

    Args:
        a: (n, n), state to next state.
        b: (n, m), input to next state.
        q: (n, n), symmetric, cost of the state.
        r: (m, m), symmetric and positive definite, cost of the input.

    Returns:
        X (n, n), or None where no feedback makes every costly deviation die out.
    """
    one = np.eye(len(a))
    weighted = solve_linear(r, b.T)
    if weighted is None:
        return None
    ahead, reach, cost = a, product(b, weighted), q
    for _ in range(DOUBLINGS):
        # What overflows on its way is caught below.
        with np.errstate(all="ignore"):
            spread = solve_linear(one + product(reach, cost), np.hstack([ahead, reach]))
            if spread is None:
                return None
            of_ahead, of_reach = spread[:, : len(a)], spread[:, len(a) :]
            reach = symmetric(reach + product(product(ahead, of_reach), ahead.T))
            cost = symmetric(cost + product(product(ahead.T, cost), of_ahead))
            ahead = product(ahead, of_ahead)
        if not (np.isfinite(ahead).all() and np.isfinite(cost).all() and np.isfinite(reach).all()):
            return None
        if np.abs(ahead).max() < SETTLED:
            # `ahead` squares from step to step, so that what is left is far below a rounding of the cost.
            return cost
    return None


def solve_linear(matrix: Floats, right: Floats) -> Floats | None:
    """The solution of a small linear system by elimination with the largest pivot.

    Args:
        matrix: (n, n).
        right: (n, m).

    Returns:
        (n, m), or None where the matrix is singular.
    """
    n = len(matrix)
    rows = np.hstack([matrix, right])
    for i in range(n):
        pivot = i + int(np.argmax(np.abs(rows[i:, i])))
        if not abs(rows[pivot, i]) > 0.0:
            return None
        rows[[i, pivot]] = rows[[pivot, i]]
        rows[i] = rows[i] / rows[i, i]
        for j in range(n):
            if j != i:
                rows[j] = rows[j] - rows[j, i] * rows[i]
    return rows[:, n:]


def symmetric(matrix: Floats) -> Floats:
    """A symmetric matrix without the rounding that made it less so.

    Args:
        matrix: (n, n).

    Returns:
        The mean of it and its transpose.
    """
    return 0.5 * (matrix + matrix.T)
