"""Commands that are recorded in other rows than the readings that they were computed from, and no other fault."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import twinloop as tl
from conftest import PENDULUM_SIGNALS, pendulum_step
from logged_flights import GAINS, HIGH, LOW, anywhere, asked, asked_at, flown, new_campaign, of_quadrotor
from twinloop.campaign.data.rows import MOST, late_commands
from twinloop.errors import RemarkWarning


def moved(values, rows):
    """Values that come so many rows later; at the ends the first or last one stays."""
    return values[np.clip(np.arange(len(values)) - rows, 0, len(values) - 1)]


def changed(run, commands=lambda u: u, states=lambda x: x):
    return tl.Trajectory(run.t, states(run.states), np.clip(commands(run.commands), LOW, HIGH))


@settings(deadline=None, max_examples=25)
@given(**anywhere)
def test_commands_in_their_own_rows_are_never_accused(place, seed, noise, quiet):
    test = asked_at(place, quiet)
    assert late_commands(test, flown(test, noise, seed)) == (0,)


@settings(deadline=None, max_examples=25)
@given(
    st.integers(-MOST, MOST), st.integers(0, 99), st.sampled_from([0.0, 1e-3, 1e-2]), st.sampled_from([6, 17]),
    st.booleans(),
)  # fmt: skip
def test_commands_that_are_some_rows_away_are_found_there(rows, seed, noise, digits, quiet):
    test = asked(quiet=quiet)
    run = changed(flown(test, noise, seed), lambda u: np.round(moved(u, rows), digits))
    assert late_commands(test, run) == (rows,)


def test_so_they_are_where_the_excitation_was_not_flown_and_where_a_single_command_of_four_is():
    test = asked()
    run = flown(test.quiet())
    assert late_commands(test, changed(run, lambda u: moved(u, 1))) == (1,)
    test, run = of_quadrotor(noise=1e-3)
    assert late_commands(test, run) == (0, 0, 0, 0)
    commands = run.commands.copy()
    commands[:, 2] = moved(commands[:, 2], 2)
    assert late_commands(test, tl.Trajectory(run.t, run.states, commands)) == (0, 0, 2, 0)


def filtered(values, kept):
    slow = values.copy()
    for k in range(1, len(slow)):
        slow[k] = kept * slow[k - 1] + (1.0 - kept) * values[k]
    return slow


def one_is_off(commands):
    """A command that is off in one row: elsewhere all rows are alike in what is constant."""
    commands = np.full_like(commands, 0.5)
    commands[0] = 1.0
    return commands


OTHER_FAULTS = {
    "slow": {"commands": lambda u: filtered(u, 0.5)},
    "coarse": {"commands": lambda u: 0.5 * np.round(u / 0.5)},
    "trimmed": {"commands": lambda u: u + 0.2},
    "noisy": {"commands": lambda u: u + 0.05 * np.random.default_rng(1).standard_normal(u.shape)},
    "another sign": {"commands": lambda u: -u},
    "one is off": {"commands": one_is_off},
    "constant": {"commands": lambda u: np.full_like(u, 0.5)},
    "half a row": {"commands": lambda u: 0.5 * (u + moved(u, 1))},
    "filtered readings": {"states": lambda x: filtered(x, 0.5)},
    "a late angle": {"states": lambda x: np.column_stack([moved(x[:, 0], 1), x[:, 1]])},
    "noise of the log's own": {
        "states": lambda x: x + np.random.default_rng(2).standard_normal(x.shape) * [0.01, 0.1]
    },
}  # fmt: skip


@pytest.mark.parametrize("quiet", [True, False])
@pytest.mark.parametrize("fault", OTHER_FAULTS)
def test_no_other_fault_is_taken_for_other_rows(fault, quiet):
    test = asked(quiet=quiet)
    assert late_commands(test, changed(flown(test), **OTHER_FAULTS[fault])) == (0,)


def test_commands_at_rest_and_a_few_rows_tell_nothing():
    test = asked(quiet=True)
    run = flown(test)
    still = dataclasses.replace(run, states=np.tile(run.states[:1], (len(run.t), 1)))
    assert late_commands(test, dataclasses.replace(still, commands=np.zeros_like(run.commands))) == (0,)
    short = tl.Trajectory(run.t[:21], run.states[:21], moved(run.commands, 1)[:20])
    assert late_commands(test, short) == (0,)


def sent_late(test, seed=0):
    """The flight of a program that sends each command a period after its reading: as sent, and as computed."""
    stream, controller, state = np.random.default_rng(seed), test.controller(), test.initial_state
    controller.reset()
    read, computed = [], [np.zeros(1)]
    for k in range(test.steps + 1):
        read.append(state + 1e-3 * stream.standard_normal(2))
        if k < test.steps:
            computed.append(controller.command(read[-1], test.target(k)))
            state = pendulum_step(state, computed[-2])
    t = PENDULUM_SIGNALS.dt * np.arange(test.steps + 1)
    return [tl.Trajectory(t, np.array(read), np.array(sent)) for sent in (computed[:-1], computed[1:])]


def test_a_program_that_sends_late_is_told_what_makes_its_law_exact():
    campaign = new_campaign(lags=True)
    test = campaign.test(GAINS)
    as_sent, as_computed = sent_late(test)
    with pytest.warns(
        RemarkWarning, match=r"torque of test 0 is recorded 1 row late: .* up by 1 row, .*\(commands-late\)"
    ):
        campaign.tell(test, as_sent)
    said = {remark.code: remark.severity for remark in campaign.twin.remarks}
    assert said["commands-late"] == "serious" and "other-commands" not in said
    campaign.withdraw(test, "a row late")
    campaign.tell(test, as_computed)
    assert "commands-late" not in {remark.code for remark in campaign.twin.remarks}
    assert campaign.twin.law.actuation.actuators[0].delay == 1
    assert campaign.twin.errors[0].normalised < 1e-3


def test_a_row_early_and_several_flights_are_one_remark():
    campaign = new_campaign()
    for gains in (GAINS, {**GAINS, "angle.kp": 3.0}):
        test = campaign.test(gains)
        with pytest.warns(
            RemarkWarning, match=r"2 rows early: .* row k \+ 2\. .* down by 2 rows.*\(commands-early\)"
        ):
            campaign.tell(test, changed(flown(test), lambda u: moved(u, -2)))
    (remark,) = (remark for remark in campaign.twin.remarks if remark.code == "commands-early")
    assert remark.sentence.startswith("torque of tests 0, 1 is recorded 2 rows early")
