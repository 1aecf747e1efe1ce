"""Flights without their controller, of systems that are unstable by themselves: how far a right law is followed."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.streams import Unit
from twinloop.law.flight import fly
from twinloop.law.noise import CorrelatedDisturbance, Noise
from twinloop.law.pieces import held, in_pieces, judged_length, left

SIGNALS = tl.Signals(
    [tl.State("lean", "rad", 0.5), tl.State("rate", "rad/s", 4.0, derivative_of="lean")],
    [tl.Command("torque", "N m", (-4.0, 4.0))],
    0.01,
)
NOISE = np.array([2e-3, 2e-2])
LIMITS = Limits(SIGNALS)
STEPS = 600


def law(gravity=25.0, authority=-32.0, damping=-0.3):
    """lean'' = gravity lean + damping lean' + authority torque/4."""
    page = [f"r3 = r0 * {gravity!r}", f"r4 = r2 * {authority!r}", "r3 = r3 + r4"]
    page += [f"r4 = r1 * {damping!r}", "r3 = r3 + r4"]
    return _core.Model(_core.Program.parse(program_text(3, 1, 5, [page])), "acceleration", SIGNALS.engine)


def flown(truth, seed=0, noise=NOISE):
    """What a controller that holds it records while it follows a target that moves."""
    family = tl.controllers.PID(
        [("lean", "rate")], {"lean.kp": (-20.0, 20.0), "lean.ki": 0.0, "lean.kd": (-4.0, 4.0)}
    ).bind(SIGNALS)
    target = np.zeros((STEPS + 1, 2))
    target[:, 0] = 0.15 * np.sin(2.5 * SIGNALS.dt * np.arange(STEPS + 1)) + 0.05
    test = tl.Test(family, family.genes({"lean.kp": -8.0, "lean.kd": -1.0}), np.zeros(2), target, STEPS)
    run = fly(truth, test, limits=LIMITS)
    assert run.steps == STEPS
    readings = run.states + noise * np.random.default_rng(seed).standard_normal(run.states.shape)
    return tl.Trajectory(run.t, readings, run.commands)


def piece(model, flight, noise, limits):
    """Steps of a piece where nothing but the sensors' noise disturbs."""
    return judged_length(model, flight, Noise.of_sensors(noise), limits)


def follows(model, flight, length, noise=NOISE, each=False):
    """Whether a replay in pieces follows the flight; each of its states by itself, if that is asked for."""
    scales = np.array([state.scale for state in SIGNALS.states])
    replay = in_pieces(Replay(SIGNALS, flight.states[0], flight.commands), model, flight.states, length)
    run = fly(model, replay, limits=LIMITS)
    if run.steps < flight.steps:
        return False
    free, frozen = (
        np.square((flight.states[1:] - states) / scales).mean(axis=0)
        for states in (run.states[1:], held(flight.states, length))
    )
    seen = np.square(noise / scales)
    if each:
        return not any(map(left, free.tolist(), frozen.tolist(), seen.tolist()))
    return not left(float(free.mean()), float(frozen.mean()), float(seen.mean()))


def test_a_right_law_of_an_unstable_system_is_followed_in_pieces():
    flight = flown(law())
    assert not follows(law(), flight, STEPS)
    length = piece(law(), flight, NOISE, LIMITS)
    # 0.2 s is its time constant: noise of 0.002 rad grows to the motion's size within a few of them.
    assert 20 < length < 200
    assert follows(law(), flight, length)


@pytest.mark.parametrize("times", [0.5, 2.0, 4.0])
def test_under_any_noise_that_the_motion_exceeds_a_right_law_follows_and_a_wrong_one_does_not(times):
    noise = times * NOISE
    flight = flown(law(), noise=noise)
    length = piece(law(), flight, noise, LIMITS)
    assert follows(law(), flight, length, noise)
    for wrong in (
        {"gravity": 0.0},
        {"gravity": 12.0},
        {"gravity": 60.0},
        {"authority": 32.0},
        {"authority": -16.0},
    ):
        model = law(**wrong)
        assert not follows(model, flight, piece(model, flight, noise, LIMITS), noise)


def test_pieces_are_the_shorter_the_larger_the_noise():
    lengths = [piece(law(), flown(law(), noise=t * NOISE), t * NOISE, LIMITS) for t in (0.5, 1.0, 4.0)]
    assert STEPS > lengths[0] > lengths[1] > lengths[2] > 20
    # Of motion that is lost in noise nothing can be said: the whole flight is judged, and not followed.
    assert piece(law(), flown(law(), noise=8.0 * NOISE), 8.0 * NOISE, LIMITS) == STEPS


@pytest.mark.parametrize("share", [0.95, 1.05])
def test_a_law_that_is_right_to_a_twentieth_follows(share):
    flight, model = flown(law()), law(gravity=25.0 * share, authority=-32.0 / share)
    assert follows(model, flight, piece(model, flight, NOISE, LIMITS))


