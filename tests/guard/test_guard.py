"""The guard: ahead as slow NumPy has it, false alarms as stated, sensors and clock, and what is told of a flight."""

import dataclasses
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from command import invoke
from conftest import PENDULUM_CONTROLLER, PENDULUM_GAINS, PENDULUM_SIGNALS, TINY, pendulum_step
from lives import THOROUGH
from oracles import same_bits
from twinloop import _core
from twinloop._experiment.envelope import outside, usages_of
from twinloop._experiment.hold_back import HoldBack
from twinloop.guard import Guard, Guarded, band
from twinloop.guard.band import DRAWS, BandWatch
from twinloop.guard.guarded import led_by

ANGLE, RATE = PENDULUM_SIGNALS.states
SIGNALS = dataclasses.replace(
    PENDULUM_SIGNALS, states=(dataclasses.replace(ANGLE, envelope=(-1.3, 1.3)), RATE)
)
GOOD = PENDULUM_GAINS
WILD = {"angle.kp": 6.0, "angle.ki": 6.0, "angle.kd": 0.0}
NOISE = [2e-3, 1e-2]


def new_campaign(controller=PENDULUM_CONTROLLER, **changes):
    arguments = {
        "controller": controller, "initial_state": [0.0, 0.0], "target_state": [0.8, 0.0], "duration": 1.5,
        "threads": 1, "options": THOROUGH, **changes,
    }  # fmt: skip
    return tl.Campaign(SIGNALS, **arguments)


def rig(noise=NOISE):
    return tl.systems.Simulated(SIGNALS, pendulum_step, default_gains=GOOD, noise=noise, seed=5)


@pytest.fixture(scope="module")
def campaign():
    """One that knows the pendulum from two flights."""
    return new_campaign().run(rig(), 2)


def fly(guard, test, sensor=lambda k, x: x, loops=None):
    """By hand: what the guard sent, and the true states."""
    x, states, commands = np.array(test.initial_state), [], []
    for k in range(test.steps if loops is None else loops):
        states.append(x)
        commands.append(guard.command(sensor(k, x), test.target(min(k, test.steps))))
        x = np.array(pendulum_step(x, commands[-1]))
    return np.array([*states, x]), np.array(commands)


# Ahead


def slow_leaving(members, test, past_readings, past_commands, reading, horizon, envelope):
    """The soonest leaving: a controller that has seen the flight, and every period a step with the whole past."""
    soonest = None
    for m, member in enumerate(members):
        controller = test.controller()
        for k, before in enumerate(past_readings):
            controller.command(before, test.target(k))
        x, sent = np.array(reading), [np.array(u) for u in past_commands]
        for step in range(min(horizon, test.steps - len(past_readings))):
            u = controller.command(x, test.target(len(past_readings) + step))
            past = np.array(sent).reshape(1, len(sent), 1)
            x = member.step(x[np.newaxis], u[np.newaxis], past=past)[0]
            sent.append(u)
            outside = [not low <= value <= high for value, (low, high) in zip(x, envelope, strict=True)]
            if any(outside):
                if soonest is None or step + 1 < soonest[0]:
                    soonest = (step + 1, outside.index(True), m)
                break
            if not np.isfinite(x).all():
                break
    return soonest


def members_with_memory(signals=SIGNALS):
    """A pendulum with a lag and one with a delay, the second one weaker."""
    program = "r4 = r2 {gain}\nr0 = r4"
    made = []
    for gain, actuator in ((18.0, (0.08, 0, 0.0, 0.0)), (21.0, (0.0, 2, 0.0, 0.0))):
        # Inputs: angle, rate, torque; then the output, the acceleration, and one spare register.
        pages = [[("*", 3, 2, 2.0 * gain), ("*", 4, 1, 1.1), ("-", 3, 3, 4), ("sin", 4, 0, None), ("*", 4, 4, 24.5),
                  ("-", 3, 3, 4)]]  # fmt: skip
        program = _core.Program(3, 1, 5, pages)
        made.append(_core.Model(program, "acceleration", signals.engine, [actuator]))
    return made


MEMBERS = members_with_memory()
FAMILY = PENDULUM_CONTROLLER.bind(SIGNALS)


@given(
    seed=st.integers(0, 1000), period=st.integers(0, 32), horizon=st.integers(1, 40), turning=st.booleans(),
    excited=st.booleans(), held=st.booleans(),
)  # fmt: skip
def test_looking_ahead_is_the_flight_that_the_members_would_make_of_it(
    seed, period, horizon, turning, excited, held
):
    random = np.random.default_rng(seed)
    steps, envelope = 30, np.array([[-0.9, 0.9], [-4.0, np.inf]])
    target = random.normal(size=(steps + 1, 2)) * [0.8, 0.0] if turning else np.array([0.8, 0.0])
    genes = FAMILY.from_unit(random.uniform(size=3))
    excitation = 0.2 * random.normal(size=(steps, 1)) if excited else None
    hold_back = HoldBack([[-0.1, 0.2], [-1.0, 1.0]], [[-0.5, 0.6], [-3.0, 3.0]]) if held else None
    test = tl.Test(FAMILY, genes, np.zeros(2), target, steps, excitation, hold_back=hold_back)
    limits = tl.Twin(MEMBERS[0], SIGNALS).limits
    ahead = _core.LookAhead(
        MEMBERS, limits.setting(FAMILY.engine), genes, target, steps, envelope, excitation=excitation,
        hold_back=None if hold_back is None else hold_back.engine,
    )  # fmt: skip
    for _ in range(2):
        ahead.reset()
        readings, commands = [], []
        for k in range(period):
            readings.append(random.normal(size=2) * [0.3, 1.0])
            commands.append(random.uniform(-2.0, 2.0, 1))
            ahead.sent(readings[-1], test.target(min(k, steps)), commands[-1])
        reading = random.normal(size=2) * [0.4, 1.5]
        if period > steps:
            assert ahead.leaving(reading, horizon) is None
            continue
        expected = slow_leaving(MEMBERS, test, readings, commands, reading, horizon, envelope)
        assert ahead.leaving(reading, horizon) == expected
        assert ahead.leaving(reading, horizon) == expected  # looking changes nothing
    past = np.array(commands).reshape(1, period, 1)
    one = MEMBERS[0].step([reading], [[0.7]], past=past)[0]
    assert same_bits(ahead.following(reading, [0.7]), one)


