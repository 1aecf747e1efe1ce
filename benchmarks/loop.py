"""The loop that is closed: a quadrotor's signals, its PID with mixer, and recorded flights."""

from dataclasses import dataclass

import numpy as np

from twinloop import _core

STATES, COMMANDS, DT, STEPS = 6, 4, 0.02, 100
ARM, THRUST, DRAG, MASS = 0.23, 3.13e-5, 7.5e-7, 0.65
HOVER = float(np.sqrt(MASS * 9.81 / 4 / THRUST))
BOUNDS = (0.0, 300.0)
MIX = np.linalg.inv(
    np.array(
        [
            [0, -ARM * THRUST, 0, ARM * THRUST],
            [ARM * THRUST, 0, -ARM * THRUST, 0],
            [-DRAG, DRAG, -DRAG, DRAG],
            [1, 1, 1, 1],
        ]
    )
)
MATRIX = np.ascontiguousarray(MIX[:, :3])
OFFSET = MIX[:, 3] * 4 * HOVER**2
# Wide: a random model goes far, and a run that is stopped early would be work spared.
DIVERGENCE_FACTOR = 1e6

SIGNALS = _core.Signals(
    DT,
    [np.pi] * 3 + [10.0] * 3,
    [BOUNDS] * COMMANDS,
    [HOVER] * COMMANDS,
    [None, None, None, 0, 1, 2],
)
FAMILY = _core.Family.pid(
    SIGNALS,
    [(0, 3), (1, 4), (2, 5)],
    [(0.0, high, False) for high in [0.3, 0.1, 0.1] * 3],
    (MATRIX, OFFSET, 0.5),
)
SETTING = _core.Setting(_core.Limits(SIGNALS), FAMILY)
FAR = _core.Setting(_core.Limits(SIGNALS, DIVERGENCE_FACTOR), FAMILY)


@dataclass(frozen=True)
class Flights:
    """Recorded tests.

    Gains (tests, 9), target (6,), states (tests, steps + 1, 6), commands (tests, steps, 4).
    """

    gains: np.ndarray
    target: np.ndarray
    states: np.ndarray
    commands: np.ndarray

    def selected(self, setting: _core.Setting = FAR) -> _core.SelectedTests:
        tests = _core.SelectedTests(setting)
        for gains, states, commands in zip(self.gains, self.states, self.commands, strict=True):
            tests = tests.with_test(gains, self.target, states, commands)
        return tests


def fly(tests: int, seed: int = 0) -> Flights:
    """Flies good gains, each a little different."""
    rng = np.random.default_rng(seed)
    good = np.array([0.03, 0.004, 0.024] * 2 + [0.052, 0.004, 0.0416])
    gains = good * rng.uniform(0.8, 1.2, size=(tests, 9))
    target = np.deg2rad([-30.0, 30.0, -70.0, 0.0, 0.0, 0.0])
    plant = _core.Quadrotor(
        DT,
        arm=ARM,
        inertia=[7.5e-3, 7.5e-3, 1.3e-2],
        rotor_inertia=6e-5,
        thrust_factor=THRUST,
        drag_factor=DRAG,
        gyroscopic="print",
    )
    runs = _core.rollout(plant, SETTING, gains, _core.Task(np.zeros(6), target, STEPS))
    return Flights(gains, target, runs.states, runs.commands)
