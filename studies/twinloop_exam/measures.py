"""What a twin and a flight are judged by, beside the held-out error and the quality of a controller."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory
from twinloop_exam.quality import true_states


def violated(trajectory: Trajectory, signals: Signals) -> bool:
    """Whether a flight left the envelope that the states declare; a diverged flight has.

    Args:
        trajectory: the flight; its true states are looked at where there are any.
        signals: with the envelopes.

    Returns:
        True if any state of any row is outside.
    """
    if trajectory.ended == "diverged":
        return True
    states = true_states(trajectory)
    for i, state in enumerate(signals.states):
        if state.envelope is not None:
            low, high = state.envelope
            if bool(((states[:, i] < low) | (states[:, i] > high)).any()):
                return True
    return False


def coverage(band: Floats, states: Floats) -> float:
    """Share of measured samples inside a band, the first row left out for it is known.

    Args:
        band: lower and upper end (2, n + 1, n_x).
        states: as measured (m + 1, n_x), m at most n.

    Returns:
        0 to 1.
    """
    rows = min(band.shape[1], len(states))
    low, high = band[0, 1:rows], band[1, 1:rows]
    inside = (states[1:rows] >= low) & (states[1:rows] <= high)
    return float(inside.mean()) if inside.size else float("nan")


def number_of_terms(program: _core.Program) -> int:
    """Terms of a program: outputs that are not always zero, and each sum or difference once.

    A sum of n products counts as n; a part that is used several times counts once.

    Args:
        program: the program; its introns do not count.

    Returns:
        At least 0.
    """
    effective = program.effective()
    first_output = effective.inputs
    zero = [register >= first_output for register in range(effective.registers)]
    sums = 0
    for operation, destination, first, second in effective.instructions:
        second_is_zero = second == 0.0 if isinstance(second, float) else second is not None and zero[second]
        if operation in ("+", "-"):
            sums += not (zero[first] or second_is_zero)
            zero[destination] = zero[first] and second_is_zero
        elif operation == "*":
            zero[destination] = zero[first] or second_is_zero
        elif operation in ("cos", "exp"):
            zero[destination] = False
        elif operation in ("min", "max"):
            zero[destination] = zero[first] and second_is_zero
        else:
            zero[destination] = zero[first]
    outputs = range(first_output, first_output + effective.outputs)
    return sums + sum(not zero[register] for register in outputs)


QUANTILES = {"error_median": 0.5, "error_p90": 0.9}
"""Shares of the held-out controllers whose errors are below these measures."""


def quantiles(values: ArrayLike, shares: Sequence[float]) -> list[float]:
    """Quantiles of numbers of which some may be infinite.

    Args:
        values: (n,), at least one.
        shares: 0 to 1.

    Returns:
        One a share, between the two values whose ranks are nearest; infinite where the upper one is.
    """
    numbers = np.sort(np.asarray(values, dtype=np.float64))
    upper = [math.ceil((len(numbers) - 1) * share) for share in shares]
    finite = np.where(np.isfinite(numbers), numbers, np.finfo(np.float64).max)
    found = np.quantile(finite, shares).tolist()
    return [
        value if np.isfinite(numbers[place]) else math.inf for value, place in zip(found, upper, strict=True)
    ]


def ranked(measures: Mapping[str, float | None], controllers: int) -> dict[str, float | None]:
    """Measures as a store has them, with held-out errors that are infinite where too many of the runs diverged.

    A store has no number there, or one that earlier versions put in its place; it has how many runs diverged.

    Args:
        measures: by name.
        controllers: how many were held out.

    Returns:
        The same with those errors.
    """
    diverged = measures.get("diverged") or 0.0
    lost = [
        name
        for name, share in QUANTILES.items()
        if diverged >= controllers - math.ceil((controllers - 1) * share)
    ]
    return {**measures, **dict.fromkeys(lost, math.inf)}


def number(value: float, digits: int) -> str:
    """An error as text.

    Args:
        value: infinite if the twin diverges.
        digits: significant ones.
    """
    return f"{value:.{digits}g}" if math.isfinite(value) else "diverges"