def test_a_member_that_blows_up_leaves_any_envelope():
    program = _core.Program(3, 1, 4, [[("*", 3, 1, 1000.0)]])
    wild = _core.Model(program, "acceleration", SIGNALS.engine)
    setting, nowhere = tl.Twin(wild, SIGNALS).limits.setting(FAMILY.engine), np.array([[-np.inf, np.inf]] * 2)
    ahead = _core.LookAhead([wild], setting, [0.0] * 3, [0.0, 0.0], 30, nowhere)
    assert ahead.leaving([0.0, 0.0], 30) is None
    periods, _, member = ahead.leaving([0.0, 1.0], 30)
    assert 1 <= periods < 5 and member == 0


@pytest.mark.parametrize(
    "changes",
    [
        {"parameters": [0.0]},
        {"target": [0.0]},
        {"envelope": [[0.0, 1.0]]},
        {"steps": 0},
        {"target": [np.nan, 0.0]},
    ],
)
def test_a_look_ahead_that_fits_no_flight_is_refused(changes):
    arguments = {
        "members": MEMBERS, "setting": tl.Twin(MEMBERS[0], SIGNALS).limits.setting(FAMILY.engine),
        "parameters": [0.0] * 3,
        "target": [0.0, 0.0], "steps": 30, "envelope": [[-1.0, 1.0]] * 2, **changes,
    }  # fmt: skip
    with pytest.raises(ValueError, match="expected"):
        _core.LookAhead(**arguments)


def test_a_flight_that_would_leave_is_ended_before_it_does_and_the_fallback_keeps_it_inside(campaign):
    test = campaign.test(WILD, excitation=None)
    alone, _ = fly(test.controller(), test)
    leaving = int(np.argmax(np.abs(alone[:, 0]) > 1.3))
    assert leaving > 0
    guard = campaign.guard(test, horizon=0.3, clock=None)
    states, commands = fly(guard, test)
    assert guard.tripped and guard.tripped_at < leaving and "angle would leave its envelope" in guard.reason
    assert np.abs(states[:, 0]).max() <= 1.3
    # From there on it is the first controller, from rest: what the integral has had for so short a time is no load.
    fallback = campaign.family.controller(campaign.tests[0].genes)
    at = guard.tripped_at
    expected = [fallback.command(x, test.target(0)) for x in states[at:-1]]
    assert same_bits(commands[at:], np.array(expected))
    told = guard.trajectory()
    assert (told.ended, told.reason, told.steps) == ("aborted", guard.reason, at)
    assert same_bits(told.states, states[: at + 1]) and same_bits(told.commands, commands[:at])


@pytest.mark.parametrize(
    ("seconds", "periods"), [(0.0, 0), (1e-6, 1), (0.02, 1), (0.05, 1), (0.051, 2), (0.15, 3), (0.3, 6)]
)
def test_a_horizon_is_rounded_up_and_only_none_at_all_looks_at_nothing(campaign, seconds, periods):
    test = campaign.test(WILD, excitation=None)
    guard = campaign.guard(test, horizon=seconds, clock=None)
    assert guard.horizon == periods and (guard._ahead.committee is not None) == (periods > 0)
    guard.command([1.25, 3.0], test.target(0))
    assert ("angle would leave its envelope in 0.05 s" in guard.reason) == (periods > 0)


@given(periods=st.integers(0, 2000), dt=st.sampled_from([0.001, 0.004, 0.01, 0.02, 0.05, 0.1, 0.3, 1 / 30]))
def test_a_horizon_of_whole_periods_is_so_many(periods, dt):
    test = new_campaign().test(GOOD, excitation=None)
    signals = dataclasses.replace(SIGNALS, dt=dt)
    test = dataclasses.replace(test, family=PENDULUM_CONTROLLER.bind(signals))
    for seconds in (periods * dt, sum([dt] * periods)):
        assert Guard(test, [0.0], horizon=seconds, clock=None).horizon == periods


CALM, FAST, AT_THE_EDGE = [0.5, 0.0], [1.05, 4.7], [1.25, 3.0]
"""Readings: from the second one the pendulum leaves after some periods, from the third one in the next."""


def watched_ahead():
    """A guard with nothing but readings, envelope and look-ahead, and how it has been when it was given readings."""
    twin = tl.Twin(MEMBERS[0], SIGNALS, members=MEMBERS)
    test = new_campaign().test(GOOD, excitation=None)
    guard = Guard(test, [0.0], twin=twin, horizon=0.3, clock=None)

    def tripped_at(*readings):
        guard.reset()
        for reading in readings:
            guard.command(reading, test.target(0))
        return guard.tripped_at

    calm, fast, at_the_edge = map(np.array, (CALM, FAST, AT_THE_EDGE))
    assert guard._ahead.leaves(calm, 6) is None and guard._ahead.leaves(at_the_edge, 6)[0] == 1
    assert guard._ahead.leaves(fast, 6)[0] > 1
    return guard, tripped_at


def test_what_would_leave_in_the_next_period_is_ended_at_once():
    guard, tripped_at = watched_ahead()
    assert (
        tripped_at(CALM, AT_THE_EDGE, CALM) == 1
        and "angle would leave its envelope in 0.05 s" in guard.reason
    )


def test_what_would_leave_later_is_ended_where_two_periods_in_a_row_say_so():
    guard, tripped_at = watched_ahead()
    assert tripped_at(CALM, FAST, FAST, CALM) == 2 and "angle would leave its envelope in" in guard.reason
    assert tripped_at(FAST, CALM, FAST, CALM, FAST, CALM) is None
    assert tripped_at(CALM, FAST) is None and tripped_at(FAST) is None, "a flight before does not count"


