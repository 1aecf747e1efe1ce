"""Shared fixtures: the quadrotor, a small rig with one axis, and campaigns that are over in no time."""

import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent))  # `oracles` and `strategies` are modules of the tests

import twinloop as tl
from twinloop import _core

settings.register_profile("twinloop", deadline=None, max_examples=40, derandomize=True)
settings.load_profile("twinloop")

# A shell that starts the tests in the background has them ignore Ctrl-C, and some tests press it.
signal.signal(signal.SIGINT, signal.default_int_handler)

TINY = {
    "model_population": 20,
    "model_generations": 8,
    "test_population": 10,
    "test_generations": 4,
    "committee_size": 6,
    "mutants": 3,
}
"""Options of a campaign of the preset `paper` that takes a fraction of a second."""

PENDULUM_GAINS = {"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3}
PENDULUM_SIGNALS = tl.Signals(
    states=[
        tl.State("angle", "rad", scale=np.pi),
        tl.State("rate", "rad/s", scale=8.0, derivative_of="angle", envelope=(-12.0, 12.0)),
    ],
    commands=[tl.Command("torque", "N m", bounds=(-2.0, 2.0))],
    dt=0.05,
)
PENDULUM_CONTROLLER = tl.controllers.PID(
    axes=[("angle", "rate")],
    gains={"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)},
)


@pytest.fixture
def tiny():
    return dict(TINY)


@pytest.fixture
def quadrotor():
    return tl.systems.Quadrotor()


@pytest.fixture(scope="session")
def quadrotor_family():
    system = tl.systems.Quadrotor()
    return system.controller.bind(system.signals)


@pytest.fixture
def first_test(quadrotor, quadrotor_family):
    """The paper's Υ0."""
    return tl.Test(
        quadrotor_family,
        quadrotor_family.genes(quadrotor.default_gains),
        quadrotor.initial_state,
        quadrotor.target_state,
        100,
    )


@pytest.fixture(scope="session")
def pendulum_signals():
    return PENDULUM_SIGNALS


@pytest.fixture(scope="session")
def pendulum_controller():
    return PENDULUM_CONTROLLER


def pendulum_step(x, u):
    """One period of a pendulum of 0.3 kg and 0.4 m, in ten small steps."""
    angle, rate = x
    for _ in range(10):
        rate += 0.005 * (u[0] - 0.3 * 9.81 * 0.4 * np.sin(angle) - 0.05 * rate) / (0.3 * 0.4**2)
        angle += 0.005 * rate
    return angle, rate


@pytest.fixture
def pendulum(pendulum_signals):
    return tl.systems.Simulated(pendulum_signals, pendulum_step, default_gains=PENDULUM_GAINS)


@pytest.fixture
def new_campaign(pendulum_signals, pendulum_controller):
    """Makes campaigns of the preset `paper` on the pendulum."""

    def make(**changes):
        options = {**TINY, **changes.pop("options", {})}
        arguments = {
            "controller": pendulum_controller,
            "initial_state": [0.0, 0.0],
            "target_state": [1.0, 0.0],
            "duration": 1.0,
            "preset": "paper",
            "threads": 1,
            "options": options,
            **changes,
        }
        return tl.Campaign(arguments.pop("signals", pendulum_signals), **arguments)

    return make


@pytest.fixture(scope="session")
def rig():
    """Numbers of a system with two states, two commands and one derivative, for the engine."""
    return _core.Signals(0.1, [1.0, 2.0], [(-1.0, 1.0), (-3.0, 2.0)], [1.0, 4.0], [None, 0])


@pytest.fixture(scope="session")
def rig_family(rig):
    """A PID on the first state that moves both commands, one that differences the second state."""
    matrix, offset = [[1.0, 0.25], [0.5, -2.0]], [0.1, -0.2]
    return _core.Family.pid(rig, [(0, 1), (1, None)], [(0.0, 2.0, False)] * 6, (matrix, offset, 1.0))


def setting_of(signals, family, divergence_factor=10.0):
    """What the engine flies in."""
    return _core.Setting(_core.Limits(signals, divergence_factor), family)


@pytest.fixture(scope="session")
def rig_setting(rig, rig_family):
    """The rig with its controllers."""
    return setting_of(rig, rig_family)
