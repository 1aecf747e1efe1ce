"""What holds an excitation back: beside a loop that is written out, wherever the engine flies a test."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from lives import CONTROLLER, SIGNALS, made
from oracles import same_bits
from twinloop import _core
from twinloop._experiment.hold_back import BEGINS, ENDS, HoldBack
from twinloop.flights import candidates, qualities, quality
from twinloop.law.flight import fly
from twinloop.objectives import closed_loop, selected_tests

FAMILY = CONTROLLER.bind(SIGNALS)
GENES = FAMILY.genes(PENDULUM_GAINS)
STEPS = 40
EARLY = HoldBack([[-0.1, 0.2], [-np.inf, 1.0]], [[-0.5, 0.6], [-np.inf, 3.0]])
PROGRAM = _core.Program(
    3, 1, 5, [[("*", 3, 2, 30.0), ("*", 4, 1, 1.1), ("-", 3, 3, 4), ("sin", 4, 0, None), ("*", 4, 4, 24.5),
               ("-", 3, 3, 4)]],
)  # fmt: skip
MODEL = _core.Model(PROGRAM, "acceleration", SIGNALS.engine)


def test_how_far_readings_went_on_is_a_share_of_the_way_to_the_envelope():
    signals = tl.Signals(
        [tl.State("angle", "rad", 1.0, envelope=(-2.0, 1.6)), tl.State("rate", "rad/s", 1.0, envelope=(-9.0, 9.0)),
         tl.State("place", "m", 1.0)],
        [tl.Command("torque", "N m", (-1.0, 1.0))], 0.05,
    )  # fmt: skip
    held = HoldBack([[-0.1, 0.2], [-np.inf, 1.0], [0.0, 0.0]], [[-0.5, 0.6], [-np.inf, 3.0], [-1.0, 1.0]])
    still = np.zeros((5, 3))
    assert held.overrun(signals, still) == pytest.approx(max(-0.5 / 1.5, -0.6 / 1.0, -3.0 / 6.0))
    for state, value, expected in (
        (0, 1.1, 0.5),
        (0, -2.0, 1.0),
        (1, 6.0, 0.5),
        (1, -8.0, -1 / 3),
        (2, 50.0, -1 / 3),
    ):
        read = still.copy()
        read[2, state] = value
        assert held.overrun(signals, read) == pytest.approx(expected)


def share(hold_back, reading):
    """The definition: the room that is left of each end's margin, the smallest of all, within 0 and 1."""
    left = [1.0]
    for value, full, none in zip(reading, hold_back.full, hold_back.none, strict=True):
        for inner, outer in zip(full, none, strict=True):
            if np.isfinite(outer):
                left.append((outer - value) / (outer - inner))
    return max(0.0, min(left))


def excited(hold_back=EARLY, seed=0, amplitude=0.5, steps=STEPS):
    added = amplitude * np.random.default_rng(seed).normal(size=(steps, 1))
    return tl.Test(FAMILY, GENES, [0.0, 0.0], [1.0, 0.0], steps, added, hold_back=hold_back)


def written_out(step, test, noise):
    """Readings and commands of a loop in Python, with a controller that knows nothing of the excitation."""
    controller, state, readings, commands = (
        FAMILY.controller(test.genes),
        np.array(test.initial_state),
        [],
        [],
    )
    for k in range(test.steps):
        readings.append(state + noise[k])
        held = 1.0 if test.hold_back is None else share(test.hold_back, readings[-1])
        command = controller.command(readings[-1], test.target(k)) + held * test.excitation[k]
        commands.append(command.clip(-2.0, 2.0))
        state = np.asarray(step(state, commands[-1]))
    return np.array([*readings, state + noise[-1]]), np.array(commands)


@pytest.mark.parametrize("seed", range(5))
def test_a_test_that_is_held_back_flies_as_the_loop_written_out(seed):
    test, noise = excited(seed=seed), 0.05 * np.random.default_rng(seed + 9).normal(size=(STEPS + 1, 2))
    for dynamics, step in (
        (pendulum_step, pendulum_step),
        (MODEL, lambda x, u: MODEL.step(x[None], u[None])[0]),
    ):
        run = fly(dynamics, test, noise=noise)
        states, commands = written_out(step, test, noise)
        np.testing.assert_allclose(run.states, states, rtol=0, atol=1e-9)
        np.testing.assert_allclose(run.commands, commands, rtol=0, atol=1e-9)
    # And it matters here.
    assert np.abs(run.commands - fly(MODEL, excited(None, seed), noise=noise).commands).max() > 0.1