def test_nothing_changes_where_nothing_is_wrong_and_a_guard_can_fly_again(campaign):
    test = campaign.test(GOOD)
    guard = campaign.guard(test, clock=None)
    expected = fly(test.controller(), test)
    for _ in range(2):
        states, commands = fly(guard, test)
        assert not guard.tripped and same_bits(commands, expected[1])
        flown = guard.trajectory(states[-1])
        assert flown.ended == "completed" and same_bits(flown.states, states)
        guard.reset()
    states, _ = fly(guard, test, loops=7)
    flown = guard.trajectory(states[-1])
    assert (flown.ended, flown.steps) == ("aborted", 7) and "7 of 30" in flown.reason
    with pytest.raises(tl.InvalidInput, match="reading after the last command"):
        guard.trajectory()


@pytest.mark.parametrize("fails", [False, True])
def test_what_comes_after_the_test_changes_nothing_of_its_flight(fails):
    test = new_campaign().test(GOOD, excitation=None)
    states, commands = fly(test.controller(), test)
    guard = Guard(test, [0.0], horizon=0.0, clock=None)
    after = [1.4, 0.0] if fails else [0.7, 0.0]
    fly(guard, test, lambda k, x: x if k <= test.steps else np.array(after), loops=test.steps + 6)
    assert guard.tripped == fails
    flown = guard.trajectory()
    assert (flown.ended, flown.reason, flown.steps) == ("completed", "", test.steps)
    assert same_bits(flown.states, states) and same_bits(flown.commands, commands)


def test_a_second_flight_without_a_reset_is_not_taken_for_the_first():
    test = new_campaign().test(GOOD, excitation=None)
    guard = Guard(test, [0.0], horizon=0.0, clock=None)
    for _ in range(2):
        states, _ = fly(guard, test)
    with pytest.raises(tl.InvalidInput, match=r"reset\(\) before each flight"):
        guard.trajectory(states[-1])


def test_a_command_or_other_gains_may_be_the_fallback(campaign):
    test = campaign.test(WILD, excitation=None)
    guard = campaign.guard(test, [0.25], horizon=0.3, clock=None)
    _, commands = fly(guard, test)
    assert (commands[guard.tripped_at :] == 0.25).all() and guard.tripped_at < 30
    soft = {"angle.kp": 1.0, "angle.ki": 0.0, "angle.kd": 0.5}
    guard = campaign.guard(test, soft, horizon=0.3, clock=None)
    states, commands = fly(guard, test)
    at = guard.tripped_at
    assert same_bits(
        commands[at], campaign.family.controller(campaign.family.genes(soft)).command(states[at], [0.8, 0.0])
    )
    for wrong in ([0.0, 1.0], {"kp": 1.0}):
        with pytest.raises(tl.InvalidInput):
            campaign.guard(test, wrong)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ([99.0], "torque within its bounds, -2 to 2 N m, found 99"),
        ([-2.001], "found -2.001"),
        ([np.nan], "expected finite numbers"),
        ([-np.inf], "expected finite numbers"),
    ],
)
def test_a_command_that_may_not_be_sent_is_no_fallback(wrong, words):
    with pytest.raises(tl.InvalidInput, match=words):
        Guard(new_campaign().test(GOOD), wrong)
    for bound in SIGNALS.commands[0].bounds:
        guard = Guard(new_campaign().test(GOOD), [bound], clock=None)
        assert guard.command([np.nan, 0.0], [0.8, 0.0]) == bound


@pytest.mark.parametrize(
    ("what", "signals"),
    [
        (
            "states",
            dataclasses.replace(
                SIGNALS,
                states=(
                    dataclasses.replace(ANGLE, name="heading"),
                    dataclasses.replace(RATE, derivative_of="heading"),
                ),
            ),
        ),
        (
            "periodic states",
            dataclasses.replace(SIGNALS, states=(dataclasses.replace(ANGLE, periodic=True), RATE)),
        ),
        (
            "commands",
            dataclasses.replace(SIGNALS, commands=[tl.Command("torque", "N m", bounds=(-50.0, 50.0))]),
        ),
        ("commands", dataclasses.replace(SIGNALS, commands=[tl.Command("force", "N", bounds=(-2.0, 2.0))])),
        ("period", dataclasses.replace(SIGNALS, dt=0.1)),
    ],
)
def test_a_controller_of_other_signals_is_no_fallback(what, signals):
    family = tl.controllers.StateFeedback(None, (-9.0, 9.0)).bind(signals)
    with pytest.raises(tl.InvalidInput, match=f"a controller with the {what} .* signals of the test"):
        Guard(new_campaign().test(GOOD), family.controller([6.0, 0.0]))


def test_a_controller_of_the_same_signals_with_other_envelopes_is_a_fallback():
    Guard(new_campaign().test(GOOD), PENDULUM_CONTROLLER.bind(PENDULUM_SIGNALS).controller([6.0, 0.0, 0.0]))


# Band


def test_what_is_off_by_less_than_a_tenth_of_the_envelope_is_no_alarm_and_what_is_off_by_more_is(campaign):
    twin, test = campaign.twin, campaign.tests[0]
    watch, alarmed = BandWatch(twin, test, 0.01), {}
    i, state = next((i, s) for i, s in enumerate(twin.signals.states) if s.envelope is not None)
    half = 0.5 * (state.envelope[1] - state.envelope[0])
    for share in (0.09, 0.3):
        watch.reset()
        readings = watch.mean.copy()
        readings[1:, i] += share * half
        alarmed[share] = [watch.alarms(reading) for reading in readings]
    assert not any(alarmed[0.09]) and alarmed[0.3].index(True) <= 4


