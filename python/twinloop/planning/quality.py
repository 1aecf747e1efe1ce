"""What flights are for: the quality that is minimised, of predicted flights and of flown ones alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats, at_least_zero
from twinloop.errors import InvalidInput, unknown
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
        return self.engine.recorded(self.signals.engine, target, trajectory.states, trajectory.commands)


def quality_of(
    kind: str, signals: Signals, weights: Sequence[float] = (), effort: float = 0.0, effort_rate: float = 0.0
) -> Quality:
    """A quality with the weights that its kind has by default: see `weights_of`.

    Args:
        kind: "iae", "ise" or "final_distance".
        signals: of the system.
        weights: of the states (n_x,), where the default ones are not wanted.
        effort: factor of the integral of squared commands.
        effort_rate: factor of the integral of their squared rates.

    Returns:
        The quality.
    """
    chosen = np.asarray(weights, dtype=np.float64) if len(weights) else weights_of(kind, signals)
    return Quality(kind, chosen, effort, effort_rate, signals)


def weights_of(kind: str, signals: Signals, changed: Mapping[str, float] | None = None) -> Floats:
    """How much each state counts in a quality.

    The final distance counts every state alike, as in the paper: 1. The integrals count the states that a task is
    about: 1 where a state is no other's derivative and no body rate, else 0; each in units of its scale; where all
    that count have one unit, times the scale of the first, so that the quality of states of equal scales is in
    their unit.

    Args:
        kind: "iae", "ise" or "final_distance".
        signals: of the system.
        changed: other numbers than those of 0 and 1, of at least 0, by the states' names. They have no unit.

    Returns:
        Factors (n_x,) of the states' errors ("iae"), or of their squares.

    Raises:
        InvalidInput: no state has such a name, or a number that cannot be used.
    """
    body, final = signals.kinematics, kind == "final_distance"
    shares = {
        state.name: 1.0
        if final or (state.derivative_of is None and not (body is not None and state.name in body.rates))
        else 0.0
        for state in signals.states
    }
    for name, share in _numbers({} if changed is None else changed).items():
        if name not in shares:
            raise unknown("state of the argument weights", name, shares)
        shares[name] = share
    if final:
        return np.array(list(shares.values()))
    counted = [state for state in signals.states if shares[state.name] > 0.0]
    unit = counted[0].scale if len({state.unit for state in counted}) == 1 else 1.0
    sizes = np.array([unit / state.scale for state in signals.states])
    return np.asarray(list(shares.values()) * (sizes if kind == "iae" else sizes * sizes), dtype=np.float64)


def _numbers(weights: object) -> dict[str, float]:
    """Weights by name, checked: finite numbers of at least 0."""
    if not isinstance(weights, Mapping):
        raise InvalidInput(
            "Campaign, weights: expected a finite number of at least 0 for each state by name, found"
            f' {weights!r}; write {{"angle": 2.0}}.'
        )
    return {name: at_least_zero(f"Campaign, weights, {name!r}", value) for name, value in weights.items()}


def quality_unit(quality: Quality) -> str:
    """Unit of a quality, where it has one: "" where states of several units, or commands, are weighed together.

    Args:
        quality: of a campaign.
    """
    counted = [
        (state, weight)
        for state, weight in zip(quality.signals.states, quality.weights.tolist(), strict=True)
        if weight != 0.0
    ]
    units = {state.unit for state, _ in counted}
    if (
        len(units) != 1
        or any(weight != 1.0 for _, weight in counted)
        or quality.effort
        or quality.effort_rate
    ):
        return ""
    unit = units.pop()
    return {"iae": f"{unit} s", "ise": f"{unit}² s"}.get(quality.kind, unit)
