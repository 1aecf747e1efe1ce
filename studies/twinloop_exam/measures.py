"""What a twin and a flight are judged by, beside the held-out error and the quality of a controller."""

from __future__ import annotations

import numpy as np

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


def quantiles(errors: Floats) -> tuple[float, float]:
    """Median and 90th percentile.

    Args:
        errors: (n,).

    Returns:
        The two.
    """
    median, tail = np.quantile(errors, [0.5, 0.9])
    return float(median), float(tail)
