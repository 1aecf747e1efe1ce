"""A law as a Python file with an environment of Gymnasium, which needs neither the twin nor this package."""

from __future__ import annotations

from dataclasses import dataclass

from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop.law.exports.python_source import python_source
from twinloop.law.law import Law

_ENVIRONMENT = '''
class TwinEnv(gymnasium.Env):
    """The twin, a period a step: observations are what its sensors read, actions commands in their own units.

    An episode is truncated after `steps` and terminates where a state leaves what `LIMITS` says. The reward, a function
    of state, command and next state, is by default the negative sum of errors after the step, each over its state's
    scale, times the period.
    """

    metadata = {"render_modes": []}

    def __init__(self, initial_state=INITIAL_STATE, target_state=TARGET_STATE, steps=STEPS, reward=None):
        far = np.array([math.inf if period else 2.0 * limit for limit, period in zip(LIMITS, PERIODS)])
        low, high = np.array(BOUNDS, dtype=np.float64).T
        self.observation_space = gymnasium.spaces.Box(-far, far, dtype=np.float64)
        self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
        self.initial_state, self.target_state = [float(v) for v in initial_state], [float(v) for v in target_state]
        self.steps, self.reward = int(steps), reward or self._nearness
        self._twin, self._sensors, self._state, self._done = Twin(), Sensors(), list(self.initial_state), 0

    def reset(self, *, seed=None, options=None):
        """Begins an episode, at `options["initial_state"]` where that is given."""
        super().reset(seed=seed)
        self._twin.reset()
        self._sensors.reset()
        start = (options or {}).get("initial_state", self.initial_state)
        self._state, self._done = [float(value) for value in start], 0
        self._reading = self._sensors.read(self._state)
        return self._seen(), self._known()

    def step(self, action):
        """One period; it terminates where the twin diverges, with the last state that did not."""
        command = [min(max(float(value), low), high) for value, (low, high) in zip(action, BOUNDS)]
        before, following = self._state, self._twin.step(self._state, command)
        lost = not all(
            math.isfinite(value) and (period is not None or abs(value) <= limit)
            for value, limit, period in zip(following, LIMITS, PERIODS)
        )
        if not lost:
            self._state, self._reading = following, self._sensors.read(following)
        self._done += 1
        earned = float(self.reward(np.array(before), np.array(command), np.array(self._state)))
        return self._seen(), earned, lost, self._done >= self.steps, self._known()

    def _seen(self):
        return np.array(self._reading, dtype=np.float64)

    def _known(self):
        return {"state": np.array(self._state, dtype=np.float64)}

    def _nearness(self, before, command, after):
        errors = [
            value - target if period is None else _wrapped(value - target, period)
            for value, target, period in zip(after, self.target_state, PERIODS)
        ]
        return -DT * sum(abs(error) / size for error, size in zip(errors, SIZES))
'''


@dataclass(frozen=True)
class Episode:
    """Default start, target and length of an environment.

    Args:
        initial_state: (n_x,), SI units, radians.
        target_state: for the reward (n_x,), the same units.
        steps: after which an episode is truncated.
        limits: beyond which it terminates.
    """

    initial_state: Floats
    target_state: Floats
    steps: int
    limits: Limits


def gymnasium_source(law: Law, episode: Episode) -> str:
    """A law as a Python file that imports Gymnasium and NumPy.

    Args:
        law: of a twin.
        episode: what it begins with.

    Returns:
        The module of `python_source` with a class `TwinEnv`, a `gymnasium.Env`.
    """
    text = python_source(law)
    text = text.replace("\nimport math\n", "\nimport math\n\nimport gymnasium\nimport numpy as np\n", 1)
    text = text.replace("It needs nothing but Python.", "`TwinEnv()` is an environment of Gymnasium.", 1)
    states = law.signals.states
    constants = [
        f"SIZES = {tuple(state.scale for state in states)!r}  # of the states, for the reward",
        f"LIMITS = {tuple(episode.limits.divergence_factor * state.scale for state in states)!r}  # beyond: diverged",
        f"PERIODS = {tuple(state.period for state in states)!r}  # of angles that wrap",
        f"INITIAL_STATE = {tuple(episode.initial_state.tolist())!r}",
        f"TARGET_STATE = {tuple(episode.target_state.tolist())!r}",
        f"STEPS = {episode.steps}  # of an episode",
    ]
    return "\n".join([text, *constants, "", _ENVIRONMENT])