@given(
    hnp.arrays(np.float64, (6, 2), elements=st.floats(-4.0, 4.0)),
    hnp.arrays(np.float64, (2, 2, 2), elements=st.floats(0.1, 2.0)),
)
def test_a_controller_of_ones_own_loop_sends_the_share_that_is_defined(readings, widths):
    full = np.stack([-widths[0, :, 0], widths[0, :, 1]], axis=1)
    hold_back = HoldBack(full, full + [-1.0, 1.0] * widths[1])
    controller = FAMILY.controller(GENES, np.full((6, 1), 0.5), hold_back)
    plain = FAMILY.controller(GENES)
    for reading in readings:
        command, alone = (c.command(reading, [1.0, 0.0]) for c in (controller, plain))
        expected = np.clip(alone + 0.5 * share(hold_back, reading), -2.0, 2.0)
        np.testing.assert_allclose(command, expected, rtol=0, atol=1e-12)


def test_the_closed_loop_of_a_model_replays_what_was_held_back_beside_tests_that_were_not():
    tests = [excited(held, seed) for seed, held in enumerate((EARLY, None, EARLY, None, EARLY))]
    runs = [fly(MODEL, test) for test in tests]
    assert (closed_loop([MODEL], selected_tests(tests, runs))[0] == 0.0).all()
    forgotten = [excited(None, seed) for seed in range(5)]
    errors = closed_loop([MODEL], selected_tests(forgotten, runs))[0]
    assert (errors[[0, 2, 4]] > 1e-4).all() and (errors[[1, 3]] == 0.0).all()


def test_flights_on_a_committee_are_held_back_alike():
    measure = quality("iae", [1.0, 0.0])
    for seed in range(3):
        test = excited(seed=seed)
        run = fly(MODEL, test)
        flights = candidates(
            FAMILY, GENES[None], test.initial_state, test.target_state, STEPS, excitation=test.excitation[None],
            hold_back=EARLY,
        )  # fmt: skip
        found, _ = qualities([MODEL], flights, measure, SIGNALS)
        expected = SIGNALS.dt * np.abs(run.states[1:, 0] - 1.0).sum()
        assert found[0, 0, 0] == pytest.approx(expected, rel=1e-12)


def test_it_ends_within_the_room_that_the_task_leaves():
    signals = tl.Signals(
        [
            tl.State("x", "m", 1.0, envelope=(-2.0, 4.0)),
            tl.State("v", "m/s", 1.0, envelope=(-1.0, 1.0)),
            tl.State("w", "m", 1.0),
            tl.State("turn", "rad", 1.0, envelope=(-1.0, 1.0), periodic=True),
        ],
        [tl.Command("u", "V", (-1.0, 1.0))],
        0.1,
    )
    start, target = [0.0, 0.0, 0.0, 0.0], [[1.0, 0.0, 0.0, 0.0], [2.0, 1.0, 0.0, 0.0]]
    held = HoldBack.between(signals, start, target)
    assert np.array_equal(held.full[0], [0.0 - BEGINS * 2.0, 2.0 + BEGINS * 2.0])
    assert np.array_equal(held.none[0], [0.0 - ENDS * 2.0, 2.0 + ENDS * 2.0])
    # A task to the very end of an envelope leaves no room; a state without one, and an angle that wraps, have no say.
    assert np.array_equal(held.none[1], [-ENDS, np.inf])
    assert np.isinf(held.none[2:]).all()
    assert list(held.ranges(signals)) == ["x", "v"] and held.ranges(signals)["v"]["none"] == [-ENDS, None]
    free = tl.Signals([tl.State("x", "m", 1.0)], [tl.Command("u", "V", (-1.0, 1.0))], 0.1)
    assert HoldBack.between(free, [0.0], [1.0]) is None


def test_a_rate_has_no_more_room_than_what_it_is_the_rate_of_in_the_time_of_a_swing():
    signals = tl.Signals(
        [
            tl.State("x", "m", 1.0, envelope=(-2.0, 4.0)),
            tl.State("v", "m/s", 1.0, derivative_of="x", envelope=(-90.0, 7.0)),
            tl.State("free", "m", 1.0),
            tl.State("w", "m/s", 1.0, derivative_of="free"),
        ],
        [tl.Command("u", "V", (-1.0, 1.0))],
        0.1,
    )
    held = HoldBack.between(signals, np.zeros(4), [1.0, 0.0, 0.0, 0.0], 0.5)
    assert np.array_equal(held.none[0], [-2.0 * ENDS, 1.0 + 3.0 * ENDS])
    assert np.allclose(held.none[1], [-ENDS * 2.0 / 0.5, ENDS * 3.0 / 0.5])
    assert np.allclose(held.full[1], [-BEGINS * 2.0 / 0.5, BEGINS * 3.0 / 0.5])
    assert np.isinf(held.none[2:]).all()
    # A shorter swing: its own envelope has the say.
    assert HoldBack.between(signals, np.zeros(4), np.zeros(4), 0.1).none[1][1] == 7.0 * ENDS