@pytest.mark.parametrize(
    "wrong",
    [{"gravity": 0.0}, {"authority": 32.0}, {"gravity": -25.0}, {"authority": 0.0}, {"gravity": 400.0}],
)
def test_a_wrong_law_is_not_followed_in_whatever_pieces_it_asks_for(wrong):
    model, flight = law(**wrong), flown(law())
    assert not follows(model, flight, piece(model, flight, NOISE, LIMITS))


def gusty(truth, seed=0):
    """A record of what gusts do to a system that a controller holds, and those gusts as a twin knows them."""
    gust = CorrelatedDisturbance((1, 0), "acceleration", 3.0, 0.2)
    noise = Noise(NOISE, np.zeros(2), (gust,), SIGNALS.dt)
    family = tl.controllers.PID(
        [("lean", "rate")], {"lean.kp": (-20.0, 20.0), "lean.ki": 0.0, "lean.kd": (-4.0, 4.0)}
    ).bind(SIGNALS)
    target = np.zeros((STEPS + 1, 2))
    target[:, 0] = 0.5 * np.sign(np.sin(4.0 * SIGNALS.dt * np.arange(STEPS + 1)))
    test = tl.Test(family, family.genes({"lean.kp": -2.5, "lean.kd": -0.6}), np.zeros(2), target, STEPS)
    seen, moved = noise.drawn(1, STEPS, Unit(seed).part(1).stream("repeats"), ())
    run = fly(truth, test, noise=seen[0], disturbance=moved[0], limits=LIMITS)
    assert run.steps == STEPS
    return run, noise


def test_a_right_law_in_gusts_is_followed_in_pieces_and_a_wrong_one_is_not():
    """Without gravity nothing is unstable: gusts alone take the replay away."""
    right = law(gravity=0.0)
    flight, noise = gusty(right)
    assert not follows(right, flight, STEPS)
    assert piece(right, flight, NOISE, LIMITS) == STEPS
    length = judged_length(right, flight, noise, LIMITS)
    assert 10 <= length < 100 and follows(right, flight, length, each=True)
    for wrong in ({"authority": 0.0}, {"authority": 32.0}, {"authority": -64.0}):
        # What a wrong law misses is taken for larger gusts.
        for times in (1.0, 3.0):
            larger = replace(noise, correlated=(noise.correlated[0]._replace(sd=3.0 * times),))
            model = law(**{"gravity": 0.0, **wrong})
            assert not follows(model, flight, judged_length(model, flight, larger, LIMITS), each=True)


def test_a_flight_that_a_model_follows_or_could_be_expected_to_is_judged_in_whole():
    stable = law(gravity=-25.0)
    flight = flown(stable)
    assert piece(stable, flight, NOISE, LIMITS) == STEPS and follows(stable, flight, STEPS)
    # Nothing grows on it, so what it is off is its own.
    assert piece(law(gravity=-12.0, authority=0.0), flight, NOISE, LIMITS) == STEPS


def test_what_a_twin_says_of_a_log_is_that_of_the_pieces():
    flight = flown(law())
    twin = tl.Twin(law(), SIGNALS, flights=[flight])
    length = twin.piece_of(flight)
    assert 20 < length < 200
    beside = twin.free_run(Replay(SIGNALS, flight.states[0], flight.commands), flight)
    off = np.abs(beside.states - flight.states).max(axis=0)
    assert beside.steps == STEPS and (off < [0.1, 0.6]).all()
    assert all(row.fit > 50.0 for row in twin.fit(flight))
    assert not all(row.fit > 50.0 for row in tl.Twin(law(gravity=0.0), SIGNALS).fit(flight))


def test_a_replay_goes_on_from_its_anchors_and_its_lag_as_it_was():
    lag = _core.Model(
        _core.Program.parse(program_text(3, 1, 4, [["r3 = r2 * 4.0"]])), "acceleration", SIGNALS.engine,
        actuators=[(0.5, 0, 0.0, 0.0)],
    )  # fmt: skip
    commands = np.ones((100, 1))
    anchors = np.full((101, 2), np.nan)
    anchors[50] = [0.3, -0.2]
    whole, anchored = (
        fly(lag, Replay(SIGNALS, np.zeros(2), commands, each), limits=LIMITS).states
        for each in (None, anchors)
    )
    np.testing.assert_array_equal(anchored[:50], whole[:50])
    assert anchored[50].tolist() == [0.3, -0.2]
    # From there on it moves by what it moves without: the commands' effect has not begun anew.
    moved = whole[51:, 1] - whole[50, 1]
    np.testing.assert_allclose(anchored[51:, 1], -0.2 + moved, rtol=1e-12)
