"""What flights are for: the quality that is minimised, of predicted flights and of flown ones alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.errors import engine_input
from twinloop.flights import quality as engine_quality
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

KINDS = ("iae", "ise", "final_distance")


@dataclass(frozen=True, eq=False)
class Quality:
    """A quality over given signals.

    Args:
        kind: "iae", "ise" or "final_distance".
        weights: how much each state counts (n_x,).
        effort: factor of the integral of squared commands, in units of their scale.
        effort_rate: factor of the integral of their squared rates.
        signals: of the system.
    """

    kind: str
    weights: Floats
    effort: float
    effort_rate: float
    signals: Signals

    @property
    def engine(self) -> _core.Quality:
        """The same for the native engine."""
        return engine_quality(self.kind, self.weights, effort=self.effort, effort_rate=self.effort_rate)

    def flown(self, trajectory: Trajectory, target: Floats) -> float:
        """The quality of a recorded run, from its readings.

        Args:
            trajectory: of at least one step.
            target: state that it should have been led to (n_x,), or a row for each of its states (n + 1, n_x).
        """
        with engine_input():
            return self.engine.recorded(self.signals.engine, target, trajectory.states, trajectory.commands)


def quality_of(
    kind: str, signals: Signals, weights: Sequence[float] = (), effort: float = 0.0, effort_rate: float = 0.0
) -> Quality:
    """A quality with the weights that its kind has by default.

    The final distance counts every state alike, as in the paper. The integrals count the states that a task is about,
    which are those that are no other's derivative and no body rate, each in units of its scale; where all of them have
    one unit, times the scale of the first, so that the quality of states of equal scales is in their unit.

    Args:
        kind: "iae", "ise" or "final_distance".
        signals: of the system.
        weights: of the states (n_x,), where the default ones are not wanted.
        effort: factor of the integral of squared commands.
        effort_rate: factor of the integral of their squared rates.

    Returns:
        The quality.
    """
    chosen = np.asarray(weights, dtype=np.float64)
    if not len(chosen):
        chosen = np.ones(signals.n_x)
        if kind != "final_distance":
            body = signals.kinematics
            counted = [
                state.derivative_of is None and not (body is not None and state.name in body.rates)
                for state in signals.states
            ]
            units = {state.unit for state, counts in zip(signals.states, counted, strict=True) if counts}
            first = next((s.scale for s, counts in zip(signals.states, counted, strict=True) if counts), 1.0)
            for i, state in enumerate(signals.states):
                share = (first if len(units) == 1 else 1.0) / state.scale
                chosen[i] = (share if kind == "iae" else share * share) if counted[i] else 0.0
    return Quality(kind, chosen, effort, effort_rate, signals)