@pytest.mark.parametrize("order", list(permutations(("place", "speed", "acceleration", "jerk"))))
def test_a_rate_has_the_room_of_its_integral_in_whatever_order_they_are_declared(order):
    known = {
        "place": tl.State("place", "m", 1.0, envelope=(-1.0, 1.0)),
        "speed": tl.State("speed", "m/s", 1.0, derivative_of="place", envelope=(-10.0, 10.0)),
        "acceleration": tl.State("acceleration", "m/s²", 1.0, derivative_of="speed", envelope=(-3.0, 100.0)),
        "jerk": tl.State("jerk", "m/s³", 1.0, derivative_of="acceleration", envelope=(-1e3, 1e3)),
    }
    signals = tl.Signals([known[name] for name in order], [tl.Command("u", "N", (-1.0, 1.0))], 0.05)
    ranges = HoldBack.between(signals, np.zeros(4), np.zeros(4), 0.5).ranges(signals)
    # Divided by half a second from state to state, but no more than the envelope leaves.
    rooms = {"place": (-1.0, 1.0), "speed": (-2.0, 2.0), "acceleration": (-3.0, 4.0), "jerk": (-6.0, 8.0)}
    for name, room in rooms.items():
        assert ranges[name]["none"] == pytest.approx([ENDS * end for end in room])


def test_an_excitation_may_lead_as_far_as_the_controller_by_itself_as_long_as_a_fifth_of_the_room_is_left():
    signals = tl.Signals(
        [
            tl.State("x", "m", 1.0, envelope=(-2.0, 4.0)),
            tl.State("v", "m/s", 1.0, derivative_of="x", envelope=(-9.0, 9.0)),
            tl.State("free", "m", 1.0),
        ],
        [tl.Command("u", "V", (-1.0, 1.0))],
        0.1,
    )
    start, target = np.zeros(3), [1.0, 0.0, 0.0]
    # Of x's upper room, 3, it has used 2; its lower end is within the task. Of v it has used nearly all below.
    held = HoldBack.between(signals, start, target, 0.5, [[0.5, -8.9, -7.0], [3.0, 1.0, 7.0]])
    assert np.allclose(held.none[0], [-ENDS * 2.0, 3.0])
    assert np.allclose(held.full[0], [-BEGINS * 2.0, 3.0 - (ENDS - BEGINS) * 3.0])
    # A fifth of 9 is left below. Above, it has used less than an excitation may without it.
    assert np.allclose(held.none[1], [-7.2, ENDS * 3.0 / 0.5])
    assert np.allclose(held.full[1], [-7.2 + (ENDS - BEGINS) * 2.0 / 0.5, BEGINS * 3.0 / 0.5])
    assert np.isinf(held.none[2]).all()
    # Beyond the envelope it still has a say.
    beyond = HoldBack.between(signals, start, target, None, [[-5.0] * 3, [9.0] * 3])
    assert np.allclose(beyond.none[0], [-1.6, 1.0 + 2.4])


def test_a_controller_that_has_used_little_changes_nothing():
    signals = tl.Signals(
        [tl.State("x", "m", 1.0, envelope=(-2.0, 4.0))], [tl.Command("u", "V", (-1.0, 1.0))], 0.1
    )
    alone = HoldBack.between(signals, [0.0], [1.0])
    for reached in ([[0.0], [1.0]], [[-0.7], [2.1]]):
        held = HoldBack.between(signals, [0.0], [1.0], None, reached)
        assert np.array_equal(held.full, alone.full) and np.array_equal(held.none, alone.none)


@pytest.mark.parametrize("beyond", [-1.5, 1.5])
def test_a_task_beyond_its_envelope_is_held_back_on_the_other_side_only(beyond):
    signals = tl.Signals(
        [tl.State("x", "m", 1.0, envelope=(-1.0, 1.0))], [tl.Command("u", "V", (-1.0, 1.0))], 0.1
    )
    held = HoldBack.between(signals, [0.0], [beyond])
    assert np.isinf(held.none[0, int(beyond > 0)]) and abs(held.none[0, int(beyond < 0)]) == ENDS


