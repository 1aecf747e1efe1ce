"""A fallback that runs along: no jump under a steady load, and nothing of it learnt from sensors that fail."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import same_bits
from twinloop.guard import Guard
from twinloop.guard.standby import WAITING, Standby

DT, HALF = 0.05, 0.25
SIGNALS = tl.Signals(
    states=[
        tl.State("height", "m", 1.0, envelope=(-HALF, HALF)),
        tl.State("climb", "m/s", 2.0, derivative_of="height"),
    ],
    commands=[tl.Command("thrust", "g", (-2.0, 2.0))],
    dt=DT,
)
FILLED, LATE, STEPS = 300, 500, 600
"""Periods: the load has come to its end, the clock says that one took too long, and the test ends."""
# Integral times are at most 8 s, and loops well damped.
RANGES = {"kp": (1.5, 2.4), "ki": (0.3, 1.0), "kd": (1.2, 3.0)}
FAMILIES = {
    "pid": tl.controllers.PID(
        axes=[("height", "climb")], gains={f"height.{term}": bounds for term, bounds in RANGES.items()}
    ),
    "pid of readings alone": tl.controllers.PID(
        axes=[("height", None)], gains={f"height.{term}": bounds for term, bounds in RANGES.items()},
        anti_windup="clamping", derivative_filter=0.1,
    ),
    "cascade": tl.controllers.Cascade(
        axes=[("height", "climb")],
        gains={"height.kp": (0.8, 1.2), "climb.kp": (1.5, 2.4), "climb.ki": (0.4, 1.0), "climb.kd": 0.0},
    ),
    "state feedback": tl.controllers.StateFeedback(
        None, {"height": (1.5, 2.4), "climb": (1.2, 3.0), "height.integral": (0.3, 1.0)}, integral=["height"]
    ),
}  # fmt: skip
BOUND = {name: family.bind(SIGNALS) for name, family in FAMILIES.items()}


def flight(family, genes):
    return tl.Test(family, genes, np.zeros(2), np.zeros(2), STEPS)


def lift(law, target, load, clock=None):
    """Heights and thrusts of a mass whose load grows within 15 s, and stays; the clock loses a period."""
    x, heights, sent = np.zeros(2), [], []
    for k in range(STEPS):
        if clock is not None:
            clock[0] += DT * (2.0 if k == LATE else 1.0)
        sent.append(law.command(x, target)[0])
        heights.append(x[0])
        climb = x[1] + DT * 2.0 * (sent[-1] - load * min(1.0, k / FILLED))
        x = np.array([x[0] + DT * x[1], climb])
    return np.array(heights), np.array(sent)


def guarded(test, fallback, load):
    clock = [0.0]
    guard = Guard(test, fallback, clock=lambda: clock[0])
    heights, sent = lift(guard, test.target(0), load, clock)
    assert guard.tripped_at == LATE and "instead of 0.05 s" in guard.reason
    return heights, sent


@pytest.mark.parametrize("name", FAMILIES)
@given(places=st.lists(st.floats(0.0, 1.0), min_size=8, max_size=8), load=st.floats(-1.0, 1.0))
def test_a_false_trip_under_a_steady_load_leads_out_of_no_envelope(name, places, load):
    family = BOUND[name]
    own, other = (family.from_unit(np.array(some[: family.size])) for some in (places[:4], places[4:]))
    test = flight(family, own)
    alone, _ = lift(test.controller(), test.target(0), load)
    heights, sent = guarded(test, family.controller(other), load)
    assert same_bits(heights[: LATE + 1], alone[: LATE + 1])
    # At rest under the load only the integral commands, so what takes over does not jump.
    settled = np.abs(alone[LATE - 40 : LATE + 1]).max()
    assert np.abs(heights[LATE:]).max() <= 0.01 + 3.0 * settled
    if settled < 1e-3:
        assert sent[LATE] == pytest.approx(load, abs=0.03)
    if np.abs(alone).max() <= HALF and settled < 0.05:
        assert np.abs(heights).max() <= HALF


@pytest.mark.parametrize("name", FAMILIES)
def test_what_takes_over_with_the_same_gains_goes_on_with_the_same_bits(name):
    family = BOUND[name]
    genes = family.from_unit(np.full(family.size, 0.4))
    test = flight(family, genes)
    alone = lift(test.controller(), test.target(0), 0.8)
    for fallback in (family.controller(genes), FAMILIES[name].bind(SIGNALS).controller(genes)):
        for found, expected in zip(guarded(test, fallback, 0.8), alone, strict=True):
            assert same_bits(found, expected)


@pytest.mark.parametrize("gains", [[1.5, 0.5, 1.2], [2.0, 0.6, 2.0]])
def test_a_second_flight_of_a_guard_is_the_first_one_again(gains):
    family, clock = BOUND["pid"], [0.0]
    test = flight(family, np.array([1.5, 0.5, 1.2]))
    guard = Guard(test, family.controller(gains), clock=lambda: clock[0])
    first = lift(guard, test.target(0), 0.8, clock)
    guard.reset()
    for found, expected in zip(lift(guard, test.target(0), 0.8, clock), first, strict=True):
        assert same_bits(found, expected)
    assert guard.tripped_at == LATE


def test_without_an_integral_in_the_test_none_winds_up_in_the_fallback():
    family = BOUND["pid"]
    test = flight(family, np.array([4.0, 0.0, 2.0]))
    heights, sent = guarded(test, family.controller([4.0, 1.0, 2.0]), 0.8)
    assert heights[LATE] == pytest.approx(-0.2, abs=1e-3), "which is the error that holds the load"
    assert sent[LATE] == pytest.approx(0.8, abs=0.02)
    assert np.abs(heights).max() <= HALF


def test_a_swing_of_the_moment_is_not_taken_for_a_load():
    family = BOUND["pid"]
    test = flight(family, np.array([1.5, 1.0, 1.2]))
    standby, rest = Standby(family.controller([2.0, 0.5, 2.0]), test), family.controller([2.0, 0.5, 2.0])
    for k in range(200):
        standby.follow(np.array([0.2 * np.sin(0.2 * k), 0.01 * k]), np.zeros(2))
    here = np.array([0.1, 0.3])
    assert same_bits(
        standby.command(here, np.zeros(2), np.zeros(2, bool)), rest.command(here, np.zeros(2))
    ), "its integral came back to zero within the last 4 s"
    # What has lasted for 4 s is a load, as far as it has.
    standby.reset()
    for k in range(200):
        standby.follow(np.array([-0.1 if k < 60 else 0.0, 0.01 * k]), np.zeros(2))
    u = standby.command(np.zeros(2), np.zeros(2), np.zeros(2, bool))
    assert u == pytest.approx(1.0 * 0.1 * 60 * DT, abs=1e-9)


def test_outputs_of_a_state_feedback_hand_over_what_all_integrals_together_command():
    signals = tl.Signals(
        states=[tl.State("a", "m", 1.0), tl.State("b", "m", 1.0)],
        commands=[tl.Command("u", "N", (-9.0, 9.0)), tl.Command("v", "N", (-9.0, 9.0))],
        dt=DT,
    )
    family = tl.controllers.StateFeedback(None, (-5.0, 5.0), integral=["a", "b"]).bind(signals)
    own = np.array([1.0, 0.2, 0.5, 0.1, -0.3, 1.5, 0.2, 0.7])
    other = np.array([2.0, 0.0, 1.5, -0.4, 0.1, 0.5, 0.3, 0.9])
    test = tl.Test(family, own, np.zeros(2), np.zeros(2), 50)
    standby, random = Standby(family.controller(other), test), np.random.default_rng(1)
    readings = random.normal(size=(40, 2))
    for reading in (*readings, *np.zeros((30, 2))):
        standby.follow(reading, np.zeros(2))
    here = random.normal(size=2)
    found = standby.command(here, np.zeros(2), np.zeros(2, bool))
    own, other = own.reshape(2, 4), other.reshape(2, 4)
    integral = -DT * readings.sum(axis=0)
    expected = own[:, 2:] @ integral - other[:, :2] @ here - DT * other[:, 2:] @ here
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_two_integrals_behind_one_command_share_what_it_needs():
    signals = tl.Signals(
        [tl.State("a", "m", 1.0), tl.State("b", "m", 1.0)], [tl.Command("u", "N", (-9.0, 9.0))], DT
    )
    family = tl.controllers.StateFeedback(None, (-5.0, 5.0), integral=["a", "b"]).bind(signals)
    test = tl.Test(family, np.array([1.0, 1.0, 2.0, 1.0]), np.zeros(2), np.zeros(2), 50)
    for of_integrals in ([1.0, 3.0], [0.5, 0.0]):
        fallback = family.controller([0.4, 0.3, *of_integrals])
        standby = Standby(fallback, test)
        for k in range(60):
            standby.follow(np.array([-0.1, -0.2 + 1e-6 * k]) if k < 20 else np.zeros(2), np.zeros(2))
        expected = DT * (2.0 * 0.1 * 20 + 1.0 * (0.2 * 20 - 1e-6 * 190))
        u = standby.command(np.zeros(2), np.zeros(2), np.zeros(2, bool))
        assert u == pytest.approx(expected, abs=1e-6)


class Spy:
    """A law in Python that notes what it sees, and fails when it is told to."""

    def __init__(self):
        self.seen, self.fails, self.resets = [], False, 0

    def reset(self):
        self.seen.clear()
        self.resets += 1

    def command(self, state, target):
        self.seen.append((np.array(state), np.array(target)))
        if self.fails:
            raise ZeroDivisionError("division by zero")
        return [0.5]


def spied():
    spy = Spy()
    return spy, tl.controllers.Custom(lambda kp: spy, {"kp": (0.0, 1.0)}).bind(SIGNALS).controller([0.5])


def test_a_law_in_python_runs_along_on_the_readings_of_the_flight():
    spy, fallback = spied()
    test = flight(BOUND["pid"], np.array([1.0, 0.5, 1.2]))
    guard = Guard(test, fallback, clock=None)
    readings = 0.1 * np.random.default_rng(0).normal(size=(9, 2))
    for reading in readings:
        assert guard.command(reading, [0.1, 0.0]) != 0.5
    assert same_bits(np.array([state for state, _ in spy.seen]), readings)
    assert guard.command([np.nan, 0.0], [0.1, 0.0]) == 0.5
    assert len(spy.seen) == 10 and np.isfinite(spy.seen[-1][0]).all()
    guard.reset()
    assert not spy.seen, "a flight begins from rest"


def test_a_fallback_that_fails_while_it_runs_along_ends_no_flight_and_takes_over_from_rest():
    spy, fallback = spied()
    guard = Guard(flight(BOUND["pid"], np.array([1.0, 0.5, 1.2])), fallback, clock=None)
    spy.fails = True
    for k in range(4):
        guard.command([0.01 * k, 0.0], [0.0, 0.0])
    assert not guard.tripped and len(spy.seen) == 1
    spy.fails, resets = False, spy.resets
    for _ in range(2):
        assert guard.command([np.nan, 0.0], [0.0, 0.0]) == 0.5
    assert spy.resets == resets + 1 and len(spy.seen) == 2


def test_the_errors_of_a_frozen_sensor_are_not_integrated():
    spy, fallback = spied()
    standby = Standby(fallback, flight(BOUND["pid"], np.array([1.0, 0.5, 1.2])))
    random, target = np.random.default_rng(3), np.array([0.1, 0.0])
    good = random.normal(size=(6, 2))
    stuck = np.stack([random.normal(size=7), np.full(7, good[-1, 1])], axis=1)
    for moves_again in (True, False):
        standby.reset()
        for reading in (*good, *stuck):
            standby.follow(reading, target)
        assert len(spy.seen) == 6, "what repeats itself waits"
        if moves_again:
            standby.follow(np.array([0.3, 0.4]), target)
            assert same_bits(np.array([state for state, _ in spy.seen[:13]]), np.concatenate([good, stuck]))
            assert all(same_bits(goal, target) for _, goal in spy.seen)
        else:
            standby.command(np.array([0.3, 0.4]), target, np.array([False, True]))
            assert same_bits(np.array([state for state, _ in spy.seen[:13]]), np.concatenate([good, stuck]))
            for k, (state, goal) in enumerate(spy.seen):
                assert same_bits(goal, [0.1, state[1]] if 6 <= k < 13 else target)


@pytest.mark.parametrize("name", FAMILIES)
def test_a_frozen_height_adds_nothing_to_an_integral(name):
    family = BOUND[name]
    genes = family.from_unit(np.full(family.size, 0.4))
    test, here = flight(family, genes), np.array([0.05, 0.0])
    found = []
    for periods in (5, 50):
        standby = Standby(family.controller(genes), test)
        for _ in range(periods):
            standby.follow(here, np.zeros(2))
        found.append(standby.command(here, np.zeros(2), np.array([True, True])))
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)


def test_an_angle_that_wraps_is_integrated_the_short_way_however_the_gains_differ():
    angle = tl.State("angle", "rad", 3.0, periodic=True)
    signals = tl.Signals([angle], [tl.Command("torque", "N m", (-5.0, 5.0))], DT)
    family = tl.controllers.PID(
        axes=[("angle", None)], gains={"angle.kp": (0.0, 1.0), "angle.ki": (0.0, 9.0), "angle.kd": 0.0}
    ).bind(signals)
    test = tl.Test(family, np.array([0.0, 9.0]), np.zeros(1), np.zeros(1), 50)
    standby = Standby(family.controller([0.0, 1.0]), test)
    for k in range(3):
        standby.follow(np.array([-0.5 - 0.01 * k]), np.zeros(1))
    assert standby.command(np.zeros(1), np.zeros(1), np.zeros(1, bool)) > 0.4


def test_readings_that_wait_are_bounded():
    spy, fallback = spied()
    standby = Standby(fallback, flight(BOUND["pid"], np.array([1.0, 0.5, 1.2])))
    for _ in range(WAITING + 70):
        standby.follow(np.zeros(2), np.zeros(2))
    assert len(spy.seen) == 70 and len(standby._waiting) == WAITING
