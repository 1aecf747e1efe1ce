"""Unmeasured: rates that no sensor reads are differences of readings, wherever a record or a reading comes in."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import same_bits
from twinloop.trajectory import Trajectory, completed, recorded_as
from twinloop.unmeasured import Differences, completed_readings, completed_state, in_words, lacks, logged

COMMAND = tl.Command("torque", "N m", (-1.0, 1.0))


def signals(lags=1, dt=0.1, **angle):
    return tl.Signals(
        [tl.State("angle", "rad", 1.0, **angle), tl.State("heat", "K", 9.0)], [COMMAND], dt, lags=lags
    )


def flight(states, dt=0.1):
    states = np.asarray(states, dtype=np.float64)
    return Trajectory(dt * np.arange(len(states)), states, np.zeros((len(states) - 1, 1)))


readings = st.lists(st.tuples(*[st.floats(-3.0, 3.0)] * 2), min_size=5, max_size=9)


def test_a_past_reading_makes_a_rate_of_each_state_that_has_none():
    found = signals()
    assert found.state_names == ("angle", "heat", "angle_rate", "heat_rate")
    rate = found.states[2]
    assert (rate.unit, rate.derivative_of, rate.measured) == ("rad/s", "angle", False)
    assert rate.scale == pytest.approx(1.0)  # a tenth of the scale a period
    assert found.driven == (2, 3) and found.measured == (0, 1) and found.unmeasured == (2, 3)


def test_more_past_readings_add_nothing():
    assert signals(lags=2) == signals(lags=1)
    assert tl.Signals([tl.State("v", "m/s", 1.0)], [COMMAND], 0.1, lags=1).states[1].unit == "m/s²"


def test_a_rate_is_made_of_what_is_measured():
    made = [tl.State("x", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="x", measured=False)]
    with pytest.raises(tl.InvalidInput, match="'v' to be measured"):
        tl.Signals([*made, tl.State("a", "m/s²", 1.0, derivative_of="v", measured=False)], [COMMAND], 0.1)
    found = tl.Signals([*made, tl.State("a", "m/s²", 1.0, derivative_of="v")], [COMMAND], 0.1)
    assert found.unmeasured == (1,) and found.measured == (0, 2)


def test_states_that_have_a_derivative_or_are_one_get_no_rate():
    pair = [tl.State("x", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="x")]
    assert tl.Signals([*pair, tl.State("y", "m", 1.0)], [COMMAND], 0.1, lags=1).state_names == (
        "x",
        "v",
        "y",
        "y_rate",
    )
    with pytest.raises(tl.InvalidInput, match="a state whose rate is not declared, found none"):
        tl.Signals(pair, [COMMAND], 0.1, lags=1)
    names = ("roll", "pitch", "yaw", "p", "q", "r")
    body = tl.RigidBody(names[:3], names[3:])
    with pytest.raises(tl.InvalidInput, match="found none"):
        tl.Signals(
            [tl.State(n, "rad/s" if n in body.rates else "rad", 1.0) for n in names],
            [COMMAND],
            0.1,
            kinematics=body,
            lags=1,
        )


def test_what_is_made_of_the_past_is_declared_from_then_on():
    found = signals()
    again = tl.Signals.from_record(found.to_record())
    assert again.states == found.states and again.unmeasured == found.unmeasured
    by_hand = tl.Signals(found.states, found.commands, found.dt)
    assert by_hand == found


@pytest.mark.parametrize(("lags", "said"), [(-1, "at least 0"), (1.5, "whole"), (True, "whole")])
def test_another_number_of_past_readings_is_refused(lags, said):
    with pytest.raises(tl.InvalidInput, match=said):
        signals(lags=lags)


def test_a_state_that_is_not_measured_is_the_derivative_of_one():
    with pytest.raises(tl.InvalidInput, match="derivative_of of a state that is not measured"):
        tl.State("heat", "K", 1.0, measured=False)
    with pytest.raises(tl.InvalidInput, match="True or False"):
        tl.State("rate", "1/s", 1.0, derivative_of="x", measured=0)


@given(readings)
def test_rates_of_a_record_are_differences_and_begin_as_the_first_one(rows):
    states = completed(flight(rows), signals()).states
    assert same_bits(states[:, :2], np.array(rows))
    for k in range(1, len(rows)):
        assert states[k, 2:].tolist() == [(rows[k][i] - rows[k - 1][i]) / 0.1 for i in range(2)]
    assert states[0, 2:].tolist() == states[1, 2:].tolist()


@given(readings)
def test_rates_of_a_flight_begin_as_its_test_does(rows):
    start = np.array([0.3, 0.0, -2.0, 0.5])
    states = completed(flight(rows), signals(), start).states
    for rate in (0, 1):
        changes = np.diff(np.array(rows)[:, rate]) / 0.1
        far = abs(changes[0] - start[2 + rate]) > 3.0 * np.abs(np.diff(changes)).max()
        assert states[0, 2 + rate] == (changes[0] if far else start[2 + rate])
    assert same_bits(states[1:, 2:], np.diff(np.array(rows), axis=0) / 0.1)


def test_a_flight_that_began_in_motion_is_no_test_from_rest():
    ticks = 0.1 * np.arange(12)
    moving = flight(np.column_stack([0.7 * ticks, 0.5 * ticks**2]))
    assert completed(moving, signals(), np.zeros(4)).states[0, 2:].tolist() == pytest.approx([0.7, 0.0])


def test_an_angle_that_wraps_turns_by_the_short_way():
    rows = [(3.1, 0.0), (-3.1, 0.0), (-3.0, 0.0)]
    states = completed(flight(rows), signals(periodic=True)).states
    assert states[1:, 2] == pytest.approx([(2.0 * math.pi - 6.2) / 0.1, 1.0])


def test_a_record_with_all_columns_and_what_is_no_record_stay():
    known, whole = signals(), flight(np.ones((4, 4)))
    assert completed(whole, known) is whole
    assert completed(flight(np.ones((4, 3))), known).states.shape == (4, 3)
    assert completed("nothing", known) == "nothing"
    assert not lacks([[1.0, 2.0], [1.0]], known)
    plain = tl.Signals([tl.State("x", "m", 1.0)], [COMMAND], 0.1)
    assert not lacks(np.ones(1), plain) and lacks([1.0, 2.0], known) and not lacks(1.0, known)


def test_a_record_of_one_row_is_at_rest():
    one = Trajectory(np.zeros(1), np.ones((1, 2)), np.zeros((0, 1)))
    assert completed(one, signals()).states.tolist() == [[1.0, 1.0, 0.0, 0.0]]


def test_readings_without_a_row_have_none():
    assert completed_readings(np.zeros((0, 2)), signals()).shape == (0, 4)


def test_what_is_not_measured_is_at_rest_in_a_state():
    assert completed_state("State", [1.0, 2.0], signals()).tolist() == [1.0, 2.0, 0.0, 0.0]
    assert completed_state("State", [1.0, 2.0, 3.0, 4.0], signals()).tolist() == [1.0, 2.0, 3.0, 4.0]
    with pytest.raises(tl.InvalidInput, match="State"):
        completed_state("State", [1.0, 2.0, 3.0], signals())


@given(readings)
def test_readings_one_by_one_are_completed_as_a_flight_from_rest_is(rows):
    known = signals()
    differences = Differences(known)
    for _ in range(2):
        found = [differences.completed(np.array(row)) for row in rows]
        assert same_bits(np.array(found)[1:], completed(flight(rows), known).states[1:])
        assert found[0].tolist() == [*rows[0], 0.0, 0.0]
        differences.reset()


def test_a_log_has_columns_of_all_states_or_of_those_that_are_measured():
    known = signals()
    assert [state.name for state in logged(known, ["heat", "angle", "t"])] == ["angle", "heat"]
    assert [state.name for state in logged(known, ["angle", "heat", "angle_rate"])] == ["angle", "heat"]
    assert logged(known, known.state_names) == known.states


def test_a_record_is_known_again_with_what_it_lacks():
    known = signals()
    told = completed(flight([(0.1, 1.0), (0.2, 1.5), (0.4, 2.0)]), known, np.array([0.0, 0.0, 0.7, 5.0]))
    assert told.states[0, 2:].tolist() == [0.7, 5.0]
    assert recorded_as(flight([(0.1, 1.0), (0.2, 1.5), (0.4, 2.0)]), told, known)
    assert not recorded_as(flight([(0.1, 1.0), (0.2, 1.5), (0.4, 2.1)]), told, known)


def test_what_is_wrong_with_the_signals_is_said_as_it_is_without_past_readings():
    angle = tl.State("angle", "rad", 1.0)
    with pytest.raises(tl.InvalidInput, match=r"twinloop\.RigidBody or None"):
        tl.Signals([angle], [COMMAND], 0.1, kinematics="body", lags=1)
    with pytest.raises(tl.InvalidInput, match="found 'angle' twice"):
        tl.Signals([angle, angle], [COMMAND], 0.1, lags=1)
    with pytest.raises(tl.InvalidInput, match="found 'angle_rate' twice"):
        tl.Signals([angle], [tl.Command("angle_rate", "rad/s", (-1.0, 1.0))], 0.1, lags=1)


def test_how_the_rate_of_an_angle_that_wraps_is_made_is_said_with_the_short_way():
    (plain, _), (wrapping, _) = in_words(signals()), in_words(signals(periodic=True))
    assert "the short way" in wrapping and "the short way" not in plain
