"""What a free run misses, state by state, and what explains it: gusts from outside do, a model error does not."""

from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.streams import Unit
from twinloop.campaign.identify_and_plan.following import following
from twinloop.campaign.identify_and_plan.misses import expected_misses, misses_any, misses_of
from twinloop.law.noise import CorrelatedDisturbance, Noise

DT, STEPS, SENSOR, GUST, CALM = 0.02, 200, 1e-4, 0.5, 0.4
SIGNALS = tl.Signals(
    [
        tl.State("angle", "rad", 1.0),
        tl.State("rate", "rad/s", 5.0, derivative_of="angle"),
        tl.State("level", "m", 1.0),
    ],
    [tl.Command("torque", "N m", (-10.0, 10.0), scale=1.0)],
    DT,
)
FAMILY = tl.controllers.PID(
    axes=[("angle", "rate")],
    gains={"angle.kp": (0.0, 60.0), "angle.ki": (0.0, 9.0), "angle.kd": (0.0, 20.0)},
).bind(SIGNALS)
TEST = tl.Test(
    FAMILY, FAMILY.genes({"angle.kp": 6.0, "angle.ki": 0.0, "angle.kd": 3.0}), [0.5, 0.0, 3.0], np.zeros(3), STEPS
)  # fmt: skip


def model(push=0.0):
    """rate' = torque + push, level' = −level."""
    lines = [[f"r4 = r3 + {push!r}", "r5 = r2 * -1.0"]]
    return _core.Model(_core.Program.parse(program_text(4, 2, 6, lines)), "acceleration", SIGNALS.engine)


def flights(gust, count=3):
    """Flights of the same law without a push, in gusts of a size that are forgotten to 1/e in CALM seconds."""
    found, kept = [], np.exp(-DT / CALM)
    for seed in range(count):
        random, controller = np.random.default_rng(seed), TEST.controller()
        controller.reset()
        x, g = np.array([0.5, 0.0, 3.0]), gust * random.standard_normal()
        states, sent = [x + SENSOR * random.standard_normal(3)], []
        for k in range(STEPS):
            u = controller.command(states[-1], TEST.target(k))
            a = float(u[0]) + g
            x = np.array([x[0] + DT * x[1] + 0.5 * DT * DT * a, x[1] + DT * a, x[2] * np.exp(-DT)])
            g = kept * g + np.sqrt(1.0 - kept * kept) * gust * random.standard_normal()
            states.append(x + SENSOR * random.standard_normal(3))
            sent.append(u)
        run = tl.Trajectory(DT * np.arange(STEPS + 1), np.array(states), np.array(sent))
        found.append(SimpleNamespace(test=TEST, number=seed, replayed=TEST, trajectory=run))
    return found


GUSTS = Noise(
    np.full(3, SENSOR), np.zeros(3), (CorrelatedDisturbance((1, 0), "acceleration", GUST, CALM),), DT
)
BESIDE = (Unit(0), Limits(SIGNALS), _core.Workers(1))


def test_gusts_from_outside_explain_what_they_do():
    flown = flights(GUST)
    assert misses_of(model(), flown, GUSTS, {1: "disturbance"}, *BESIDE) == []


def test_what_may_be_an_error_of_the_law_explains_nothing_for_certain():
    flown = flights(GUST)
    angle, rate = misses_of(model(), flown, GUSTS, {1: "undecided"}, *BESIDE)
    assert (angle.state, rate.state) == (0, 1) and angle.undecided and rate.undecided
    assert (
        set(angle.flights) == set(rate.flights) == {0, 1, 2}
        and 0.03 < angle.share < 1.0
        and angle.times > 3.0
    )
    # For certain it is none: then nothing would explain it.
    found = misses_of(model(), flown, GUSTS, {1: "law"}, *BESIDE)
    assert [miss.state for miss in found] == [0, 1] and not any(miss.undecided for miss in found)


@pytest.mark.parametrize("cause", ["disturbance", "undecided", "law"])
def test_more_than_gusts_can_do_is_missed_whatever_these_are(cause):
    found = misses_of(model(push=8.0), flights(0.0), GUSTS, {1: cause}, *BESIDE)
    assert [miss.state for miss in found] == [0, 1] and not any(miss.undecided for miss in found)


def test_a_state_is_missed_that_is_small_beside_the_others():
    """The angle settles a fortieth of a radian beside its target; the level goes a hundred times as far."""
    flown, noise = flights(0.0), GUSTS.without([1])
    assert noise.correlated == () and GUSTS.correlated
    wrong = model(push=0.15)
    followed = following([wrong], flown, BESIDE[1], BESIDE[2])
    assert not misses_any(wrong, followed, flown, noise, {}, *BESIDE)
    (angle, *_) = misses_of(wrong, flown, noise, {}, *BESIDE)
    assert angle.state == 0 and len(angle.flights) == 3


def test_a_twin_that_diverges_misses_every_state():
    found = misses_of(model(push=1e9), flights(GUST), GUSTS, {1: "undecided"}, *BESIDE)
    assert [miss.state for miss in found] == [0, 1, 2] and all(np.isinf(miss.times) for miss in found)


def test_without_noise_and_disturbances_nothing_is_expected_to_be_missed_in_pieces_either():
    """A replay that begins again is read at its anchors; what it came to before them is no noise."""
    (flown,) = flights(GUST, count=1)
    replayed = Replay(SIGNALS, flown.trajectory.states[0], flown.trajectory.commands)
    log = SimpleNamespace(test=None, number=None, replayed=replayed, trajectory=flown.trajectory)
    calm, gusty = Noise.of_sensors(np.zeros(3)), GUSTS
    (nothing,) = expected_misses(model(), np.array([10]), [log], calm, *BESIDE)
    np.testing.assert_array_equal(nothing, 0.0)
    (some,) = expected_misses(model(), np.array([10]), [log], gusty, *BESIDE)
    assert (some[:2] > 0.0).all()


def test_a_replay_is_expected_to_miss_what_the_noise_of_its_first_reading_grows_to():
    """Of a double integrator: the angle's own noise, that of its start, and that of the rate over the time since."""
    commands = np.zeros((STEPS, 1))
    run = tl.Trajectory(DT * np.arange(STEPS + 1), np.zeros((STEPS + 1, 3)), commands)
    log = SimpleNamespace(
        test=None, number=None, replayed=Replay(SIGNALS, np.zeros(3), commands), trajectory=run
    )
    noise = Noise.of_sensors(np.full(3, SENSOR))
    found = [
        expected_misses(model(), np.array([STEPS]), [log], noise, Unit(seed), *BESIDE[1:])[0]
        for seed in range(40)
    ]
    since = DT * np.arange(1, STEPS + 1)
    scales = np.array([state.scale for state in SIGNALS.states])
    of_angle, of_rate = 2.0 + np.square(since).mean(), 2.0
    expected = SENSOR**2 * np.array([of_angle, of_rate]) / scales[:2] ** 2
    np.testing.assert_allclose(np.mean(found, axis=0)[:2], expected, rtol=0.15)
