"""Following: how well free runs of models follow the flights that were made, each state in units of its scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats, Integers
from twinloop.campaign.history import Experiment
from twinloop.campaign.replaying import as_flown, frozen_of, lengths_of, missed_by
from twinloop.law.accuracy import squares
from twinloop.law.beginning import states_read
from twinloop.law.noise import Noise

FEWEST = 4
"""Members of a committee that are kept in any case."""
WRONG = 0.5
"""Normalised closed-loop error on a flown test at which a member of the committee is not believed."""
PIECES = 5
"""Of a flight, each of which is followed from its own first reading where commands were sent in pulses."""


@dataclass(frozen=True, eq=False)
class Following:
    """Free runs of m models beside N flights.

    Args:
        free: mean squares over steps and states, in units of the states' scales (m, N); infinite where a run diverges.
        lasted: share of each flight that a run lasts (m, N).
        frozen: mean squares of the model that never moves (N,), from where each piece begins.
        lengths: steps of the pieces in which each flight is followed (N,); all of them, but for flights without a
            controller that no model can follow in whole.
    """

    free: Floats
    lasted: Floats
    frozen: Floats
    lengths: Integers

    def order(self) -> list[int]:
        """Models, the one that goes wrong least on its worst flight first; of the diverging, what lasts longest."""
        numbers: list[int] = np.lexsort((-self.lasted.min(axis=1), self.ratios.max(axis=1))).tolist()
        return numbers

    def believed(self) -> list[int]:
        """Models that follow the flights, and the first one in any case, in order.

        One that cannot is no member of a committee (E-SINDy's stability filter). Where hardly any can, the ones that go
        wrong least still show where more must be known.
        """
        wrong = (self.free > np.maximum(WRONG * self.frozen, 4.0 * self.free[0])).any(axis=1)
        follow = {0, *np.flatnonzero(~wrong).tolist()}
        others = [i for i in self.order() if i not in follow]
        return sorted(follow | set(others[: max(0, FEWEST - len(follow))]))

    def worst(self, model: int) -> float:
        """Of a model, on the flight that it misses most: its mean square over that of the model that never moves."""
        return float(self.ratios[model].max())

    @property
    def ratios(self) -> Floats:
        """Mean squares over those of the model that never moves (m, N); infinite where a run diverges."""
        still = self.frozen == 0.0
        return np.where(
            still, np.where(self.free == 0.0, 1.0, np.inf), self.free / np.where(still, 1.0, self.frozen)
        )


def following(
    models: Sequence[_core.Model],
    flights: Sequence[Experiment],
    limits: Limits,
    workers: _core.Workers,
    noise: Noise | None = None,
) -> Following:
    """Flies each model as the system was flown, from where each flight began to where its record ends.

    A flight without its controller is followed in pieces where the first model cannot be expected to follow it whole;
    all models in the same pieces.

    Args:
        models: m of them, the first one to be judged.
        flights: N of them, at least one.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
        noise: of the sensors, and disturbances, as identified; None: of sensors alone, guessed from each flight.

    Returns:
        How well they follow.
    """
    free, lasted = np.empty((2, len(models), len(flights)))
    frozen = np.empty(len(flights))
    lengths = lengths_of(models[0], flights, limits, workers, noise)
    for j, flight in enumerate(flights):
        states, steps = flight.trajectory.states, flight.trajectory.steps
        frozen[j] = frozen_of(flight, lengths[j], limits.signals).mean()
        for i, model in enumerate(models):
            flown = as_flown(model, flight, lengths[j], limits, workers)
            missed, length = missed_by(model, flown, states[1:], limits, workers)
            lasted[i, j] = length / steps
            free[i, j] = missed.mean() if length == steps else np.inf
    return Following(free, lasted, frozen, lengths)


def in_pieces(
    model: _core.Model, flights: Sequence[Experiment], limits: Limits, workers: _core.Workers
) -> Floats:
    """How well a model follows flights under the commands that were sent, begun again at the reading of each piece.

    An unstable system leaves any free run under recorded commands after a while, however right its model is.

    Args:
        model: that is flown.
        flights: N of them, at least one.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        Mean squares over those of a model that never moves from where a piece begins (N,), infinite where one diverges.
    """
    found = np.empty(len(flights))
    for j, flight in enumerate(flights):
        states, commands = flight.trajectory.states, flight.trajectory.commands
        begun = states_read(model, states, limits.signals)
        most, off, moved = -(-len(commands) // PIECES), 0.0, 0.0
        for first in range(0, len(commands), most):
            piece = commands[first : first + most]
            read = states[first + 1 : first + 1 + len(piece)]
            flown = Replay(limits.signals, begun[first], piece)
            missed, length = missed_by(model, flown, read, limits, workers)
            off += float(missed.sum()) if length == len(piece) else np.inf
            moved += float(squares(read, states[first], limits.signals).sum())
        found[j] = off / moved if moved > 0.0 else np.inf
    return found
