"""Columns of a log that are exchanged, or have another sign or unit, are named by what rights their commands."""

from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from twinloop.campaign.data import righted
from twinloop.campaign.data.sent import OTHER, change_that_rights, other_commands, sent_and_asked
from twinloop.campaign.examination.log_check import against

TANK = tl.Signals(
    [tl.State("temp", "degC", 40.0), tl.State("level", "cm", 40.0)],
    [tl.Command("heater", "%", (0.0, 100.0)), tl.Command("pump", "%", (0.0, 100.0))],
    dt=2.0,
)
PID = tl.controllers.PID(
    axes=[("temp", None), ("level", None)],
    gains={"temp.kp": (0.0, 20.0), "temp.ki": (0.0, 1.0), "temp.kd": 0.0,
           "level.kp": (0.0, 20.0), "level.ki": (0.0, 1.0), "level.kd": 0.0},
)  # fmt: skip
GAINS = {"temp.kp": 2.0, "temp.ki": 0.02, "level.kp": 3.0, "level.ki": 0.05}


def tank(x, u):
    """A tank that is heated and filled, and leaks: its temperature and its level rise about equally fast."""
    temp, level = x
    heater, pump = u
    for _ in range(20):
        inflow = 0.01 * pump
        heated = 0.18 * heater / level - 0.004 * (temp - 18.0) - inflow / level * (temp - 15.0)
        temp, level = temp + 0.1 * heated, level + 0.1 * (inflow - 0.09 * np.sqrt(level))
    return temp, level


def flight(noise=0.05):
    """A first test with its excitation, as its controller flew it on noisy readings."""
    campaign = tl.Campaign(
        TANK, controller=PID, initial_state=[20.0, 20.0], target_state=[45.0, 35.0],
        duration=240.0, threads=1, progress=None,
    )  # fmt: skip
    test = campaign.test(GAINS)
    stream, controller, state = np.random.default_rng(0), test.controller(), np.array([20.0, 20.0])
    states, commands = [state + noise * stream.normal(size=2)], []
    for k in range(test.steps):
        commands.append(controller.command(states[-1], test.target(k)))
        state = np.array(tank(state, commands[-1]))
        states.append(state + noise * stream.normal(size=2))
    return test, np.array(states), np.array(commands)


TEST, STATES, COMMANDS = flight()


def recorded(states=STATES, commands=COMMANDS):
    """What was told of the flight."""
    run = tl.Trajectory(TANK.dt * np.arange(len(states)), states, commands)
    return SimpleNamespace(test=TEST, replayed=TEST, number=0, trajectory=run, off_start=())


def said(run):
    """What is said of the commands of a flight when it is told."""
    return [each.sentence for each in against(run, TEST, TANK) if each.code == "other-commands"]


def test_of_a_right_log_nothing_is_said():
    assert other_commands([recorded()]) == [] and change_that_rights(recorded()) == ""
    assert said(recorded()) == []
    # Of digits that were rounded away neither.
    assert said(recorded(np.round(STATES, 1), np.round(COMMANDS, 0))) == []


def test_two_states_exchanged_are_found_though_their_commands_are_off_by_little():
    wrong = recorded(STATES[:, ::-1])
    sent, asked = sent_and_asked(TEST, wrong.trajectory)
    off, size = np.square((sent - asked) / 100.0).mean(axis=0), np.var(asked / 100.0, axis=0)
    assert (off < OTHER * np.maximum(size, size.mean())).all(), "they are not far from what was asked for"
    assert other_commands([wrong]) == [0]
    (sentence,) = said(wrong)
    assert sentence.endswith("They would be with temp and level exchanged.")


@pytest.mark.parametrize(
    ("states", "commands", "words"),
    [
        ([1.0, 0.01], [1.0, 1.0], "level multiplied by about 100"),
        ([1000.0, 1.0], [1.0, 1.0], "temp divided by about 1000"),
        ([1.0, -1.0], [1.0, 1.0], "the sign of level changed"),
        ([1.0, 1.0], [0.01, 1.0], "heater multiplied by about 100"),
        ([1.0, 1.0], [1.0, -1.0], "the sign of pump changed"),
    ],
)
def test_another_unit_or_sign_is_named_and_no_exchange_that_explains_less(states, commands, words):
    (sentence,) = said(recorded(STATES * states, COMMANDS * commands))
    assert sentence.endswith(f"They would be with {words}.")


def test_exchanged_commands_are_named_as_before():
    (sentence,) = said(recorded(commands=COMMANDS[:, ::-1]))
    assert sentence.endswith("They would be with heater and pump exchanged.")


def test_commands_that_a_controller_would_have_held_at_their_bound_are_not_said_to_be_in_a_larger_unit():
    """In kelvin the heater would always be off: a heater that is divided by much is nearly off, too."""
    (sentence,) = said(recorded(STATES + np.array([273.15, 0.0])))
    assert "They would be" not in sentence


def test_a_column_that_hardly_moves_is_not_said_to_be_a_command_that_would_hardly_have_moved(monkeypatch):
    """Of a tank at 100 degrees the heater would have been off, and the level is near to that for a heater's."""
    calm = np.column_stack([STATES[:, 0] + 300.0, np.full(len(STATES), 2.0)])
    run = recorded(calm, np.column_stack([np.full(len(COMMANDS), 60.0), np.zeros(len(COMMANDS))]))

    assert change_that_rights(run) == ""

    monkeypatch.setattr(righted, "FOLLOWED", np.inf)
    assert change_that_rights(run) != ""


def test_of_what_no_change_of_a_column_explains_none_is_named():
    stream = np.random.default_rng(3)
    (sentence,) = said(recorded(commands=stream.uniform(0.0, 100.0, COMMANDS.shape)))
    assert "They would be" not in sentence


@pytest.mark.parametrize(
    ("rows", "words"), [(1, "the first row left out"), (12, "the first 12 rows left out")]
)
def test_a_log_that_began_before_the_flight_is_said_to(rows, words):
    stream = np.random.default_rng(1)
    rest = STATES[0] + 0.05 * stream.normal(size=(rows, 2))
    states, commands = np.vstack([rest, STATES])[: len(STATES)], np.vstack([np.zeros((rows, 2)), COMMANDS])
    wrong = recorded(states, commands[: len(COMMANDS)])
    assert change_that_rights(wrong) == words
    if other_commands([wrong]):
        (sentence,) = said(wrong)
        assert f"They would be with {words}." in sentence
    assert other_commands([wrong]) == [0] or rows == 1
