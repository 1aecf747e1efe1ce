"""An environment of Gymnasium as a system: reset and placed for each test, stepped once a period."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats, floats
from twinloop.errors import InvalidInput, NotAvailable, SystemFailure
from twinloop.signals import Signals
from twinloop.systems.environments import KNOWN
from twinloop.systems.stepped import Deviations, Episode, Stepped
from twinloop.test import Test
from twinloop.trajectory import Trajectory


class Gymnasium(Stepped):
    """Runs tests in an environment of Gymnasium, version 1.

    For "Pendulum-v1", "InvertedPendulum-v5" (MuJoCo) and "CartPole-v1" signals, states and start are built in;
    describe other environments by `signals`, `state` and `place`. If the environment ends the episode, the run is
    aborted there, with its reason. An environment that is made by its name gets no time limit. Rewards are ignored.

    Actions must be a box with one number per command. A discrete action stands for one of the `levels`. The system
    sends the level nearest to the command plus the rounding errors so far, so that the mean of the levels follows the
    controller; the sent levels are recorded. A twin flies the controller's own commands: it does not know the levels.

    Args:
        env: name of a registered environment, or an environment that was made.
        signals: states, commands and the period of `step`; None: the built-in ones.
        state: function from an observation to the state (n_x,), such as an angle from its cosine and sine; None: the
            built-in one, or the observation itself.
        place: called after reset with the environment and the initial state (n_x,) of a test; it sets that state and
            returns the observation. None: the built-in one; without one, a run begins at the state after `reset`, and
            is recorded and learnt from there.
        options: for `reset(options=…)`: a dict, or a function of the initial state (n_x,) of a test.
        levels: command of each discrete action (actions, n_u), in the units of the commands.
        make: arguments for an environment that is made by its name, such as {"g": 9.81}.
        noise: standard deviations of added sensor noise, as in `Simulated`.
        seed: of the noise and of the environment, which is reset with a number drawn from (seed, run).
        default_gains: a safe first controller, by name.

    Raises:
        InvalidInput: no such environment, other actions, or a description that does not fit it.
        NotAvailable: Gymnasium, or a package of the environment, is not installed.
    """

    def __init__(
        self,
        env: Any,
        *,
        signals: Signals | None = None,
        state: Callable[[Any], ArrayLike] | None = None,
        place: Callable[[Any, Floats], Any] | None = None,
        options: Mapping[str, Any] | Callable[[Floats], Mapping[str, Any]] | None = None,
        levels: ArrayLike | None = None,
        make: Mapping[str, Any] | None = None,
        noise: Deviations = 0.0,
        seed: int = 0,
        default_gains: Mapping[str, float] | None = None,
    ) -> None:
        self.env = _made(env, {} if make is None else dict(make))
        known = KNOWN.get(getattr(getattr(self.env, "spec", None), "id", ""))
        if signals is None:
            if known is None:
                raise InvalidInput(
                    f"Gymnasium, signals: expected them for {env!r}, found none; describe its states and actions, or"
                    f" take one that is known: {', '.join(KNOWN)}."
                )
            signals = known.signals(self.env.unwrapped)
            state, place = state or known.state, place or known.place
            if levels is None and known.levels is not None:
                levels = known.levels(self.env.unwrapped)
        super().__init__(signals, noise=noise, seed=seed, default_gains=default_gains)
        _check_period(self.env, signals)
        self._state: Callable[[Any], ArrayLike] = _itself if state is None else state
        self._place, self._options = place, options
        self._levels = _checked_levels(self.env, signals, levels)

    def _begin(self, test: Test) -> Episode:
        return _Run(self, test)


class _Run:
    """One episode."""

    def __init__(self, system: Gymnasium, test: Test) -> None:
        self.system, self.sent, self.ended = system, [], ""  # type: tuple[Gymnasium, list[Floats], str]
        self.carried = np.zeros(system.signals.n_u)
        options = system._options(test.initial_state) if callable(system._options) else system._options
        number = int(np.random.SeedSequence([system.seed, system.runs]).generate_state(1)[0])
        try:
            seen, _ = system.env.reset(seed=number, options=None if options is None else dict(options))
            if system._place is not None:
                seen = system._place(system.env, np.array(test.initial_state))
            self.start = self.read(seen)
        except InvalidInput as reason:
            raise SystemFailure(str(reason)) from reason
        except Exception as cause:
            raise SystemFailure(
                f"The environment raised {type(cause).__name__} when it was reset: {cause}; correct options, place or"
                " state."
            ) from cause

    def __call__(self, state: Floats, command: Floats) -> ArrayLike:
        """The state one period later; not finite after the end of the episode."""
        system = self.system
        if self.ended:
            return np.full(system.signals.n_x, np.nan)
        if system._levels is None:
            space = system.env.action_space
            action: Any = command.astype(space.dtype).reshape(space.shape)
            self.sent.append(command)
        else:
            wanted = command + self.carried
            ranges = np.array([one.bounds[1] - one.bounds[0] for one in system.signals.commands])
            place = int(np.argmin(np.square((system._levels - wanted) / ranges).sum(axis=1)))
            self.carried = np.clip(wanted - system._levels[place], -ranges, ranges)
            self.sent.append(system._levels[place])
            action = place + int(getattr(system.env.action_space, "start", 0))
        seen, _, terminated, truncated, _ = system.env.step(action)
        if terminated or truncated:
            self.ended = "terminated" if terminated else "truncated"
        return np.asarray(system._state(seen), dtype=np.float64)

    def finished(self, flown: Trajectory) -> Trajectory:
        """With what was sent, and why it ended; the environment knows the true state, we do not."""
        commands = np.array(self.sent[: flown.steps]).reshape(flown.commands.shape)
        noisy = bool(self.system.noise.any())
        flown = dataclasses.replace(
            flown, commands=commands, true_states=flown.true_states if noisy else None
        )
        if not self.ended or flown.ended != "diverged":
            return flown
        when = self.system.signals.dt * flown.steps
        reason = f"the environment ended the episode ({self.ended}) {when:.3g} s after the start"
        return dataclasses.replace(flown, ended="aborted", reason=reason)

    def close(self) -> None:
        """The environment is kept for the next run."""

    def read(self, seen: Any) -> Floats:
        return floats(
            "Gymnasium, state of an observation", self.system._state(seen), (self.system.signals.n_x,)
        )


def _itself(seen: Any) -> ArrayLike:
    return np.asarray(seen, dtype=np.float64)


def _made(env: Any, arguments: dict[str, Any]) -> Any:
    """The environment, made if it is a name."""
    try:
        gymnasium = importlib.import_module("gymnasium")
    except ImportError as missing:
        raise NotAvailable(
            "systems.Gymnasium: expected the package gymnasium, found none; pip install 'twinloop[gymnasium]'."
        ) from missing
    if not isinstance(env, str):
        if not isinstance(env, gymnasium.Env):
            raise InvalidInput(
                f"Gymnasium, env: expected a name or a gymnasium.Env, found {type(env).__name__}; make one with"
                " gymnasium.make."
            )
        return env
    try:
        # No time limit: a test has its own length.
        return gymnasium.make(env, max_episode_steps=-1, **arguments)
    except (gymnasium.error.DependencyNotInstalled, ImportError) as missing:
        raise NotAvailable(
            f"Gymnasium, env: expected what {env} needs, found: {missing}; for MuJoCo: pip install 'twinloop[mujoco]'."
        ) from missing
    except gymnasium.error.Error as reason:
        raise InvalidInput(
            f"Gymnasium, env: expected the name of an environment, found {env!r}: {reason}."
        ) from reason


def _check_period(env: Any, signals: Signals) -> None:
    """Refuses a period that the environment contradicts, where it says what it is."""
    for name in ("dt", "tau"):
        found = getattr(env.unwrapped, name, None)
        if isinstance(found, float) and abs(found - signals.dt) > 1e-9 * found:
            raise InvalidInput(
                f"Gymnasium, signals: expected a period of {found:g} s as the environment has, found {signals.dt:g} s;"
                " change dt."
            )


def _checked_levels(env: Any, signals: Signals, levels: ArrayLike | None) -> Floats | None:
    """Levels of discrete actions; None for a box that the commands fit into."""
    spaces = importlib.import_module("gymnasium.spaces")
    space = env.action_space
    if isinstance(space, spaces.Discrete):
        if levels is None:
            raise InvalidInput(
                f"Gymnasium, levels: expected the command that each of the {int(space.n)} discrete actions stands for,"
                f" found none; pass levels ({int(space.n)}, {signals.n_u}), in the units of the commands."
            )
        return floats("Gymnasium, levels (actions, commands)", levels, (int(space.n), signals.n_u))
    if not isinstance(space, spaces.Box) or int(np.prod(space.shape)) != signals.n_u:
        raise InvalidInput(
            f"Gymnasium, env: expected actions in a box of {signals.n_u} numbers, one for each command, or discrete"
            f" ones, found {space}; put a gymnasium.ActionWrapper around it."
        )
    if levels is not None:
        raise InvalidInput(
            "Gymnasium, levels: expected none, found some, where actions are continuous; leave them out."
        )
    for command, low, high in zip(signals.commands, space.low.ravel(), space.high.ravel(), strict=True):
        slack = 1e-6 * command.size
        if command.bounds[0] < low - slack or command.bounds[1] > high + slack:
            raise InvalidInput(
                f"Gymnasium, signals: expected the bounds of {command.name} within {low:g} to {high:g} as the"
                f" environment has them, found {command.bounds[0]:g} to {command.bounds[1]:g}; narrow them."
            )
    return None
