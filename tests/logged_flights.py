"""Flights of tests of the pendulum and the quadrotor, as logs have them, for checks of recorded commands."""

from hypothesis import strategies as st

import twinloop as tl
from conftest import PENDULUM_CONTROLLER, PENDULUM_SIGNALS, TINY, pendulum_step
from lives import SMALL

LOW, HIGH = PENDULUM_SIGNALS.commands[0].bounds
GAINS = {"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3}


def new_campaign(preset="default", **options):
    return tl.Campaign(
        PENDULUM_SIGNALS, controller=PENDULUM_CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0],
        duration=2.0, threads=1, preset=preset, options={**(TINY if preset == "paper" else SMALL), **options},
    )  # fmt: skip


def asked(gains=GAINS, quiet=False):
    test = new_campaign().test(gains)
    return test.quiet() if quiet else test


def flown(test, noise=1e-3, seed=0):
    return tl.systems.Simulated(PENDULUM_SIGNALS, pendulum_step, noise=noise, seed=seed).run(test)


places = st.floats(0.1, 0.9)
anywhere = {
    "place": st.tuples(places, places, places),
    "seed": st.integers(0, 99),
    "noise": st.sampled_from([0.0, 1e-3, 2e-2]),
    "quiet": st.booleans(),
}
"""A flight of a test from anywhere in the box of gains: arguments of `asked_at` and `flown`."""


def asked_at(place, quiet):
    """The test of a place in the box of gains."""
    return asked(PENDULUM_CONTROLLER.bind(PENDULUM_SIGNALS).from_unit(place), quiet)


def of_quadrotor(noise=0.0):
    """The first test of the quadrotor, with its flight."""
    system = tl.systems.Quadrotor(noise=noise)
    campaign = tl.Campaign(
        system.signals, controller=system.controller, initial_state=system.initial_state,
        target_state=system.target_state, duration=system.duration, progress=None,
    )  # fmt: skip
    test = campaign.test(system.default_gains)
    return test, system.run(test)
