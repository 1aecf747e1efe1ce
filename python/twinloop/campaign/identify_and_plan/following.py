"""Following: how well free runs of models follow the flights that were made, each state in units of its scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.errors import engine_input
from twinloop.limits import Limits


@dataclass(frozen=True, eq=False)
class Following:
    """Free runs of m models beside N flights.

    Args:
        free: mean squares over steps and states, in units of the states' scales (m, N); infinite where a run diverges.
        lasted: share of each flight that a run lasts (m, N).
        frozen: mean squares of the model that never moves (N,).
    """

    free: Floats
    lasted: Floats
    frozen: Floats

    def order(self) -> list[int]:
        """Models, the one that goes wrong least on its worst flight first; of the diverging, what lasts longest."""
        still = self.frozen == 0.0
        ratios = np.where(
            still, np.where(self.free == 0.0, 1.0, np.inf), self.free / np.where(still, 1.0, self.frozen)
        )
        numbers: list[int] = np.lexsort((-self.lasted.min(axis=1), ratios.max(axis=1))).tolist()
        return numbers


def following(
    models: Sequence[_core.Model],
    flights: Sequence[Experiment],
    limits: Limits,
    workers: _core.Workers,
) -> Following:
    """Flies each model as the system was flown, from where each flight began to where its record ends.

    Args:
        models: m of them.
        flights: N of them, at least one.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        How well they follow.
    """
    free, lasted = np.empty((2, len(models), len(flights)))
    frozen = np.empty(len(flights))
    for j, flight in enumerate(flights):
        test, states, steps = flight.replayed, flight.trajectory.states, flight.trajectory.steps
        signals, setting = limits.signals, limits.setting(test.family)
        scales = np.array([state.scale for state in signals.states])
        frozen[j] = np.square(signals.difference(states[1:], states[0]) / scales).mean()
        excitation = None if test.excitation is None else test.excitation[np.newaxis, :steps]
        for i, model in enumerate(models):
            with engine_input():
                runs = _core.rollout(
                    model,
                    setting,
                    test.genes[np.newaxis],
                    _core.Task(model.states_of(states[:1])[0], test.target_state, steps),
                    excitation=excitation,
                    workers=workers,
                )
            lasted[i, j] = runs.lasted[0] / steps
            misses = np.square(signals.difference(runs.read[0, 1:], states[1:]) / scales)
            free[i, j] = misses.mean() if lasted[i, j] == 1.0 else np.inf
    return Following(free, lasted, frozen)
