"""Which gains a test was flown with, by its recorded commands; and that no other fault is taken for other gains."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import twinloop as tl
from conftest import PENDULUM_CONTROLLER, PENDULUM_SIGNALS
from logged_flights import GAINS, HIGH, LOW, anywhere, asked, asked_at, flown, new_campaign
from twinloop.campaign import standing
from twinloop.campaign.data.gains import flown_otherwise
from twinloop.errors import RemarkWarning
from twinloop.faces.result import summary


def run(test, factor=1.0, noise=1e-3, seed=0):
    """The flight of a test with all or some of its gains multiplied."""
    return flown(dataclasses.replace(test, genes=test.genes * factor), noise, seed)


def found(test, flight, controller=PENDULUM_CONTROLLER):
    otherwise = flown_otherwise(test, flight, controller)
    return None if otherwise is None else otherwise.genes


@settings(deadline=None, max_examples=25)
@given(**anywhere)
def test_a_flight_with_the_gains_that_were_asked_for_is_never_accused(place, seed, noise, quiet):
    test = asked_at(place, quiet)
    assert found(test, run(test, noise=noise, seed=seed)) is None


@settings(deadline=None, max_examples=25)
@given(
    st.lists(st.sampled_from([0.5, 0.8, 1.0, 1.4]), min_size=3, max_size=3),
    st.integers(0, 99),
    st.sampled_from([0.0, 1e-3, 1e-2]),
    st.booleans(),
)
def test_other_gains_are_read_off_the_commands_or_nothing_is_said(factors, seed, noise, quiet):
    test = asked(quiet=quiet)
    genes = found(test, run(test, factors, noise, seed))
    assert genes is None or genes == pytest.approx(test.genes * factors, rel=1e-3)
    if factors[0] != 1.0 and noise:
        assert genes is not None


@pytest.mark.parametrize("excited", [True, False])
def test_so_they_are_where_the_excitation_was_left_out_and_readings_are_of_32_bits(excited):
    test = asked()
    flight = run(test if excited else test.quiet(), 0.6)
    rounded = tl.Trajectory(
        flight.t,
        flight.states.astype(np.float32).astype(float),
        flight.commands.astype(np.float32).astype(float),
    )
    assert found(test, rounded) == pytest.approx(0.6 * test.genes, rel=1e-3)


def late(values, periods):
    return np.concatenate([np.repeat(values[:1], periods, axis=0), values[:-periods]])


def filtered(values, kept):
    slow = values.copy()
    for k in range(1, len(slow)):
        slow[k] = kept * slow[k - 1] + (1.0 - kept) * values[k]
    return slow


def in_pulses(commands):
    owed, pulses = 0.0, []
    for command in commands[:, 0]:
        owed += command
        pulses.append(HIGH if owed > 0.0 else LOW)
        owed -= pulses[-1]
    return np.array(pulses)[:, np.newaxis]


OF_COMMANDS = {
    "late": lambda u: late(u, 1),
    "later": lambda u: late(u, 3),
    "slow": lambda u: filtered(u, 0.5),
    "rounded": lambda u: 0.1 * np.round(u / 0.1),
    "coarse": lambda u: 0.5 * np.round(u / 0.5),
    "pulses": in_pulses,
    "trimmed": lambda u: u + 0.2,
    "noisy": lambda u: u + 0.05 * np.random.default_rng(1).standard_normal(u.shape),
    "narrow": lambda u: np.clip(u, -0.6, 0.6),
}
OF_READINGS = {
    "late": lambda x: late(x, 1),
    "filtered": lambda x: filtered(x, 0.5),
    "a filtered rate": lambda x: np.column_stack([x[:, 0], filtered(x[:, 1], 0.6)]),
    "noise of the log's own": lambda x: x + np.random.default_rng(2).standard_normal(x.shape) * [0.01, 0.1],
    "a noisy rate": lambda x: x + np.random.default_rng(2).standard_normal(x.shape) * [0.0, 1.0],
    "between two": lambda x: np.concatenate([x[:1], 0.5 * (x[1:] + x[:-1])]),
    "biased": lambda x: x + np.array([0.02, 0.1]),
}


@pytest.mark.parametrize("quiet", [True, False])
@pytest.mark.parametrize("gains", [GAINS, {"angle.kp": 5.3, "angle.ki": 1.8, "angle.kd": 0.56}])
@pytest.mark.parametrize("fault", OF_COMMANDS)
def test_no_other_fault_of_commands_is_taken_for_other_gains(fault, gains, quiet):
    test = asked(gains, quiet)
    flight = run(test)
    changed = np.clip(OF_COMMANDS[fault](flight.commands), LOW, HIGH)
    assert found(test, tl.Trajectory(flight.t, flight.states, changed)) is None


@pytest.mark.parametrize("quiet", [True, False])
@pytest.mark.parametrize("gains", [GAINS, {"angle.kp": 5.3, "angle.ki": 1.8, "angle.kd": 0.56}])
@pytest.mark.parametrize("fault", OF_READINGS)
def test_nor_are_readings_that_the_controller_did_not_see_so(fault, gains, quiet):
    test = asked(gains, quiet)
    flight = run(test)
    assert found(test, tl.Trajectory(flight.t, OF_READINGS[fault](flight.states), flight.commands)) is None


def test_a_wrong_sign_is_no_other_gains():
    test = asked()
    flight = run(test)
    assert found(test, tl.Trajectory(flight.t, flight.states, -flight.commands)) is None


def test_one_gain_of_nine_behind_a_mixer_is_found():
    system = tl.systems.Quadrotor(noise=1e-3)
    campaign = tl.Campaign(
        system.signals, controller=system.controller, initial_state=system.initial_state,
        target_state=system.target_state, duration=system.duration, progress=None,
    )  # fmt: skip
    test = campaign.test(system.default_gains)
    assert found(test, system.run(test), system.controller) is None
    genes = test.genes.copy()
    genes[0] *= 0.5
    flown = system.run(dataclasses.replace(test, genes=genes))
    assert found(test, flown, system.controller) == pytest.approx(genes, rel=1e-6, abs=1e-9)


def test_so_it_is_of_a_state_feedback_and_nothing_is_said_of_a_law_that_is_not_linear_in_its_gains():
    feedback = tl.controllers.StateFeedback(["angle", "rate"], (0.0, 6.0), integral=["angle"])
    family = feedback.bind(PENDULUM_SIGNALS)
    test = tl.Test(family, np.array([3.0, 0.4, 1.0]), [0.0, 0.0], [1.0, 0.0], 40)
    assert found(test, run(test), feedback) is None
    assert found(test, run(test, [0.7, 1.0, 1.5]), feedback) == pytest.approx(test.genes * [0.7, 1.0, 1.5])
    cascade = tl.controllers.Cascade(
        [("angle", "rate")],
        {"angle.kp": (0.0, 9.0), "rate.kp": (0.0, 3.0), "rate.ki": (0.0, 3.0), "rate.kd": 0.0},
    )
    assert flown_otherwise(test, run(test, 0.5), cascade) is None


def told(campaign, factor=0.7):
    test = campaign.test(GAINS)
    with pytest.warns(RemarkWarning, match=r"angle\.kp about 1\.4 for 2, .* \(other-gains\)") as said:
        campaign.tell(test, run(test, factor))
    assert said[0].filename == __file__
    return test


def test_such_a_flight_counts_under_its_commands_and_for_no_gains():
    campaign = new_campaign()
    test = told(campaign)
    (flight,) = campaign.experiments
    assert flight.test is None and flight.number == 0 and not flight.attached and flight.complete
    assert flight.quality is None and flight.before is None
    assert campaign.status(test) == "flown" and campaign.runs == 1 and not campaign.waiting
    assert campaign.cost.runs == 1 and campaign.cost.attached == 0 and campaign.cost.best is None
    # The twin is held against the commands that were sent, so it is right.
    codes = {remark.code: remark.severity for remark in campaign.twin.remarks}
    assert codes["other-gains"] == "serious" and "free-run" not in codes
    assert campaign.twin.errors[0].test == 0 and campaign.twin.errors[0].normalised < 0.01
    # Nothing is held against the gains that were asked for, and once they fly the fault is mended.
    assert not campaign._book.first(1).tests[0].same_as(campaign.ask())
    campaign.tell(test, run(test))
    assert [each.test is None for each in campaign.experiments] == [True, False]
    assert campaign.experiments[1].quality is not None and campaign.best_test.number is not None
    assert {each.code: each.severity for each in campaign.twin.remarks}["other-gains"] == "note"
    assert summary(campaign, {}, {})["experiments"][0]["test"] == 0


def test_the_record_keeps_what_was_told_and_it_can_be_withdrawn():
    campaign = new_campaign()
    test = told(campaign)
    kept = tl.Campaign.from_record(campaign.to_record())
    assert kept.experiments[0].test is None and kept.experiments[0].number == 0
    np.testing.assert_array_equal(kept.experiments[0].replayed.genes, campaign.experiments[0].replayed.genes)
    campaign.withdraw(test, "the wrong parameter file")
    assert campaign.status(test) == "asked" and not campaign.experiments


def test_a_strong_excitation_that_other_gains_bore_proves_nothing_of_the_asked_ones():
    campaign = new_campaign()
    test = told(campaign)
    assert test.hold_back is not None
    book = campaign._book
    assert standing.borne(book) == 0 and standing.unfit(book) == [] and not standing.flies(book, 0)
    assert standing.best_flown(book) is None and standing.times_flown(book, test.genes) == 0


def test_the_preset_of_the_paper_learns_its_tests_as_they_were_asked_for():
    campaign = new_campaign("paper")
    test = campaign.test(GAINS)
    campaign.tell(test, run(test, 0.7))
    assert campaign.experiments[0].test is not None
