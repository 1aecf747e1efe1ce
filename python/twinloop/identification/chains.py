"""Which states an output of a model drives: a state, its integral, the integral of that."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twinloop.arrays import Floats
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class Chain:
    """The states behind one output, and the noise of their sensors and of their motion.

    Args:
        states: the driven one first, then its integral, and so on.
        output: number of the output of the program that drives them; None where other states do (an angle of a
            rigid body).
        integrated: whether the output is a derivative, not an increment.
        sensors: variance of each state's sensor, in its unit squared.
        process: variance of the disturbance per second (per period for increments).
    """

    states: tuple[int, ...]
    output: int | None
    integrated: bool
    sensors: Floats
    process: float

    def with_noise(self, sensors: Floats, process: float) -> Chain:
        """The same states with other noise."""
        return replace(self, sensors=np.asarray(sensors, dtype=np.float64), process=float(process))

    @property
    def engine(self) -> tuple[list[int], list[float], float, bool]:
        """The same for the native engine."""
        return list(self.states), self.sensors.tolist(), self.process, self.integrated


def chains(signals: Signals, form: str, sensors: Floats) -> list[Chain]:
    """Chains of a form, those without an output last.

    Args:
        signals: of the system.
        form: "acceleration", "increment" or "absolute".
        sensors: a first guess of each sensor's variance (n_x,).

    Returns:
        Every state is in one of them.
    """
    if form != "acceleration":
        return [Chain((i,), i, False, sensors[[i]], 0.0) for i in range(signals.n_x)]
    driven, given = [], []
    names = signals.state_names
    outputs = [i for i in range(signals.n_x) if not signals.is_given(i)]
    seen: set[int] = set()
    for output, first in enumerate(outputs):
        states = [first]
        parent = signals.states[first].derivative_of
        while parent is not None and len(states) < 4:
            states.append(names.index(parent))
            parent = signals.states[states[-1]].derivative_of
        seen.update(states)
        driven.append(Chain(tuple(states), output, True, sensors[states], 0.0))
    for i in range(signals.n_x):
        if i not in seen:
            given.append(Chain((i,), None, True, sensors[[i]], 0.0))
    return [*driven, *given]
