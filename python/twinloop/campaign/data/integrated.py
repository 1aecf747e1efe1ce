"""Integrated: a state, held against the integral of what is said to be its derivative."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from twinloop._ground.arrays import Floats

MOVED = 20.0
"""Standard deviations of its noise that a state must have moved before it is held against its derivative."""
BENT = 5.0
"""The same about a line, which is all that a biased rate adds."""
WALKED = 3.0
"""Standard deviations of the random walk, which noise becomes when a rate is integrated, that this must have moved."""
AS_FAST = (0.5, 2.0)
"""Times as fast as its derivative says, between which a state is taken to do what was declared."""
ALIKE = 0.5
"""Correlation with its integrated derivative below which a state is taken to do something else."""
PIECES = (5, 25)
"""Into how many a run is cut where it seems to contradict."""
LEAST_ROWS = 20
"""Of a piece: fewer show little of a motion."""


def contradiction(pairs: Sequence[tuple[Floats, ...]], least: float, least_declared: float) -> str | None:
    """How states contradict what their derivatives say: "" if they do not, None if they moved too little to tell.

    Args:
        pairs: of each run, the state and the same by its derivative.
        least: mean square that the state must have.
        least_declared: sum of squares that its integrated derivative must have.
    """
    found, declared = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    size, declared_size, product = (
        float(values.sum()) for values in (np.square(found), np.square(declared), found * declared)
    )
    if size <= len(found) * least or declared_size <= least_declared:
        return None
    if product * product < ALIKE * ALIKE * size * declared_size:
        return "does not change as"
    if not AS_FAST[0] * declared_size < product < AS_FAST[1] * declared_size:
        return f"changes {product / declared_size:.3g} times as fast as"
    return ""


def in_spite_of_drift(judged: Callable[[int], Sequence[str | None]]) -> list[str | None]:
    """How states contradict their derivatives over whole runs, and in pieces of them, too.

    The bias of a rate drifts: integrated over a long run it may be more than all that the state has moved, and in a
    short piece it is little. A wrong sign, unit or column is wrong in every piece.

    Args:
        judged: gives what is said of each state, in the way of `contradiction`, where runs are cut into so many pieces.
    """
    said = list(judged(1))
    for pieces in PIECES:
        if any(said):
            said = ["" if piece == "" else whole for whole, piece in zip(said, judged(pieces), strict=True)]
    return said


def cuts(rows: int, pieces: int) -> Iterator[slice]:
    """Where a run is cut into pieces of equal length; fewer where they would be too short.

    Args:
        rows: of the run.
        pieces: that are wanted.
    """
    count = max(1, min(pieces, rows // LEAST_ROWS))
    ends = np.linspace(0, rows, count + 1).astype(int).tolist()
    yield from (slice(*ends[k : k + 2]) for k in range(count))


def walk(variance: Floats, dt: float, steps: int) -> Floats:
    """Sum of squares about its line of the random walk that white noise becomes when it is integrated.

    On average these are a fifteenth of its last variance each.

    Args:
        variance: of the noise, any shape.
        dt: period.
        steps: of the record.
    """
    duration = dt * steps
    return np.asarray(variance * (duration * duration) / 15.0)


def moved(state: Floats, rate: Floats, dt: float) -> tuple[Floats, Floats]:
    """A state over a run, and the same by its derivative, each less its mean."""
    said = np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
    return state - state.mean(), said - said.mean()


def without_line(values: Floats) -> Floats:
    """Values less their regression on a constant and time (n,)."""
    time = np.arange(len(values)) - 0.5 * (len(values) - 1)
    rest: Floats = values - values.mean()
    return rest - time * (float((time * rest).sum()) / max(float(np.square(time).sum()), 1.0))
