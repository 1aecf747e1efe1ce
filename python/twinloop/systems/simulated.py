"""A system made of a step function: somebody's simulator, called once a period."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput
from twinloop.signals import Signals
from twinloop.systems.stepped import Deviations, Episode, Step, Stepped
from twinloop.test import Test
from twinloop.trajectory import Trajectory


class Simulated(Stepped):
    """Runs tests on `step(state (n_x,), command (n_u,)) -> next state (n_x,)`.

    A run is cut where a state leaves ten times its scale, or is not finite, and says so.

    Args:
        signals: its states, commands and period.
        step: gives the state one period later; it must have no memory between runs.
        noise: standard deviations of the sensors, in the units of the states: by name, one for each state, or one for
            all. The noisy state is read and recorded; `true_states` has the true one, which the step function gets.
        seed: of the noise; run r of this object, or of a campaign that continues in another process, draws from a
            stream of (seed, r).
        default_gains: a safe first controller, by name.

    Raises:
        InvalidInput: `step` cannot be called, `signals` are none, or a noise or a seed that cannot be used.
    """

    def __init__(
        self,
        signals: Signals,
        step: Step,
        *,
        noise: Deviations = 0.0,
        seed: int = 0,
        default_gains: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(signals, noise=noise, seed=seed, default_gains=default_gains)
        if not callable(step):
            raise InvalidInput(
                f"Simulated, step: expected a function (state, command) -> next state, found {step!r}."
            )
        self._step = step

    def _begin(self, test: Test) -> Episode:
        return _Run(test.initial_state, self._step)


@dataclass
class _Run:
    """A run that begins where it should."""

    start: Floats
    step: Step

    def __call__(self, state: Floats, command: Floats) -> ArrayLike:
        return self.step(state, command)

    def finished(self, flown: Trajectory) -> Trajectory:
        return flown

    def close(self) -> None:
        pass