def test_the_band_ends_as_many_flights_of_the_committee_as_is_said_and_no_more(campaign, monkeypatch):
    monkeypatch.setattr(band, "HARMLESS", 0.0)  # where the committee's own band decides
    twin, test = campaign.twin, campaign.tests[0]
    watch = BandWatch(twin, test, 0.05)
    other = tl.Twin(
        twin.model, twin.signals, members=twin.members, noise=twin.noise, seed=991, inflation=twin.inflation
    )
    states, noise = other.drawn(test, DRAWS)
    middle = states.mean(axis=0)
    alarms = 0
    for readings in middle + twin.inflation * (states - middle) + noise:
        watch.reset()
        alarms += any([watch.alarms(reading) for reading in readings])
    share = alarms / len(states)
    assert 0.0 < share < 0.15
    # One that is off by three widths of the band is ended, after some periods in a row.
    watch.reset()
    late = [watch.alarms(x + 3.0 * watch.half[k] * (k >= 5)) for k, x in enumerate(watch.mean)]
    assert any(late) and np.argmax(late) >= 5 + 2
    # One from elsewhere says nothing.
    watch.reset()
    assert not any([watch.alarms(x + 0.3) for x in watch.mean])


def test_a_plant_that_is_not_what_the_twin_knows_ends_the_flight(campaign):
    test = campaign.test(GOOD, excitation=None)
    guard = campaign.guard(test, horizon=0.0, clock=None)
    x = np.zeros(2)
    for k in range(test.steps):
        u = guard.command(x, test.target(k))
        x = np.array(pendulum_step(x, 0.4 * u))
    assert guard.tripped and "twin's band" in guard.reason
    assert guard.trajectory().ended == "aborted"


# Sensors and clock


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_reading_that_is_none_ends_the_flight_and_the_fallback_flies_on_what_the_twin_knows(campaign, bad):
    test = campaign.test(GOOD, excitation=None)
    guard = campaign.guard(test, clock=None)
    states, commands = fly(guard, test, lambda k, x: np.where(k >= 10, [bad, x[1]], x))
    assert guard.tripped_at == 10 and "angle is not a finite number" in guard.reason
    assert np.isfinite(commands).all() and np.abs(states[-1, 0] - 0.8) < 0.3
    told = guard.trajectory()
    assert told.steps == 9 and same_bits(told.states, states[:10])


def test_one_missing_reading_is_missing_for_one_period_alone():
    """The guard trips on it; its fallback, of the same gains, flies on by the sensor that reads again."""
    test = dataclasses.replace(new_campaign().test(GOOD, excitation=None), steps=150)
    guard = Guard(test, test.controller(), clock=None)
    states, _ = fly(guard, test, lambda k, x: np.where(k == 10, [np.nan, x[1]], x))
    assert guard.tripped_at == 10
    # As a controller flies that is given the reading before instead.
    held, last = test.controller(), None
    x = np.array(test.initial_state)
    for k in range(test.steps):
        last = x if k != 10 else np.array([last[0], x[1]])
        x = np.array(pendulum_step(x, held.command(last, test.target(0))))
    np.testing.assert_allclose(states[-1], x, atol=1e-9)


def stuck_from(first, stream):
    """A noisy sensor of the angle that repeats itself from a period on, beside a healthy one of the rate."""
    read = []

    def sensor(k, x):
        read.append(x + stream.normal(size=2) * NOISE)
        if k >= first:
            read[-1][0] = read[first][0]
        return read[-1]

    return sensor


@pytest.mark.parametrize("first", [2, 3, 4, 6])
def test_a_sensor_that_another_check_notices_first_is_found_frozen_after_it(campaign, first):
    test = dataclasses.replace(campaign.test(GOOD, excitation=None), steps=150)
    guard = campaign.guard(test, clock=None)
    states, _ = fly(guard, test, stuck_from(first, np.random.default_rng(first)))
    assert guard.tripped_at <= first + 6 and guard._broken.tolist() == [True, False]
    assert np.abs(states[:, 0]).max() < 1.3 and np.abs(states[-1, 0] - 0.8) < 0.1
    # One that moves again is believed again.
    guard.command([0.5, 0.0], test.target(0))
    assert not guard._broken.any()


def test_a_rate_that_is_made_of_a_frozen_angle_is_no_rate():
    signals = dataclasses.replace(
        SIGNALS, states=(SIGNALS.states[0], dataclasses.replace(RATE, measured=False))
    )
    campaign = tl.Campaign(
        signals, controller=PENDULUM_CONTROLLER, initial_state=[0.0, 0.0], target_state=[0.8, 0.0], duration=4.0,
        threads=1, options=THOROUGH,
    ).run(tl.systems.Simulated(signals, pendulum_step, default_gains=GOOD, noise=[2e-3, 0.0], seed=5), 2)  # fmt: skip
    test = campaign.test(GOOD, excitation=None)
    guard = campaign.guard(test, clock=None, horizon=0.05)
    sensor, x = stuck_from(6, np.random.default_rng(1)), np.array(test.initial_state)
    rates, seen = [], []
    for k in range(test.steps):
        rates.append(x[1])
        command = guard.command(sensor(k, x)[:1], test.target(0))
        seen.append(guard._estimate[1])
        x = np.array(pendulum_step(x, command))
    assert "angle has not changed" in guard.reason and guard._broken.all()
    after = slice(guard.tripped_at + 2, guard.tripped_at + 10)
    # What is expected of the next period is behind the truth by what was off at the trip, and not 0 for ever.
    assert np.std(seen[after]) > 0.1 and np.abs(x[0] - 0.8) < 0.2
    # The rate over the jump back is none either.
    guard.command([0.5], test.target(0))
    assert guard._broken.tolist() == [False, True]
    guard.command([0.51], test.target(0))
    assert not guard._broken.any()


@pytest.mark.parametrize("follows", [True, False])
def test_without_a_horizon_or_a_twin_that_follows_a_frozen_sensor_is_found_all_the_same(
    campaign, monkeypatch, follows
):
    test = dataclasses.replace(campaign.test(GOOD, excitation=None), steps=150)
    monkeypatch.setattr(campaign.twin, "follows", follows)
    guard = campaign.guard(test, clock=None, horizon=0.0)
    states, _ = fly(guard, test, stuck_from(6, np.random.default_rng(6)))
    assert guard.tripped_at == 11 and "has not changed in its last bit" in guard.reason
    # What is read instead only a twin knows.
    assert not follows or np.abs(states[:, 0]).max() < 1.3


