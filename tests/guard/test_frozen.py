"""Frozen sensors: of any noise, of ones that round, and healthy ones that stand still."""

import numpy as np
import pytest

import twinloop as tl
from twinloop.guard.sensors import SensorWatch

SIGNALS = tl.Signals(
    [tl.State("level", "cm", scale=40.0, envelope=(5.0, 60.0))],
    [tl.Command("pump", "%", bounds=(0.0, 100.0))],
    dt=2.0,
)
PI = tl.controllers.PID(
    axes=[("level", None)],
    gains={"level.kp": (0.0, 20.0), "level.ki": (0.0, 1.0), "level.kd": 0.0},
)
GAINS = {"level.kp": 10.0, "level.ki": 0.2, "level.kd": 0.0}
TARGET = np.array([35.0])


def flown(command, steps, seed, pitch=0.0, frozen_from=None):
    """Readings, commands and true levels of a tank with an outlet."""
    random, level = np.random.default_rng(seed), 20.0
    readings, commands, levels = [], [], [level]
    for k in range(steps + 1):
        reading = level + 0.05 * random.normal()
        if pitch:
            reading = pitch * np.round(reading / pitch)
        if frozen_from is not None and k >= frozen_from:
            reading = 34.8  # as noise has it now and then, and a counter, too
        readings.append([reading])
        if k < steps:
            commands.append(command(np.array([reading]), TARGET))
            level += 2.0 * (0.012 * float(commands[-1][0]) - 0.08 * np.sqrt(level))
            levels.append(level)
    return np.array(readings), np.array(commands), np.array(levels)


def learnt(pitch):
    campaign = tl.Campaign(
        SIGNALS, controller=PI, initial_state=[20.0], target_state=TARGET, duration=600.0, threads=1
    )
    test = campaign.test(GAINS)
    readings, commands, _ = flown(test.controller().command, test.steps, 100, pitch)
    campaign.tell(test, tl.Trajectory(2.0 * np.arange(len(readings)), readings, commands))
    return campaign


@pytest.fixture(scope="module", params=[0.0, 0.02, 0.1], ids=["noisy", "rounded finely", "rounded"])
def rig(request):
    """A campaign that has learnt one flight, and what its sensor rounds to."""
    return learnt(request.param), request.param


def test_a_frozen_sensor_ends_the_flight_before_the_level_has_left_its_envelope(rig):
    campaign, pitch = rig
    test = campaign.test(GAINS, excitation=None)
    for seed in range(6):
        guard = campaign.guard(test, clock=None)
        _, _, levels = flown(guard.command, test.steps, seed, pitch, frozen_from=130)
        assert guard.tripped and (levels > 5.0).all() and (levels < 45.0).all()
        if pitch:
            assert (
                135 < guard.tripped_at < 250
                and "not changed for too long, though by the twin" in guard.reason
            )
        else:
            assert guard.tripped_at == 135 and "level has not changed in its last bit" in guard.reason


def test_a_healthy_sensor_ends_no_flight_however_long_it_stands_still(rig):
    campaign, pitch = rig
    test = campaign.test(GAINS, excitation=None)
    for seed in range(20, 32):
        guard = campaign.guard(test, clock=None)
        flown(guard.command, test.steps, seed, pitch)
        assert not guard.tripped, guard.reason


def test_every_single_flight_of_a_sensor_that_does_not_round_lets_it_be_watched():
    for seed in range(40):
        random = np.random.default_rng(seed)
        settling = 35.0 - 15.0 * np.exp(-np.arange(501) / 30.0)[:, np.newaxis]
        readings = settling + 0.05 * random.normal(size=(501, 2))
        flight = tl.Trajectory(2.0 * np.arange(501), readings, np.zeros((500, 1)))
        watch = SensorWatch(np.full(2, 1e3), [flight], read=[0, 1], banded=True, noise=np.full(2, 0.05))
        assert watch.watched.all() and not watch.pitches.any()


def test_a_log_with_few_decimals_is_no_sensor_that_rounds():
    readings = np.round(35.0 + 0.05 * np.random.default_rng(1).normal(size=(501, 1)), 3)
    flight = tl.Trajectory(2.0 * np.arange(501), readings, np.zeros((500, 1)))
    noisy, exact = (
        SensorWatch(np.full(1, 1e3), [flight], read=[0], banded=True, noise=np.array([noise]))
        for noise in (0.05, 1e-4)
    )
    assert noisy.watched.all() and not exact.watched.any()
