"""Noise of sensors: an angle that body rates turn shows its own by kinematics alone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from late_sensors import BODY, read, turning
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.sensors.chains import chains
from twinloop.identification.sensors.noise import KINEMATIC, given_noise, kinematic_noise

SCALES = np.array([state.scale for state in BODY.states])


def angles(signals, runs):
    """The chains of the three angles, with a first guess of their noise."""
    every = chains(signals, "acceleration", guessed_noise(runs, SCALES))
    found = [given_noise(chain, signals) for chain in every if chain.output is None]
    assert [chain.states for chain in found] == [(0,), (1,), (2,)]
    return found


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
def test_an_angle_that_body_rates_turn_shows_the_noise_of_its_sensor(noise):
    runs = [read(turning, BODY, seed, noise=noise, steps=400) for seed in (0, 1)]
    for chain in angles(BODY, runs):
        found = np.sqrt(kinematic_noise(chain, runs, BODY).sensors[0])
        assert found == pytest.approx(noise, rel=0.15), chain.states


def test_angles_without_noise_show_next_to_none():
    runs = [read(turning, BODY, 0, noise=0.0, steps=400)]
    for chain in angles(BODY, runs):
        assert np.sqrt(kinematic_noise(chain, runs, BODY).sensors[0]) < 1e-4


def test_one_wild_reading_of_an_angle_is_no_noise():
    run = read(turning, BODY, 0, noise=1e-3, steps=400)
    states = run.states.copy()
    states[200, 0] += 1.0
    wild = replace(run, states=states, smooth=states)
    chain = angles(BODY, [wild])[0]
    assert np.sqrt(kinematic_noise(chain, [wild], BODY).sensors[0]) == pytest.approx(1e-3, rel=0.3)


def test_what_is_declared_of_an_angles_sensor_is_where_its_noise_begins():
    runs = [read(turning, BODY, 0, noise=1e-2)]
    declared = replace(BODY, states=[replace(BODY.states[0], noise=5e-3), *BODY.states[1:]])
    first, second, _ = angles(declared, runs)
    assert np.sqrt(first.sensors[0]) == pytest.approx(5e-3)
    assert np.sqrt(second.sensors[0]) != pytest.approx(5e-3)


def swinging(seed, noise, walk, dt=0.01, steps=1500):
    """A body that swings about level, by SciPy's rotations; its angles drift by `walk` rad a period beside that."""
    signals, random = replace(BODY, dt=dt), np.random.default_rng(seed)
    t = dt * np.arange(steps + 1)

    def angles_at(t):
        return np.stack([0.2 * np.sin((2.0 + k) * t + k) for k in range(3)], axis=1)

    ahead, behind = (Rotation.from_euler("ZYX", angles_at(t + h)[:, ::-1]) for h in (5e-6, -5e-6))
    rates = (behind.inv() * ahead).as_rotvec() / 1e-5
    drift = np.cumsum(walk * random.standard_normal((steps + 1, 3)), axis=0)
    states = np.concatenate([angles_at(t) + drift, rates], axis=1)
    readings = states + noise * random.standard_normal(states.shape)
    return signals, Run.of(readings, np.zeros((steps, 3)))


@pytest.mark.parametrize(("noise", "walk"), [(1e-3, 1e-3), (1e-3, 5e-3), (1e-4, 1e-3)])
def test_what_adds_up_beside_the_rates_moves_the_angle_and_is_no_noise_of_its_sensor(noise, walk):
    signals, run = swinging(0, noise, walk)
    for chain in angles(signals, [run]):
        found = kinematic_noise(chain, [run], signals, noise * noise)
        # A roll that has drifted turns pitch and yaw into each other, which drifts, too.
        close = 0.1 if chain.states == (0,) else 0.4
        assert np.sqrt(found.motion.white * signals.dt) == pytest.approx(walk, rel=close), chain.states
        assert np.sqrt(found.sensors[0]) < 0.1 * walk + 1.2 * noise


@pytest.mark.parametrize("noise", [1e-5, 1e-4, 1e-2])
@pytest.mark.parametrize("dt", [0.01, 0.04])
def test_angles_whose_rates_are_only_noisy_and_read_now_and_then_do_not_drift(noise, dt):
    signals, run = swinging(1, noise, 0.0, dt)
    for chain in angles(signals, [run]):
        found = kinematic_noise(chain, [run], signals, noise * noise)
        assert found.motion.white * signals.dt == pytest.approx(KINEMATIC * found.sensors[0])