def test_a_flight_whose_first_reading_is_none_has_no_period_and_starts_where_the_test_does():
    test = dataclasses.replace(new_campaign().test(GOOD), initial_state=np.array([0.25, 0.0]))
    for number in range(20):
        junk = np.full((test.steps + 1, 2), 7.5 + number)  # what new memory may hold
        del junk
        guard = Guard(test, [0.0], clock=None)
        guard.command([np.nan, 0.0], test.target(0))
        flown = guard.trajectory()
        assert (flown.ended, flown.steps) == ("aborted", 0) and "not a finite number" in flown.reason
        assert same_bits(flown.states, [[0.25, 0.0]])


def test_a_twin_that_diverges_while_a_sensor_is_missing_leaves_the_fallback_something_to_see():
    program = _core.Program(3, 1, 4, [[("*", 3, 1, 60.0)]])
    twin = tl.Twin(_core.Model(program, "acceleration", SIGNALS.engine), SIGNALS)
    test = dataclasses.replace(new_campaign().test(GOOD, excitation=None), steps=900)
    guard = Guard(test, test.controller(), twin=twin, horizon=0.05, clock=None)
    guard.command([0.0, 0.001], test.target(0))
    commands = np.array([guard.command([np.nan, np.nan], test.target(0)) for _ in range(800)])
    assert guard.tripped_at == 1 and np.isfinite(commands).all()
    assert (np.abs(guard._estimate) <= 20.0 * np.array([state.scale for state in SIGNALS.states])).all()


