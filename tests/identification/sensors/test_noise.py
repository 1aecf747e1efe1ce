"""Noise of sensors: an angle that body rates turn shows its own by kinematics alone."""

from dataclasses import replace

import numpy as np
import pytest

from late_sensors import BODY, read, turning
from twinloop.identification.records import guessed_noise
from twinloop.identification.sensors.chains import chains
from twinloop.identification.sensors.noise import given_noise, kinematic_noise

SCALES = np.array([state.scale for state in BODY.states])


def angles(signals, runs):
    """The chains of the three angles, with a first guess of their noise."""
    every = chains(signals, "acceleration", guessed_noise(runs, SCALES))
    return [given_noise(chain, signals) for chain in every if chain.output is None]


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
