"""How the excitation of a test was flown, by its recorded commands: as the test says, in full, twice, or not at all."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from conftest import pendulum_step
from lives import SIGNALS
from oracles import same_bits
from twinloop._experiment.hold_back import HoldBack
from twinloop.campaign.campaign_file import read_file, template
from twinloop.campaign.data.excited import Excited, as_excited, excited
from twinloop.campaign.data.sent import other_commands
from twinloop.campaign.examination.log_check import against

TORQUE = SIGNALS.commands[0].bounds


@pytest.fixture(scope="module")
def test(tmp_path_factory):
    """The first test of a pendulum, held back so early that it matters."""
    file = tmp_path_factory.mktemp("rig") / "rig.toml"
    file.write_text(template("rig.db"), encoding="utf-8")
    campaign = read_file(file).campaign(threads=1)
    asked = campaign.test(read_file(file).first)
    assert asked.excitation is not None and asked.hold_back is not None
    # Held back from where the angle is near its target.
    return dataclasses.replace(asked, hold_back=HoldBack([[-0.5, 0.8], [-9, 9]], [[-1, 0.85], [-10, 10]]))


def flown(asked, how=Excited.HELD_BACK, noise=0.0):
    """The flight of a test by a program that treats its excitation in some way."""
    plant = tl.systems.Simulated(SIGNALS, pendulum_step, noise=noise, seed=1)
    run = plant.run(as_excited(asked, how))
    return SimpleNamespace(test=asked, replayed=asked, number=asked.number, trajectory=run, off_start=())


def sent(flight, change):
    """The same flight with other commands on record."""
    run = flight.trajectory
    other = tl.Trajectory(run.t, run.states, change(run.commands))
    return SimpleNamespace(
        test=flight.test, replayed=flight.test, number=flight.number, trajectory=other, off_start=()
    )


def codes(flight):
    return [(remark.code, remark.severity) for remark in against(flight, flight.test, SIGNALS)]


def seen(flight):
    return excited(flight.test, flight.trajectory)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_how_an_excitation_was_flown_is_seen_in_the_commands(test, noise):
    for how in Excited:
        flight = flown(test, how, noise)
        assert seen(flight) is how and other_commands([flight]) == []
    assert ("excitation", "note") in codes(flown(test, Excited.NOT, noise))
    assert ("excitation", "serious") in codes(flown(test, Excited.WHOLE, noise))
    assert ("excitation", "serious") in codes(flown(test, Excited.TWICE, noise))
    assert ("excitation", "note") in codes(flown(test, Excited.NEGATED, noise))
    assert "excitation" not in dict(codes(flown(test, noise=noise)))


def late(periods):
    return lambda commands: np.concatenate([np.repeat(commands[:1], periods, axis=0), commands[:-periods]])


def in_pulses(commands):
    owed, pulses = 0.0, []
    for command in commands[:, 0]:
        owed += command
        pulses.append(TORQUE[1] if owed > 0.0 else TORQUE[0])
        owed -= pulses[-1]
    return np.array(pulses)[:, None]


@pytest.mark.parametrize(
    "change",
    [
        *(late(periods) for periods in (1, 2, 5)),
        lambda commands: np.clip(commands, -0.5, 0.5),
        lambda commands: 0.1 * np.round(commands / 0.1),
        lambda commands: 0.8 * commands,
        lambda commands: commands + 0.05 * np.random.default_rng(2).standard_normal(commands.shape),
        lambda commands: -commands,
        in_pulses,
    ],
    ids=["late", "later", "late by five", "clipped", "rounded", "weaker", "noisy", "other sign", "pulses"],
)
def test_other_faults_of_commands_are_no_other_excitation(test, change):
    assert seen(sent(flown(test, noise=0.01), change)) is Excited.HELD_BACK


def test_where_the_excitation_was_flown_otherwise_small_faults_hide_nothing(test):
    for how in (Excited.NOT, Excited.WHOLE):
        assert seen(sent(flown(test, how), lambda commands: 0.02 * np.round(commands / 0.02))) is how


def test_a_program_that_adds_the_excitation_to_commands_that_have_it_is_seen(test):
    asked = dataclasses.replace(test, hold_back=None)
    controller = asked.controller()
    controller.reset()
    states, commands = [asked.initial_state], []
    for k in range(asked.steps):
        twice = controller.command(states[-1], asked.target(k)) + asked.excitation[k]
        commands.append(np.clip(twice, *TORQUE))
        states.append(pendulum_step(states[-1], commands[-1]))
    run = tl.Trajectory(SIGNALS.dt * np.arange(asked.steps + 1), np.array(states), np.array(commands))
    flight = SimpleNamespace(test=asked, replayed=asked, number=asked.number, trajectory=run, off_start=())
    assert seen(flight) is Excited.TWICE and other_commands([flight]) == []


def saturated(asked):
    """A flight far from its target: whatever a program adds before the bounds clip, the torque stays at its bound."""
    rows = np.arange(asked.steps + 1)
    states = np.column_stack([asked.target_state[0] - 8.0 + 0.01 * rows, np.full(len(rows), 0.2)])
    run = tl.Trajectory(SIGNALS.dt * rows, states, np.full((asked.steps, 1), TORQUE[1]))
    own = dataclasses.replace(asked, initial_state=states[0], hold_back=None, predicted=1.0)
    return SimpleNamespace(test=own, replayed=own, number=own.number, trajectory=run, off_start=())


def test_what_bounds_hide_was_not_left_out(test):
    flight = saturated(test)
    (said,) = [each for each in against(flight, flight.test, SIGNALS) if each.code == "excitation"]
    assert said.sentence.startswith(
        "Nothing is seen of the excitation of test 0: the commands were at their bounds"
    )
    assert other_commands([flight]) == []


def test_a_flight_whose_excitation_is_hidden_counts_as_it_was_asked_for(tmp_path):
    file = tmp_path / "rig.toml"
    file.write_text(template("rig.db"), encoding="utf-8")
    campaign = read_file(file).campaign(threads=1)
    flight = saturated(campaign.test(read_file(file).first))
    campaign._book.tests[0] = flight.test
    campaign.tell(flight.test, flight.trajectory)
    (run,) = campaign.experiments
    assert run.test.excitation is None and run.test.predicted == 1.0  # replayed as sent, with its prediction
    assert "Test 0: Gains of your own, gently excited." in str(campaign)


def test_a_test_without_an_excitation_has_none_that_could_be_left_out(test):
    flight = flown(test.quiet())
    assert seen(flight) is Excited.HELD_BACK and codes(flight) == []
    assert (
        codes(
            SimpleNamespace(test=None, replayed=None, number=None, trajectory=flight.trajectory, off_start=())
        )
        == []
    )


def test_tests_that_are_held_back_nowhere_are_flown_whole_and_as_they_say(test):
    whole = dataclasses.replace(test, hold_back=None)
    assert seen(flown(whole)) is Excited.HELD_BACK
    assert seen(flown(whole, Excited.NOT)) is Excited.NOT


def told(campaign, first, how):
    """A campaign that was told one flight, whose test is held back so early that it matters."""
    asked = campaign.test(first)
    tight = HoldBack([[-0.5, 0.8], [-9, 9]], [[-1, 0.85], [-10, 10]])
    own = dataclasses.replace(asked, hold_back=tight, predicted=1.0)
    campaign._book.tests[asked.number] = own
    campaign.tell(own, flown(own, how, noise=0.001).trajectory)
    return campaign


@pytest.mark.parametrize("how", Excited)
def test_a_flight_counts_as_it_was_flown(how, tmp_path):
    file = tmp_path / "rig.toml"
    file.write_text(template("rig.db"), encoding="utf-8")
    campaign = told(read_file(file).campaign(threads=1), read_file(file).first, how)
    asked, (run,) = campaign.tests[0], campaign.experiments
    assert run.number == 0 and campaign.status(asked) == "flown"
    assert asked.excitation is not None and asked.hold_back is not None
    assert (run.test.excitation is None) == (how is Excited.NOT)
    assert (run.test.hold_back is not None) == (how in (Excited.HELD_BACK, Excited.NEGATED))
    # What was predicted is the quality of the flight that was asked for.
    assert run.test.predicted == (1.0 if how is Excited.HELD_BACK else None)
    # So its own commands, and no others, are those of the record.
    controller = run.test.controller()
    controller.reset()
    again = [
        controller.command(state, run.test.target(k)) for k, state in enumerate(run.trajectory.states[:-1])
    ]
    assert np.abs(np.array(again) - run.trajectory.commands).max() < 0.02 * (TORQUE[1] - TORQUE[0])
    # The record keeps what was asked for.
    kept = tl.Campaign.from_record(campaign.to_record())
    assert same_bits(kept.tests[0].excitation, asked.excitation) and kept.tests[0].predicted == 1.0
    assert (kept.experiments[0].test.hold_back is None) == (run.test.hold_back is None)
