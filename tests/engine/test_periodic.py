"""States that wrap: differences take the short way everywhere, and a shift by a whole period changes nothing."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import twinloop as tl
from conftest import TINY, pendulum_step
from oracles import rk4, same_bits
from twinloop import _core, flights
from twinloop._experiment.limits import Limits
from twinloop.campaign.presets import options_of
from twinloop.controllers import PID, Cascade, StateFeedback
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.terms.libraries import LIBRARIES, rungs
from twinloop.identification.terms.pool import Pool
from twinloop.objectives import closed_loop, frozen_error, open_loop, selected_tests
from twinloop.test import final_distance
from twinloop.trajectory import check_recorded, continued

PERIOD = 8.0
"""A power of two: where readings are on a grid, whole turns are exact."""
WORKERS = _core.Workers()


def rig(periodic=PERIOD, **changes):
    """A pendulum whose angle has a period of 8."""
    return tl.Signals(
        states=[
            tl.State("angle", "rad", 3.0, periodic=periodic, **changes),
            tl.State("rate", "rad/s", 8.0, derivative_of="angle", envelope=(-12.0, 12.0)),
        ],
        commands=[tl.Command("torque", "N m", bounds=(-2.0, 2.0))],
        dt=0.05,
    )


SIGNALS = rig()
grid = st.integers(-(2**12), 2**12).map(lambda n: n / 256)
turns = st.integers(-5, 5)


@given(
    hnp.arrays(np.float64, (6, 2), elements=st.floats(-1e3, 1e3)),
    hnp.arrays(np.float64, 2, elements=st.floats(-9, 9)),
)
def test_the_difference_is_the_remainder_of_ieee(a, b):
    found = SIGNALS.difference(a, b)
    expected = [math.remainder(x, PERIOD) for x in (a[:, 0] - b[0]).tolist()]
    np.testing.assert_allclose(np.abs(found[:, 0]), np.abs(expected), rtol=0.0, atol=1e-9)
    assert same_bits(found[:, 1], a[:, 1] - b[1])
    assert same_bits(rig(periodic=False).difference(a, b), a - b)


def test_degrees_have_their_own_period_and_radians_need_none():
    heading = tl.State("heading", "deg", 180.0, periodic=360.0)
    assert heading.period == 360.0 and tl.State("a", "rad", 1.0, periodic=True).period == 2.0 * math.pi
    assert tl.State("a", "rad", 1.0).period is None
    assert tl.State.from_record(heading.to_record()) == heading


@pytest.mark.parametrize("periodic", [0.0, -1.0, np.nan, "yes"])
def test_what_is_no_period_is_refused(periodic):
    with pytest.raises(tl.InvalidInput, match="periodic"):
        tl.State("angle", "rad", 1.0, periodic=periodic)


def test_another_unit_than_radians_needs_a_number():
    with pytest.raises(tl.InvalidInput, match="for degrees"):
        tl.State("heading", "deg", 180.0, periodic=True)


BOUNDS = {"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)}
LAWS = {
    "a PID": PID(axes=[("angle", "rate")], gains=BOUNDS),
    "a PID that differences": PID(axes=[("angle", None)], gains=BOUNDS, derivative_filter=0.05),
    "a cascade": Cascade(
        axes=[("angle", "rate")],
        gains={"angle.kp": (0.0, 6.0), "rate.kp": (0.0, 1.0), "rate.ki": (0.0, 1.0), "rate.kd": 0.0},
    ),
    "a state feedback": StateFeedback(None, (0.0, 3.0), integral=["angle"]),
}


@pytest.mark.parametrize("name", LAWS)
@given(readings=st.lists(st.tuples(grid, grid, turns), min_size=1, max_size=20), goal=grid, shift=turns)
def test_whole_turns_of_a_reading_or_a_target_change_no_bit_of_a_command(name, readings, goal, shift):
    family = LAWS[name].bind(SIGNALS)
    genes = [0.75 * gain.high for gain in family.gains]
    plain, turned = family.controller(genes), family.controller(genes)
    for angle, rate, turn in readings:
        # Half a turn off, either way is the short one.
        angle += 1 / 1024
        one = plain.command([angle, rate], [goal, 0.0])
        other = turned.command([angle + PERIOD * turn, rate], [goal + PERIOD * shift, 0.0])
        assert same_bits(one, other)


def test_a_pid_leads_an_angle_the_short_way():
    family = LAWS["a PID"].bind(rig(periodic=True))
    angle, goal = np.deg2rad([170.0, -170.0])
    assert family.controller([1.0, 0.0, 0.0]).command([angle, 0.0], [goal, 0.0])[0] == pytest.approx(
        np.deg2rad(20.0)
    )


# Dynamics, objectives, qualities


def model(signals, *lines):
    text = "program inputs=3 outputs=1 registers=5\npage 1\n" + "\n".join(lines)
    return _core.Model(_core.Program.parse(text), "acceleration", signals.engine)


def pendulums(signals):
    """Models that see the angle raw, through a sine, and not at all."""
    return [
        model(signals, "r3 = r0 * -2.5", "r3 = r3 + r2"),
        model(signals, "r3 = sin(r0)", "r3 = r3 * -24.5", "r4 = r2 * 41.0", "r3 = r3 + r4"),
        model(signals, "r3 = r2 * 30.0"),
    ]


def family_of(signals):
    return LAWS["a PID"].bind(signals)


@given(st.integers(0, 2**32 - 1), turns, turns)
def test_flights_from_and_to_a_shifted_angle_are_judged_alike(seed, start, goal):
    draw = np.random.default_rng(seed)
    genes = draw.random((5, 3)) * [6.0, 6.0, 1.0]
    initial, target = draw.uniform(-3.0, 3.0, (5, 2)), draw.uniform(-3.0, 3.0, (5, 2)) * [1.0, 0.0]
    signals = rig(envelope=(-3.5, 3.5))
    found = []
    for first, last in ((0.0, 0.0), (PERIOD * start, PERIOD * goal)):
        drawn = flights.candidates(
            family_of(signals), genes, initial + np.array([first, 0.0]), target + np.array([last, 0.0]), 30
        )
        judged = [
            flights.qualities(pendulums(signals), drawn, flights.quality(kind, [1.0, 0.0]), signals)
            for kind in ("iae", "ise", "final_distance")
        ]
        found.append([*judged, flights.disagreements(pendulums(signals), drawn, [0.01, 0.1])[0]])
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_errors_of_models_do_not_see_how_a_record_was_wrapped(seed):
    draw = np.random.default_rng(seed)
    family = family_of(SIGNALS)
    rate = np.cumsum(draw.integers(-200, 200, 25)) / 64
    truth = np.column_stack([np.concatenate([[0.0], np.cumsum(rate[:-1] / 16)]), rate])
    assume((truth[:, 0] % PERIOD != PERIOD / 2.0).all())  # which may be read as either
    shifted = truth + np.column_stack([PERIOD * draw.integers(-3, 4, 25), np.zeros(25)])
    commands = draw.uniform(-2.0, 2.0, (24, 1))
    test = tl.Test(family, np.array([2.0, 1.0, 0.2]), truth[0], np.array([1.0, 0.0]), 24)
    found = []
    for states in (truth, shifted):
        record = tl.Trajectory(0.05 * np.arange(25), states, commands)
        selected = selected_tests([test], [record])
        errors = [of(pendulums(SIGNALS), selected, WORKERS) for of in (open_loop, closed_loop)]
        check_recorded(record, Limits(SIGNALS), 24)
        whole = continued(record, SIGNALS, test.initial_state)
        assert same_bits(whole.states, truth)
        found.append([*errors, frozen_error(whole, SIGNALS), final_distance(states[-1], [1.0, 0.0], SIGNALS)])
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


def test_an_angle_may_turn_as_often_as_it_likes():
    spinning = model(SIGNALS, "r3 = r3 * 0.0")
    test = tl.Test(family_of(SIGNALS), np.zeros(3), np.array([0.0, 11.0]), np.array([1.0, 0.0]), 200)
    run = tl.Twin(spinning, SIGNALS).simulate(test)
    assert run.ended == "completed" and run.states[-1, 0] == pytest.approx(110.0)
    check_recorded(run, Limits(SIGNALS), 200)
    cut = tl.Twin(model(rig(periodic=False), "r3 = r3 * 0.0"), rig(periodic=False)).simulate(
        tl.Test(family_of(rig(periodic=False)), np.zeros(3), [0.0, 11.0], [1.0, 0.0], 200)
    )
    assert cut.ended == "diverged"


# Campaigns


def on_grid(trajectory):
    return np.round(trajectory.states * 2**20) / 2**20


FEW = {
    "moves": 500, "starts": 1, "generations": 0, "lags": False, "committee_size": 3, "draws": 2, "tuning_steps": 4,
    "candidates": 8, "evaluations": 64,
}  # fmt: skip


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_campaign_asks_alike_however_the_readings_were_wrapped(preset):
    plant = tl.systems.Simulated(SIGNALS, pendulum_step)

    def asked(wrap):
        campaign = tl.Campaign(
            SIGNALS,
            controller=LAWS["a PID"],
            initial_state=[0.0, 0.0],
            target_state=[2.5, 0.0],
            duration=1.0,
            preset=preset,
            threads=1,
            options=TINY if preset == "paper" else FEW,
        )
        test = campaign.test({"angle.kp": 4.0, "angle.ki": 2.0, "angle.kd": 0.1}, excitation=None)
        for _ in range(2):
            run = plant.run(test)
            campaign.tell(
                test, tl.Trajectory(run.t, wrap(on_grid(run)), np.round(run.commands * 2**20) / 2**20)
            )
            test = campaign.ask()
        return test, campaign.best_test

    draw = np.random.default_rng(0)
    shifted = asked(lambda states: states + np.outer(PERIOD * draw.integers(-3, 4, len(states)), [1.0, 0.0]))
    for one, other in zip(asked(lambda states: states), shifted, strict=True):
        assert same_bits(one.genes, other.genes) and one.predicted == other.predicted


def test_the_equations_say_between_what_they_see_an_angle():
    twin = tl.Twin(model(rig(periodic=True), "r3 = r0 * -2.5"), rig(periodic=True))
    assert "# angle wraps: the equations see it from -3.14159 to 3.14159 rad" in twin.equations().splitlines()


def test_a_target_a_whole_turn_away_is_no_task(new_campaign):
    with pytest.raises(tl.InvalidInput, match="away from the initial state"):
        new_campaign(signals=SIGNALS, controller=LAWS["a PID"], target_state=[PERIOD, 0.0])


def test_terms_of_an_angle_that_wraps_are_its_sine_and_cosine():
    pool = Pool(3)
    ladder = rungs(pool, rig(periodic=True), LIBRARIES, 450)
    sine, cosine = pool.add("sin", 0), pool.add("cos", 0)
    assert {sine, cosine, 1, 2} <= set(ladder[0]) and 0 not in ladder[-1]
    degrees = Pool(3)
    rungs(
        degrees,
        tl.Signals(
            [tl.State("a", "deg", 90.0, periodic=360.0), tl.State("b", "m", 1.0)], SIGNALS.commands, 0.1
        ),
        LIBRARIES,
        450,
    )
    x = np.array([[30.0, 0.0, 0.0]])
    wave = degrees.wave("sin", 0, 360.0)
    assert degrees.values([wave], x)[0, 0] == pytest.approx(0.5)


def over_the_top(draw):
    """Readings and commands of a pendulum of little friction that is thrown round."""

    def derivative(u):
        return lambda x: np.array([x[1], 20.0 * u - 24.5 * np.sin(x[0]) - 0.2 * x[1]])

    commands = np.repeat(draw.uniform(-0.3, 1.0, (20, 1)), 5, axis=0)
    states = [np.array([0.0, draw.uniform(11.0, 12.0)])]
    for u in commands[:, 0]:
        states.append(rk4(derivative(u), states[-1], 0.05))
    assert np.ptp([x[0] for x in states]) > 4.0 * np.pi
    return np.array(states) + draw.normal(0.0, [2e-3, 2e-2], (101, 2)), commands


def test_a_pendulum_that_goes_over_the_top_is_identified_as_well_wrapped_as_not():
    """The same flights, with angles as an encoder of one turn reads them, and as one that counts turns does."""
    options = {
        "moves": 2000,
        "starts": 2,
        "generations": 0,
        "lags": False,
        "committee_size": 3,
        "tuning_steps": 8,
    }
    draw = np.random.default_rng(3)
    (states, commands), (others, sent) = over_the_top(draw), over_the_top(draw)
    held = {}
    for signals in (rig(periodic=True), rig(periodic=False)):
        run = Run.of(signals.wrapped(states), commands)
        found = identify_runs([run], signals, options_of("default", options), workers=WORKERS)
        following = found.model.step(signals.wrapped(others[:-1]), sent)
        errors = signals.difference(following, others[1:])
        held[signals.states[0].periodic] = np.sqrt(np.square(errors).mean(axis=0))
    assert (held[True] < 1.05 * held[False]).all() and held[True][1] < 0.1