@pytest.mark.parametrize("garbage", [1e3, 1e9, 1.7e308])
def test_a_reading_that_nobody_records_is_none_and_no_controller_sees_it(garbage):
    free = dataclasses.replace(
        SIGNALS, states=[dataclasses.replace(s, envelope=None) for s in SIGNALS.states]
    )
    for signals in (SIGNALS, free):
        campaign = tl.Campaign(
            signals,
            controller=PENDULUM_CONTROLLER,
            initial_state=[0.0, 0.0],
            target_state=[0.8, 0.0],
            duration=1.5,
        )
        test = campaign.test(GOOD, excitation=None)
        guard = campaign.guard(test, clock=None)
        broken = np.array([garbage, -garbage])
        states, commands = fly(guard, test, lambda k, x, b=broken: x if k < 10 else b * (-1.0) ** (k // 3))
        assert guard.tripped_at == 10 and "angle cannot be" in guard.reason
        assert np.isfinite(commands).all() and np.abs(commands).max() <= 2.0
        flown = guard.trajectory()
        assert flown.steps == 9 and same_bits(flown.states, states[:10])
        campaign.tell(test, flown)


def test_a_sensor_that_repeats_itself_for_longer_than_it_ever_did_ends_the_flight(campaign):
    # Where it is long at its target: before that the band would be the first to notice.
    test = dataclasses.replace(campaign.test(GOOD, excitation=None), steps=80)
    seen, sent = [], []

    class Seeing:
        def __init__(self, kp):
            pass

        def reset(self):
            pass

        def command(self, state, target):
            seen.append(np.array(state))
            return [2.0 * (target[0] - state[0]) - 0.3 * state[1]]

    family = tl.controllers.Custom(Seeing, {"kp": (0.0, 1.0)}).bind(SIGNALS)
    guard = campaign.guard(test, family.controller([0.0]), horizon=0.05, clock=None)
    random = np.random.default_rng(0)

    stuck = []

    def sensor(k, x):
        reading = x + random.normal(size=2) * NOISE
        stuck.append(reading[1])
        reading = np.array([reading[0], stuck[60]]) if k >= 60 else reading
        sent.append(reading)
        return reading

    _, commands = fly(guard, test, sensor)
    # The first of them is a reading like others.
    assert guard.tripped_at == 65 and "rate has not changed" in guard.reason
    # From then on the fallback sees the angle that is read, and the rate that the twin expects after that.
    assert len(seen) == test.steps
    found, read = np.array(seen[65:]), np.array(sent[65:])
    assert same_bits(found[:, 0], read[:, 0]) and not (found[:, 1] == stuck[60]).any()
    before, member = [sent[64], *found[:-1]], campaign.twin.members[0]
    expected = [
        member.step([x], [u], past=commands[: 64 + k].reshape(1, -1, 1))[0][1]
        for k, (x, u) in enumerate(zip(before, commands[64:-1], strict=True))
    ]
    # The guard knows by how many ms the one sensor is read later than the other; a step alone does not.
    np.testing.assert_allclose(found[:, 1], expected, atol=0.01)


def test_a_sensor_whose_flights_repeat_readings_is_not_taken_for_frozen():
    from twinloop.guard.sensors import SensorWatch

    still = tl.Trajectory(0.05 * np.arange(31), np.zeros((31, 2)), np.zeros((30, 1)))
    watch = SensorWatch(np.ones(2), [still], read=[0, 1], banded=False)
    assert not any([watch.frozen(np.zeros(2)).any() for _ in range(50)])
    assert any([watch.frozen(np.zeros(2)).any() for _ in range(21)])
    without = SensorWatch(np.ones(2), [], read=[0, 1], banded=False)
    assert not any([without.frozen(np.zeros(2)).any() for _ in range(500)])


def test_a_late_period_ends_the_flight():
    campaign = new_campaign()
    test = campaign.test(GOOD, excitation=None)
    times = iter(np.cumsum([0.0, 0.05, 0.07, 0.05, 0.08, 0.05, 0.05]))
    guard = campaign.guard(test, [0.0], overrun=0.5, clock=lambda: float(next(times)))
    for _ in range(6):
        guard.command(np.zeros(2), test.target(0))
    assert guard.tripped_at == 4 and "0.08 s instead of 0.05 s" in guard.reason


class Failing:
    """A law in Python, and a clock, that work a few times."""

    def __init__(self, kp=1.0, times=6, answer=None):
        self.kp, self.left, self.answer = kp, times, answer

    def reset(self):
        pass

    def command(self, state, target):
        self()
        return [self.kp * (target[0] - state[0])] if self.left or self.answer is None else self.answer

    def __call__(self):
        self.left -= 1
        if self.left < 0 or (self.left == 0 and self.answer is None):
            raise ZeroDivisionError("division by zero")
        return 0.0


@pytest.mark.parametrize("answer", [None, [np.nan], [0.1, 0.2], "none"])
def test_a_law_that_fails_in_flight_hands_over_to_the_fallback(answer):
    family = tl.controllers.Custom(lambda kp: Failing(kp, answer=answer), {"kp": (0.0, 6.0)}).bind(SIGNALS)
    test = tl.Test(family, [1.0], [0.0, 0.0], [0.8, 0.0], 30)
    guard = Guard(test, [0.25], horizon=0.0, clock=None)
    states, commands = fly(guard, test)
    assert guard.tripped_at == 5 and "the controller failed" in guard.reason
    assert (commands[5:] == 0.25).all() and not (commands[:5] == 0.25).any()
    flown = guard.trajectory()
    assert flown.ended == "aborted" and same_bits(flown.states, states[:6])


def test_a_clock_that_fails_in_flight_hands_over_to_the_fallback():
    test = new_campaign().test(GOOD, excitation=None)
    guard = Guard(test, [0.25], horizon=0.0, clock=Failing())
    _, commands = fly(guard, test)
    assert guard.tripped_at == 5 and "a check failed: ZeroDivisionError: division by zero" in guard.reason
    assert (commands[5:] == 0.25).all()


def test_a_clock_that_goes_back_ends_the_flight():
    test = new_campaign().test(GOOD, excitation=None)
    times = iter([10.0, 10.05, 10.1, 8.2, 8.25])
    guard = Guard(test, [0.25], horizon=0.0, clock=lambda: next(times))
    commands = [guard.command(np.zeros(2), test.target(0)) for _ in range(5)]
    assert guard.tripped_at == 3 and "clock went back by 1.9 s" in guard.reason and commands[3] == 0.25


def test_what_a_mask_hides_is_missing_and_what_is_no_number_is_refused():
    test = new_campaign().test(GOOD, excitation=None)
    guard = Guard(test, [0.25], horizon=0.0, clock=None)
    for wrong in (["x", 0.0], [1j, 0.0]):
        with pytest.raises(tl.InvalidInput, match="state: expected numbers"):
            guard.command(wrong, test.target(0))
    guard.command(np.ma.array([0.1, 0.0], mask=[False, False]), test.target(0))
    guard.command([0.1, 0.01], test.target(0))
    assert guard.command(np.ma.array([0.1, 0.5], mask=[False, True]), test.target(0)) == 0.25
    assert guard.tripped_at == 2 and "rate is not a finite number" in guard.reason


def test_before_anything_is_known_readings_and_envelope_are_watched():
    campaign = new_campaign()
    test = campaign.test(GOOD)
    guard = campaign.guard(test, clock=None)
    for angle in (0.1, 0.1, 1.31):
        guard.command([angle, 0.0], test.target(0))
    assert guard.tripped_at == 2 and "angle has left its envelope: 1.31 rad" in guard.reason
    assert not new_campaign().guard(test, clock=None).tripped


def test_a_twin_that_does_not_follow_the_flights_watches_nothing(campaign, monkeypatch):
    test = campaign.test(WILD, excitation=None)
    assert campaign.twin.follows
    guard = campaign.guard(test, clock=None)
    assert guard._ahead.committee is not None and guard._band is not None
    monkeypatch.setattr(campaign.twin, "follows", False)
    guard = campaign.guard(test, clock=None)
    assert guard._ahead.committee is None and guard._band is None
    guard.command(AT_THE_EDGE, test.target(0))
    assert not guard.tripped
    fly(guard, test)
    assert "angle has left its envelope" in guard.reason, "which is watched all the same"


ENVELOPES = st.tuples(st.floats(-20.0, 20.0), st.floats(0.1, 9.0)).map(lambda found: (found[0], sum(found)))


@given(
    data=st.data(),
    periods=st.lists(st.sampled_from([False, 2.0 * np.pi, 10.0, 360.0]), min_size=1, max_size=3),
)
def test_a_guard_ends_a_flight_at_the_first_reading_that_the_rest_counts_as_outside_and_at_no_other(
    data, periods
):
    states = [
        tl.State(f"x{i}", "u", scale=5.0, envelope=data.draw(st.none() | ENVELOPES), periodic=period)
        for i, period in enumerate(periods)
    ]
    signals = tl.Signals(states, SIGNALS.commands, 0.05)
    family = tl.controllers.StateFeedback(None, (-1.0, 1.0)).bind(signals)
    start = np.zeros(len(states))
    test = tl.Test(family, np.zeros(family.size), start, start, 12)

    def reading(state):
        low, high = state.envelope or (-1.0, 1.0)
        near = st.floats(low - 0.2 * (high - low), high + 0.2 * (high - low))
        turns = st.integers(-3, 3) if state.period is not None else st.just(0)
        return st.builds(lambda value, turn: value + turn * (state.period or 0.0), near, turns)

    readings = np.array(data.draw(st.lists(st.tuples(*map(reading, states)), min_size=12, max_size=12)))
    beyond = outside(usages_of(signals, readings))
    guard = Guard(test, np.zeros(1), horizon=0.0, clock=None)
    for row in readings:
        guard.command(row, start)
    assert guard.tripped_at == (int(np.argmax(beyond)) if beyond.any() else None)
    if not guard.tripped:
        return
    # By the bounds themselves: some number of turns would bring every other state inside, and none brings this one.
    (name,) = (state.name for state in states if f"{state.name} has left its envelope" in guard.reason)
    i = signals.state_names.index(name)
    turned = readings[guard.tripped_at, i] + np.arange(-9, 10) * (states[i].period or 0.0)
    low, high = states[i].envelope
    assert not ((turned >= low + 1e-9) & (turned <= high - 1e-9)).any()


@pytest.mark.parametrize("turns", [-1, 2])
def test_an_angle_that_is_read_some_turns_off_is_watched_alike_and_ahead(turns):
    angle, rate = SIGNALS.states
    signals = dataclasses.replace(SIGNALS, states=(dataclasses.replace(angle, periodic=True), rate))
    members, family = members_with_memory(signals), PENDULUM_CONTROLLER.bind(signals)
    twin = tl.Twin(members[0], signals, members=members)
    for gains in (GOOD, WILD):
        test = tl.Test(family, family.genes(gains), [0.0, 0.0], [0.8, 0.0], 30)
        found = []
        for offset in (0.0, 2.0 * np.pi * turns):
            guard = Guard(test, [0.0], twin=twin, horizon=0.3, clock=None)
            fly(guard, test, lambda k, x, offset=offset: x + np.array([offset, 0.0]))
            found.append((guard.tripped_at, guard.reason))
        assert found[0] == found[1]
        assert ("angle would leave its envelope" in found[0][1]) == (gains is WILD)


def test_wrong_arguments_are_refused(campaign):
    test = campaign.tests[0]
    for wrong in ({"horizon": -1.0}, {"false_alarms": 0.0}, {"false_alarms": 1.0}, {"overrun": np.nan}):
        with pytest.raises(tl.InvalidInput):
            campaign.guard(test, **wrong)
    guard = campaign.guard(test, clock=None)
    for state, target in (
        ([0.0], [0.0, 0.0]),
        ([0.0, 0.0], [0.0]),
        ([0.0, 0.0], [np.nan]),
        ([0.0, 0.0], "far"),
    ):
        with pytest.raises(tl.InvalidInput):
            guard.command(state, target)
    assert guard.period == 0


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_target_that_is_not_finite_trips_and_the_fallback_goes_on_to_that_of_the_test(campaign, wrong):
    test = campaign.test(GOOD)
    guard, readings = campaign.guard(test, clock=None), rig().run(test).states
    for k in range(6):
        found = guard.command(readings[k], test.target(k) if k < 3 else [wrong, 0.0])
        assert np.isfinite(found).all() and guard.tripped == (k >= 3)
    assert guard.tripped_at == 3 and guard.reason.endswith("the target is not finite")
    # The record ends with what was read then, as wherever it trips.
    assert same_bits(guard.trajectory().states, readings[:4])


def test_what_was_read_first_is_recorded_where_the_first_target_is_not_finite(campaign):
    test = campaign.test(GOOD)
    guard = campaign.guard(test, clock=None)
    guard.command([0.1, -0.2], [np.nan, 0.0])
    assert guard.trajectory().states.tolist() == [[0.1, -0.2]]


# Systems


def test_a_guarded_system_gives_the_same_bits_until_it_is_ended(campaign):
    good, wild = campaign.test(GOOD), campaign.test(WILD, excitation=None)
    guarded = campaign.guarded(rig(), horizon=0.3)
    alone, watched = rig().run(good), guarded.run(good)
    assert same_bits(alone.states, watched.states) and same_bits(alone.commands, watched.commands)
    run = guarded.run(wild)
    assert run.ended == "aborted" and run.reason == guarded.guard.reason
    assert run.steps == guarded.guard.tripped_at < wild.steps == guarded.flown.steps
    assert np.abs(guarded.flown.true_states[:, 0]).max() <= 1.3
    assert same_bits(run.states, guarded.flown.states[: run.steps + 1])


def test_a_campaign_flies_a_guarded_system_and_learns_from_what_was_ended():
    campaign = new_campaign()
    campaign.test(WILD, excitation=None)
    campaign.run(Guarded(rig(), lambda test: campaign.guard(test, [0.0], clock=None)), 1)
    (run,) = campaign.experiments
    assert run.trajectory.ended == "aborted" and campaign.status(campaign.tests[0]) == "aborted"
    assert "left its envelope" in run.trajectory.reason


def test_gains_that_failed_are_never_fallen_back_on():
    campaign, rigged = new_campaign(), rig()
    bad = campaign.test(WILD, excitation=None)
    assert campaign.guard(bad, horizon=0.0).fallback.parameters == bad.parameters, "nothing has flown yet"
    campaign.tell_failed(bad, "gearbox broken")
    good = campaign.test(GOOD, excitation=None)
    assert campaign.trusted is None
    with pytest.raises(tl.NotAvailable, match="fallback="):
        campaign.guard(good, horizon=0.0)
    assert campaign.guard(good, bad.parameters, horizon=0.0).fallback.parameters == bad.parameters, "as asked"
    campaign.tell(good, rigged.run(good))
    assert campaign.trusted is good
    assert campaign.guard(bad, horizon=0.0).fallback.parameters == good.parameters


def test_the_noise_of_a_guarded_system_goes_on_where_it_was_in_another_process(tmp_path):
    store = tmp_path / "rig.db"
    whole = new_campaign()
    whole.run(whole.guarded(rig(), horizon=0.0), 2)
    for experiments in (1, 2):
        moved = new_campaign(store=store)
        moved.run(moved.guarded(rig(), horizon=0.0), experiments)
        moved.close()
    for one, other in zip(whole.experiments, moved.experiments, strict=True):
        assert same_bits(one.trajectory.states, other.trajectory.states)


def test_a_guarded_system_is_known_again_and_is_not_flown_on_without_its_guard(tmp_path):
    def flown(experiments, watched, **changes):
        system = tl.systems.Quadrotor(**changes)
        campaign = tl.Campaign(
            system.signals, controller=system.controller, initial_state=system.initial_state,
            target_state=system.target_state, duration=1.0, preset="paper", options=TINY, threads=1, store=store,
        )  # fmt: skip
        try:
            campaign.run(campaign.guarded(system, horizon=0.0) if watched else system, experiments)
        finally:
            campaign.close()

    store = tmp_path / "hover.db"
    flown(1, watched=True)
    for watched in (True, False):
        with pytest.raises(tl.InvalidInput, match=r"found another: noise: 0\.0 in the store, 0\.01 now"):
            flown(2, watched, noise=0.01)
    resumed = invoke("resume", str(store), "--experiments", "2")
    assert resumed.exit_code != 0 and "continue from Python" in resumed.stderr
    flown(2, watched=False)


class OwnLoop(tl.System):
    """Closes its loop by hand; what it is asked to do besides is its matter."""

    signals = SIGNALS

    def __init__(self, watched=True, lost=False, asks=None):
        self.watched, self.lost, self.asks = watched, lost, asks

    def run(self, test):
        law = test.controller() if self.watched else new_campaign().test(GOOD, excitation=None).controller()
        if self.asks is not None:
            law = self.only_begun(law)
        states, commands = fly(law, test, lambda k, x: x if k < 6 else np.array([1.4, 0.0]))
        if self.lost:
            raise tl.SystemFailure("the link was lost")
        band = np.stack([states - 1.0, states + 1.0])
        return tl.Trajectory(0.05 * np.arange(len(states)), states, commands, band=band)

    def only_begun(self, law):
        """Asks for so many commands, and holds the last one."""
        commands, asks = [], self.asks

        class Held:
            def command(self, state, target):
                if len(commands) < asks:
                    commands.append(law.command(state, target))
                return commands[-1]

        return Held()


def guarded_by_hand(system):
    return Guarded(system, lambda test: Guard(test, [0.0], horizon=0.0, clock=None))


def test_a_run_that_has_a_band_is_cut_with_it():
    run = guarded_by_hand(OwnLoop()).run(new_campaign().test(GOOD, excitation=None))
    assert (run.ended, run.steps) == ("aborted", 6)
    assert same_bits(run.band, np.stack([run.states - 1.0, run.states + 1.0]))


def test_a_system_that_asks_no_guard_is_refused_and_its_run_is_not_lost():
    guarded = guarded_by_hand(OwnLoop(watched=False))
    with pytest.raises(tl.InvalidInput, match=r"asked 0 times in 30 periods"):
        guarded.run(new_campaign().test(GOOD, excitation=None))
    assert guarded.flown.steps == 30


@pytest.mark.parametrize("asks", [1, 15, 29])
def test_a_system_that_asks_for_too_few_commands_is_refused(asks):
    guarded = guarded_by_hand(OwnLoop(asks=asks))
    with pytest.raises(tl.InvalidInput, match=rf"asked {asks} times in 30 periods"):
        guarded.run(new_campaign().test(GOOD, excitation=None))
    assert guarded.flown.steps == 30
    assert guarded_by_hand(OwnLoop(asks=30)).run(new_campaign().test(GOOD, excitation=None)).steps == 6


class Garbled(tl.System):
    """A rig that closes its own loop, and one reading of which is garbage."""

    signals = SIGNALS
    default_gains = GOOD

    def __init__(self, garbage):
        self.garbage = garbage

    def run(self, test):
        controller, x, read, sent = test.controller(), np.zeros(2), [], []
        for k in range(test.steps):
            read.append(np.where(k == 10, [self.garbage, x[1]], x))
            sent.append(controller.command(read[-1], test.target(k)))
            x = np.array(pendulum_step(x, sent[-1]))
        self.last = x
        return tl.Trajectory(SIGNALS.dt * np.arange(test.steps + 1), [*read, x], sent)


@pytest.mark.parametrize("garbage", [np.nan, np.inf, 1e6])
def test_a_guarded_rig_flies_on_through_a_reading_that_is_none_and_what_it_flew_is_told(garbage):
    campaign, rig = new_campaign(), Garbled(garbage)
    guarded = campaign.guarded(rig)
    campaign.run(guarded, 1)
    (flight,) = campaign.experiments
    assert flight.trajectory.ended == "aborted" and flight.trajectory.steps == 9
    assert "the reading of angle" in flight.trajectory.reason and not campaign.failures
    assert guarded.guard.period == 30 and np.abs(rig.last[0] - 0.8) < 0.2


def test_after_a_run_that_failed_the_guard_is_the_one_of_that_run():
    guarded, test = guarded_by_hand(OwnLoop()), new_campaign().test(GOOD, excitation=None)
    guarded.run(test)
    before, guarded.system = guarded.guard, OwnLoop(lost=True)
    with pytest.raises(tl.SystemFailure):
        guarded.run(test)
    assert guarded.guard is not before and guarded.guard.tripped and guarded.flown is None


def test_a_flight_that_is_ended_at_once_is_told_as_failed():
    class Outside(tl.System):
        signals = SIGNALS

        def run(self, test):
            led = led_by(Guard(test, [0.0], clock=None), test)
            led.controller().command([1.4, 0.0], test.target(0))
            return tl.Trajectory([0.0], [[1.4, 0.0]], np.empty((0, 1)), "aborted", "left")

    campaign = new_campaign()
    campaign.test(GOOD)
    campaign.run(Outside(), 1)
    assert [failure.reason for failure in campaign.failures] == ["left"] and not campaign.experiments


def test_a_law_in_python_is_watched_but_not_ahead(campaign):
    class Law:
        def __init__(self, kp):
            self.kp = kp

        def reset(self):
            pass

        def command(self, state, target):
            return [self.kp * (target[0] - state[0])]

    family = tl.controllers.Custom(Law, {"kp": (0.0, 6.0)}).bind(SIGNALS)
    test = tl.Test(family, [1.0], [0.0, 0.0], [0.8, 0.0], 30)
    with pytest.raises(tl.NotAvailable, match="horizon=0"):
        Guard(test, [0.0], twin=campaign.twin)
    guard = Guard(test, [0.0], twin=campaign.twin, horizon=0.0, clock=None)
    assert guard.command([0.1, 0.0], [0.8, 0.0])[0] == pytest.approx(0.7)


def test_a_guard_takes_no_more_memory_with_every_period(campaign):
    test = dataclasses.replace(campaign.tests[0], steps=3000, excitation=None)
    guard = campaign.guard(test, clock=None)
    reading = np.array([0.1, 0.0])
    tracemalloc.start()
    try:
        for _ in range(200):
            guard.command(reading + 1e-9 * guard.period, test.target(0))
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(1000):
            guard.command(reading + 1e-9 * guard.period, test.target(0))
        assert tracemalloc.get_traced_memory()[0] - before < 10_000
    finally:
        tracemalloc.stop()
