"""Where a test starts and leads: the start and the target of each state, for a sheet and for a card."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.signals import State
from twinloop.test import Test


@dataclass(frozen=True)
class Ends:
    """Where a test starts and leads in one state.

    Args:
        state: of the system.
        start: of the test, in the unit of the state.
        targets: the target; of a test whose target varies with time that of its first and of its last row.
    """

    state: State
    start: float
    targets: tuple[float, ...]


def ends(test: Test) -> list[Ends]:
    """Where a test starts and leads, state by state.

    Args:
        test: to be flown.
    """
    target = np.atleast_2d(test.target_state)
    rows = target[[0, -1]] if varying(test) else target[:1]
    states = zip(test.family.signals.states, test.initial_state.tolist(), rows.T.tolist(), strict=True)
    return [Ends(state, start, tuple(targets)) for state, start, targets in states]


def varying(test: Test) -> dict[str, Floats]:
    """The target of each state whose target varies with time, by name (n + 1,).

    Args:
        test: to be flown.
    """
    names, target = test.family.signals.state_names, np.atleast_2d(test.target_state)
    return {name: target[:, i] for i, name in enumerate(names) if (target[:, i] != target[0, i]).any()}


def varying_words(test: Test, file: str) -> str:
    """That the target varies with time, and where all of it stands; empty where it does not vary.

    Args:
        test: to be flown.
        file: where its columns are.
    """
    named = ", ".join(f"target_{name}" for name in varying(test))
    return f"The target varies with time: {file} has a row of it a period ({named})." if named else ""
