"""How well a flight did its task: the distance at its end, or the error integrated over it."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import unknown
from twinloop.signals import Signals
from twinloop.test import Test, final_distance
from twinloop.trajectory import Trajectory

KINDS = ("final_distance", "iae")
CUT_FACTOR = 10.0
"""A flight that was cut counts as this many times doing nothing: finite, for optimisers, and clearly bad."""


def angles(signals: Signals) -> list[int]:
    """Which states are angles: those measured in rad; all states where there is none.

    Args:
        signals: of the system.

    Returns:
        Their indices.
    """
    found = [i for i, state in enumerate(signals.states) if state.unit == "rad"]
    return found or list(range(signals.n_x))


def of_states(kind: str, states: Floats, test: Test) -> float:
    """Quality of a run, to be minimised.

    Args:
        kind: "final_distance", in mixed SI units, or "iae", the absolute error of the angles summed over
            them and integrated over the run, rad s.
        states: (n + 1, n_x), true or measured; fewer than the test's steps if the run was cut.
        test: that was flown.

    Returns:
        A finite number; `CUT_FACTOR` times that of doing nothing for a run that was cut.

    Raises:
        InvalidInput: an unknown kind.
    """
    if len(states) < test.steps + 1:
        return CUT_FACTOR * of_nothing(kind, test)
    if kind == "final_distance":
        return final_distance(states[-1], test.target_state, test.family.signals)
    if kind == "iae":
        signals = test.family.signals
        gaps = np.abs(states[1:] - test.target_state)[:, angles(signals)]
        return float(signals.dt * gaps.sum())
    raise unknown("quality", kind, KINDS)


def of_nothing(kind: str, test: Test) -> float:
    """Quality of staying where the test starts.

    Args:
        kind: "final_distance" or "iae".
        test: with a start and a target.

    Returns:
        As `of_states`.
    """
    return of_states(kind, np.tile(test.initial_state, (test.steps + 1, 1)), test)


def true_states(trajectory: Trajectory) -> Floats:
    """States without sensor noise where the system knows them, else as measured (n + 1, n_x)."""
    return trajectory.states if trajectory.true_states is None else trajectory.true_states
