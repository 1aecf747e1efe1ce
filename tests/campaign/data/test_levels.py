"""Levels: found where a relay sends the one that is nearest, and then predictions come true."""

from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from lives import THOROUGH
from twinloop.campaign.data.levels import levels_of

DT, STEPS = 0.5, 120
SIGNALS = tl.Signals([tl.State("warmth", "K", 20.0)], [tl.Command("heat", "1", (0.0, 1.0))], DT)
FAMILY = tl.controllers.PID(
    axes=[("warmth", None)],
    gains={"warmth.kp": (0.01, 0.5), "warmth.ki": (0.0, 0.1), "warmth.kd": (0.0, 1.0)},
)
FIRST = {"warmth.kp": 0.03, "warmth.ki": 0.0, "warmth.kd": 0.0}


def relay(*levels):
    """Sends the level that is nearest."""
    return lambda wanted: min(levels, key=lambda level: (abs(level - wanted), level))


def modulated():
    """Sends 0 or 1, and carries what that leaves on to the next command."""
    left = [0.0]

    def send(wanted):
        left[0] += wanted
        sent = float(left[0] > 0.5)
        left[0] -= sent
        return sent

    return send


def heated(test, send, seed=0):
    """A flight of d warmth / dt = 2 heat - 0.02 warmth, whose heater sends what `send` makes of each command."""
    controller, random = test.controller(), np.random.default_rng([seed, test.number])
    controller.reset()
    warmth = float(test.initial_state[0])
    states, sent = [[warmth]], []
    for k in range(test.steps):
        heat = send(float(controller.command(np.array(states[-1]), test.target(k))[0]))
        warmth = 100.0 * heat + (warmth - 100.0 * heat) * np.exp(-0.02 * DT)
        states.append([warmth + 0.05 * random.standard_normal()])
        sent.append([heat])
    return tl.Trajectory(DT * np.arange(test.steps + 1), np.array(states), np.array(sent))


def flight(send, gains=FIRST):
    bound = FAMILY.bind(SIGNALS)
    test = tl.Test(bound, bound.genes(gains), [0.0], [30.0], STEPS, number=0)
    return SimpleNamespace(test=test, number=0, trajectory=heated(test, send))


@pytest.mark.parametrize("levels", [(0.0, 1.0), (0.0, 0.3, 0.6, 1.0)])
def test_the_levels_of_a_relay_are_found(levels):
    assert levels_of([flight(relay(*levels))], SIGNALS) == (levels,)


def test_commands_that_are_sent_as_they_are_or_keep_their_mean_have_none():
    assert levels_of([flight(lambda wanted: wanted)], SIGNALS) == ()
    assert levels_of([flight(modulated())], SIGNALS) == ()
    # At or beyond its bounds in most periods: 19 of 20 pulses are the nearest level.
    assert levels_of([flight(modulated(), {**FIRST, "warmth.kp": 0.4, "warmth.kd": 0.5})], SIGNALS) == ()
    # At its bounds most of the time, with next to nothing in between.
    assert levels_of([flight(lambda wanted: wanted, {**FIRST, "warmth.kp": 0.5})], SIGNALS) == ()
    assert levels_of([SimpleNamespace(test=None, trajectory=None)], SIGNALS) == ()


def test_predictions_of_a_heater_with_a_relay_come_true():
    campaign = tl.Campaign(
        SIGNALS, controller=FAMILY, initial_state=[0.0], target_state=[30.0], duration=DT * STEPS,
        options=THOROUGH, progress=None,
    )  # fmt: skip
    test = campaign.test(FIRST)
    for _ in range(3):
        campaign.tell(test, heated(test, relay(0.0, 1.0)))
        test = campaign.ask()
    assert campaign.twin.model.levels == [[0.0, 1.0]]
    assert "levels" in [remark.code for remark in campaign.twin.remarks]
    assert not [remark for remark in campaign.twin.remarks if remark.severity == "serious"]
    for run in campaign.experiments[2:]:
        assert abs(run.test.predicted - run.quality) < 0.01 * run.quality
    again = tl.Campaign.from_record(campaign.to_record())
    assert again.twin.model.levels == [[0.0, 1.0]] and again.ask().genes.tolist() == test.genes.tolist()
