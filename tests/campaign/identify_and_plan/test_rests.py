"""Where actuators may rest before a run: what a family sends at its target, and what logs of nobody's lie around."""

import numpy as np
import pytest

import twinloop as tl
from lives import begun, by_hand, made
from twinloop.campaign.identify_and_plan.rests import resting_commands

LIFTER = tl.Signals(
    [tl.State("height", "m", 2.0), tl.State("climb", "m/s", 2.0, derivative_of="height")],
    [tl.Command("thrust", "N", (0.0, 30.0))],
    0.02,
)
MASS, GRAVITY, DRAG, LAG = 1.5, 9.81, 0.3, 0.1
HOVER = MASS * GRAVITY


def hovered(seed: int, target: float) -> tl.Trajectory:
    """A log that begins in hover, with a step of the target: the rotor lags, and the first command is no hover."""
    stream = np.random.default_rng(seed)
    state, thrust, integral = np.zeros(2), HOVER, 0.0
    readings, commands = [], []
    for _ in range(151):
        reading = state + np.array([0.002, 0.01]) * stream.standard_normal(2)
        integral += 0.02 * (target - reading[0])
        command = HOVER + 6.0 * (target - reading[0]) + integral - 5.0 * reading[1]
        readings.append(reading)
        commands.append([np.clip(command, 0.0, 30.0)])
        for _ in range(20):
            thrust += (1.0 - np.exp(-0.001 / LAG)) * (commands[-1][0] - thrust)
            pull = thrust / MASS - GRAVITY - DRAG * state[1]
            state = state + 0.001 * np.array([state[1] + 0.0005 * pull, pull])
    return tl.Trajectory(0.02 * np.arange(151), np.array(readings), np.array(commands)[:-1])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_lag_is_found_from_logs_that_begin_in_hover(seed):
    twin = tl.identify([hovered(10 * seed, 1.0), hovered(10 * seed + 1, -0.8)], LIFTER)
    (actuator,) = twin.law.actuation.actuators
    assert actuator.delay == 0 and actuator.lag == pytest.approx(LAG, rel=0.05)
    assert actuator.rest == pytest.approx(HOVER, rel=0.01)
    assert twin.follows and not any(remark.serious for remark in twin.remarks)


def test_a_flight_of_a_test_rests_where_its_own_controller_does():
    campaign = begun()
    (rest,) = resting_commands(campaign.setup, campaign.experiments)
    np.testing.assert_array_equal(rest, [0.0])


@pytest.mark.parametrize(("around", "rests"), [(0.01, 1), (1.2, 2)])
def test_logs_add_what_they_lie_around_where_the_family_sends_something_else(around, rests):
    campaign, log = made(), by_hand(31)
    off = around - np.median(log.commands, axis=0)
    campaign.attach(tl.Trajectory(log.t, log.states, (log.commands + off).clip(-2.0, 2.0)))
    found = resting_commands(campaign.setup, campaign.experiments)
    assert len(found) == rests and found[0] == [0.0]
    assert rests == 1 or found[1] == pytest.approx([around])
