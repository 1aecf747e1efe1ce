"""A twin as an environment of Gymnasium, for people who train policies on it."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats, floats, whole
from twinloop.errors import NotAvailable
from twinloop.law.law import Law
from twinloop.law.noise import Noise
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

Reward = Callable[[Floats, Floats, Floats], float]
"""(state (n_x,), command (n_u,), next state (n_x,)) -> reward."""


class Simulator(Protocol):
    """What an environment needs of a twin."""

    @property
    def signals(self) -> Signals:
        """Of the system."""
        ...

    @property
    def noise(self) -> Noise | None:
        """Of its sensors."""
        ...

    @property
    def limits(self) -> Limits:
        """Where a run counts as diverged."""
        ...

    @property
    def law(self) -> Law:
        """Its sensors' offsets among all."""
        ...

    def simulate_commands(self, initial_state: ArrayLike, commands: ArrayLike) -> Trajectory:
        """A free run."""
        ...

    def predict(self, states: ArrayLike, commands: ArrayLike, past: ArrayLike | None = None) -> Floats:
        """One step."""
        ...


def environment(
    twin: Simulator,
    initial_state: ArrayLike,
    target_state: ArrayLike,
    steps: int,
    reward: Reward | None = None,
    noisy: bool = False,
) -> Any:
    """An environment that moves as a twin does; see `Twin.env`.

    Args:
        twin: that moves it.
        initial_state: where an episode begins (n_x,), SI units, radians.
        target_state: for the reward (n_x,), the same units.
        steps: after which an episode is truncated.
        reward: by default the negative sum of errors after the step, each over its state's scale, times the period.
        noisy: whether observations carry the noise of the sensors as the twin estimates it.

    Raises:
        NotAvailable: Gymnasium is not installed.
        InvalidInput: states or steps that cannot be used.
    """
    try:
        gymnasium: Any = importlib.import_module("gymnasium")
    except ImportError as missing:
        raise NotAvailable(
            "Twin.env: expected the package gymnasium, found none; pip install 'twinloop[gymnasium]'."
        ) from missing
    signals = twin.signals
    begin = floats("Twin.env, initial state", initial_state, (signals.n_x,))
    target = floats("Twin.env, target state", target_state, (signals.n_x,))
    length = whole("Twin.env, steps", steps, least=1)
    scales = np.array([state.scale for state in signals.states])
    limits = twin.limits.states
    low, high = (np.array([command.bounds[i] for command in signals.commands]) for i in (0, 1))
    deviations = twin.noise.sensors if noisy and twin.noise is not None else np.zeros(signals.n_x)

    late = any(twin.law.offsets)

    class TwinEnv(gymnasium.Env):  # type: ignore[misc]
        """The twin, with its lags, delays and hidden states; it remembers the commands of the episode."""

        metadata: Mapping[str, Any] = {"render_modes": []}

        def __init__(self) -> None:
            # Twice what diverges: noise is read beyond it as well. An angle that wraps goes on without end.
            self.observation_space = gymnasium.spaces.Box(-2.0 * limits, 2.0 * limits, dtype=np.float64)
            self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
            self.begun, self.state, self.sent = begin, begin, []  # type: Floats, Floats, list[Floats]

        def reset(
            self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
        ) -> tuple[Floats, dict[str, Any]]:
            """Begins an episode, at `options["initial_state"]` where that is given."""
            super().reset(seed=seed)
            given = (options or {}).get("initial_state")
            start = begin if given is None else floats("reset, initial_state", given, (signals.n_x,))
            self.begun, self.state, self.sent = start, start, []
            return self._seen(), {"state": np.array(self.state)}

        def step(self, action: ArrayLike) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
            """One period; it terminates where the twin diverges, with the last state that did not."""
            command = np.clip(floats("step, action", action, (signals.n_u,)), low, high)
            following = self._following(command)
            self.sent.append(command)
            lost = bool(not np.isfinite(following).all() or (np.abs(following) > limits).any())
            before, self.state = self.state, self.state if lost else following
            earned = self._reward(before, command, self.state)
            return self._seen(), earned, lost, len(self.sent) >= length, {"state": np.array(self.state)}

        def _following(self, command: Floats) -> Floats:
            if twin.law.actuation.stored:
                # What motion has filled depends on the whole run.
                run = twin.simulate_commands(self.begun, np.array([*self.sent, command]))
                states = run.states if run.true_states is None else run.true_states
                return states[-1] if run.steps > len(self.sent) else np.full(signals.n_x, np.nan)
            past = np.array(self.sent) if self.sent and twin.law.actuation.remembers else None
            return twin.predict(self.state, command, past=past)

        def _reward(self, before: Floats, command: Floats, after: Floats) -> float:
            if reward is not None:
                return float(reward(before, command, after))
            return -signals.dt * float((np.abs(signals.difference(after, target)) / scales).sum())

        def _seen(self) -> Floats:
            now = np.array(self.state)
            if late:
                # What a late sensor reads depends on the whole run.
                sent = np.array(self.sent).reshape(-1, signals.n_u)
                now = np.array(twin.simulate_commands(self.begun, sent).states[-1])
            if not deviations.any():
                return now
            read: Floats = now + deviations * self.np_random.standard_normal(signals.n_x)
            return read

    return TwinEnv()
