"""What was seen: how far flights have moved each state, and the bounds of what may still be believed beyond them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.signals import Signals

HARDLY = 0.02
"""Share of its scale by which a state is taken to have moved at least."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Where flights have been, and where the task leads.

    Args:
        flights: smallest and largest reading of each state (2, n_x).
        task: smallest and largest of where the task begins and leads (2, n_x).
    """

    flights: Floats
    task: Floats

    @property
    def both(self) -> Floats:
        """Smallest and largest value of each state in flights and task (2, n_x)."""
        return np.stack(
            [np.minimum(self.flights[0], self.task[0]), np.maximum(self.flights[1], self.task[1])]
        )

    def around(self, reach: float, signals: Signals) -> Floats:
        """Bounds of states (2, n_x): wider than flights and task by some times as far as flights have moved each.

        A task that leads far is no reason to believe a law still further away.

        Args:
            reach: how many times; what has hardly moved is taken to have moved by a share of its scale.
            signals: of the system.
        """
        hardly = HARDLY * np.array([state.scale for state in signals.states])
        moved = np.maximum(self.flights[1] - self.flights[0], hardly)
        low, high = self.both
        return np.stack([low - reach * moved, high + reach * moved])