def test_a_first_test_is_held_back_unless_that_is_switched_off():
    test = made().test(PENDULUM_GAINS)
    assert test.hold_back is not None and test.excitation is not None
    assert made(options={"hold_back": False}).test(PENDULUM_GAINS).hold_back is None
    assert made().test(PENDULUM_GAINS, excitation=None).hold_back is None
    assert made().test(PENDULUM_GAINS, excitation=np.zeros((20, 1))).hold_back is None
    assert test.quiet().hold_back is None and not test.same_as(test.quiet())
    read = tl.Test.from_record(test.to_record(), FAMILY)
    assert read.same_as(test) and same_bits(read.hold_back.none, test.hold_back.none)


@pytest.mark.parametrize(
    ("full", "none"),
    [
        ([[0.0, 1.0]], [[0.0, 2.0]]),
        ([[0.0, np.inf]], [[-1.0, 2.0]]),
        ([[0.0, 1.0]], [[-1.0, np.inf]]),
        ([[0.0, 1.0]], [[-1.0, 2.0], [-1.0, 2.0]]),
        ([0.0, 1.0], [-1.0, 2.0]),
        ([[np.nan, 1.0]], [[-1.0, 2.0]]),
    ],
)
def test_ranges_that_are_none_are_refused(full, none):
    with pytest.raises(tl.InvalidInput, match=r"hold-back|HoldBack"):
        HoldBack(full, none)


def test_one_of_other_states_is_refused():
    one = HoldBack([[0.0, 1.0]], [[-1.0, 2.0]])
    with pytest.raises(tl.InvalidInput, match="expected ranges of 2 states, found 1"):
        excited(one)
    with pytest.raises(tl.InvalidInput, match="expected ranges of 2 states, found 1"):
        FAMILY.controller(GENES, np.zeros((3, 1)), one)


def test_a_mode_that_the_controller_does_not_know_is_not_driven_far():
    """A load swings at 12 rad/s under a mass that the controller turns; it reads the swing and does not answer it."""
    signals = tl.Signals(
        [
            tl.State("angle", "rad", 1.0, envelope=(-1.4, 1.4)),
            tl.State("rate", "rad/s", 6.0, derivative_of="angle", envelope=(-8.0, 8.0)),
            tl.State("swing", "rad", 0.15, envelope=(-0.3, 0.3)),
            tl.State("swing_rate", "rad/s", 1.8, derivative_of="swing", envelope=(-3.6, 3.6)),
        ],
        [tl.Command("torque", "N m", bounds=(-1.0, 1.0))],
        0.02,
    )

    def step(x, u):
        angle, rate, swing, swing_rate = x
        for _ in range(4):
            rate += 0.005 * (1000.0 * u[0] - 0.3 * rate)
            angle += 0.005 * rate
            swing_rate += 0.005 * (1000.0 * u[0] - 144.0 * swing - 0.24 * swing_rate)
            swing += 0.005 * swing_rate
        return np.array([angle, rate, swing, swing_rate])

    gains = {"angle.kp": 0.009, "angle.ki": 0.0045, "angle.kd": 0.0048}
    controller = tl.controllers.PID(
        axes=[("angle", "rate")], gains={name: (0.0, 4.0 * gain) for name, gain in gains.items()}
    )

    def used(hold_back, excitation="gentle", seed=0):
        campaign = tl.Campaign(
            signals, controller=controller, initial_state=np.zeros(4), target_state=[0.7, 0.0, 0.0, 0.0],
            duration=3.0, seed=seed, options={"hold_back": hold_back},
        )  # fmt: skip
        states = np.abs(fly(step, campaign.test(gains, excitation)).states)
        return float((states / [1.4, 8.0, 0.3, 3.6]).max())

    alone = used(True, None)
    assert max(used(False, seed=seed) for seed in range(6)) > 1.5 * alone
    assert max(used(True, seed=seed) for seed in range(6)) < 1.2 * alone


def test_only_some_states_may_count():
    start, target = np.zeros(SIGNALS.n_x), np.zeros(SIGNALS.n_x)
    every = HoldBack.between(SIGNALS, start, target)
    for place in range(SIGNALS.n_x):
        one = HoldBack.between(SIGNALS, start, target, by=[place])
        others = [i for i in range(SIGNALS.n_x) if i != place]
        if not np.isfinite(every.none[place]).any():
            assert one is None
            continue
        assert same_bits(one.none[place], every.none[place]) and same_bits(one.full[place], every.full[place])
        assert np.isinf(one.none[others]).all() and np.isinf(one.full[others]).all()
    assert HoldBack.between(SIGNALS, start, target, by=[]) is None
