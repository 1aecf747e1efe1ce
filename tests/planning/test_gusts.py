"""Gusts: a predicted quality spreads by what disturbances do to the flight, beside what members and sensors do."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.law.noise import CorrelatedDisturbance, Noise
from twinloop.planning.gusts import DRAWS, UNMOVED, Gusts, Moved
from twinloop.planning.judging import Committee, Task
from twinloop.planning.planner import Planner
from twinloop.planning.quality import quality_of

DT, STEPS, KICK = 0.1, 60, 0.01
SIGNALS = tl.Signals([tl.State("x", "m", 2.0)], [tl.Command("u", "N", (-1.0, 1.0))], DT)
WORKERS = _core.Workers(1)


UNIT = Unit(3).part(0)


def moved(noise, growth=0.0, start=5.0, envelope=None):
    """Of x' = growth x, which no command drives, so that it stays far from its target at 0."""
    signals = tl.Signals([tl.State("x", "m", 2.0, envelope=envelope)], SIGNALS.commands, DT)
    family = tl.controllers.PID(
        axes=[("x", None)], gains={"x.kp": (0.0, 1.0), "x.ki": 0.0, "x.kd": 0.0}
    ).bind(signals)
    lines = [[f"r2 = r0 * {growth!r}"]]
    model = _core.Model(_core.Program.parse(program_text(2, 1, 3, lines)), "acceleration", signals.engine)
    test = tl.Test(family, family.genes({"x.kp": 0.0}), [start], [0.0], STEPS)
    quality = quality_of("iae", signals, [1.0])
    return Gusts(model, noise, quality, UNIT, Limits(signals), WORKERS).on(test)


def test_kicks_add_up_to_what_a_random_walk_adds_to_an_integrated_error():
    # |x| = x, so that the error's integral moves by DT Σ of the walk, of which kick j is in all readings after it.
    expected = DT * KICK * np.sqrt(np.square(np.arange(1, STEPS + 1)).sum())
    bias, spread, *_ = moved(Noise(np.zeros(1), np.array([KICK]), dt=DT))
    assert spread == pytest.approx(expected, rel=0.35)
    # In proportion: as often better as worse, by as much.
    assert bias == pytest.approx(0.0, abs=1e-12)


def test_at_the_target_every_disturbance_is_a_bias():
    # |walk| is √(2/π) of its standard deviation on average, KICK √j after j kicks; the first reading is the start.
    bias, spread, *_ = moved(Noise(np.zeros(1), np.array([KICK]), dt=DT), start=0.0)
    expected = DT * KICK * np.sqrt(2.0 / np.pi) * np.sqrt(np.arange(1, STEPS + 1)).sum()
    assert bias == pytest.approx(expected, rel=0.4) and spread > 0.0


def test_a_prediction_is_moved_and_its_variances_add():
    assert Moved(0.5, 3.0).added_to(2.0, 4.0) == (2.5, 5.0)
    assert UNMOVED.added_to(2.0, 4.0) == (2.0, 4.0)


def test_a_gust_that_is_forgotten_slowly_moves_it_more_than_one_that_is_forgotten_at_once():
    slow, quick = (
        moved(Noise(np.zeros(1), np.zeros(1), (CorrelatedDisturbance((0,), "acceleration", 0.1, time),), DT))
        for time in (5.0, 0.05)
    )
    assert slow.spread > 3.0 * quick.spread > 0.0


def test_sensors_alone_and_flights_that_diverge_add_nothing():
    assert moved(Noise(np.array([0.1]), np.zeros(1), dt=DT)) == UNMOVED
    assert moved(Noise(np.zeros(1), np.array([KICK]), dt=DT), growth=4.0) == UNMOVED


@pytest.mark.parametrize("bound", [0.05, 0.1, 0.2, 1.0])
def test_flights_that_walk_out_of_the_envelope_are_counted(bound):
    noise = Noise(np.zeros(1), np.array([KICK]), dt=DT)
    walks = noise.disturbance(DRAWS // 2, STEPS, UNIT.stream("repeats"))[:, :, 0].cumsum(axis=1)
    beyond = int((np.abs(walks).max(axis=1) > bound).sum())
    found = moved(noise, start=0.0, envelope=(-bound, bound))
    # The same with the opposite sign leave on the other side.
    assert found.left == 2 * beyond
    assert found.risk == pytest.approx((2 * beyond + 0.5) / (DRAWS + 1.0) if beyond else 0.0)


def test_flights_that_diverge_have_left():
    found = moved(Noise(np.zeros(1), np.array([KICK]), dt=DT), growth=3.0, start=0.0)
    assert found.left == DRAWS and np.isfinite([found.bias, found.spread]).all()


def test_where_nothing_disturbs_nothing_is_moved():
    assert moved(Noise.of_sensors(np.ones(1))) == UNMOVED


def gusts_of(model, noise):
    return Gusts(model, noise, quality_of("iae", SIGNALS, [1.0]), UNIT, Limits(SIGNALS), WORKERS)


def integrator():
    """x' = u."""
    program = _core.Program.parse(program_text(2, 1, 3, [["r2 = r1 * 1.0"]]))
    return _core.Model(program, "acceleration", SIGNALS.engine)


def test_every_draw_has_its_opposite_and_is_the_same_each_time():
    noise = Noise(np.zeros(1), np.array([KICK]), dt=DT)
    one, other = (gusts_of(integrator(), noise).tuned_in(8, STEPS) for _ in range(2))
    assert one.shape == (8, STEPS, 1) and np.abs(one).min() > 0.0
    assert (one[:4] == -one[4:]).all() and (one == other).all()


def test_gains_are_tuned_for_the_disturbances_that_flights_meet():
    """x grows by w - b (x + n): a high gain fights w and a low one n, and (b² n² + w²) / (2 b - b²) is left."""
    kick, sensor, steps = 0.02, 0.1, 400
    family = tl.controllers.PID(
        axes=[("x", None)], gains={"x.kp": (0.01, 9.0, "log"), "x.ki": 0.0, "x.kd": 0.0}
    ).bind(SIGNALS)
    model, start = integrator(), np.zeros(1)
    planner = Planner(
        family, Task(start, start, steps), quality_of("iae", SIGNALS, [1.0]),
        options_of("default", {"evaluations": 2000}), limits=Limits(SIGNALS), seed=5, workers=WORKERS,
    )  # fmt: skip
    sds, met = np.array([sensor]), Noise(np.array([sensor]), np.array([kick]), dt=DT)
    gusts = gusts_of(model, met)
    committees = [
        Committee([model], sds, True, gusts=gusts, foretells=foretells) for foretells in (True, False)
    ]
    tuned = [planner.tune(committee, [family.genes({"x.kp": 1.0})], 0) for committee in committees]
    gusty, calm = (tl.Test(family, genes, start, start, steps).parameters["x.kp"] for genes in tuned)
    left = minimize_scalar(
        lambda b: (b * b * sensor * sensor + kick * kick) / (2.0 * b - b * b),
        bounds=(1e-3, 1.0),
        method="bounded",
    )
    assert gusty == pytest.approx(left.x / DT, rel=0.2)
    # What rests at its target in calm is best left alone.
    assert calm < 0.02


def test_disturbances_below_what_sensors_scatter_ask_for_no_other_gains():
    model, sds = integrator(), np.array([0.1])
    for kick, counts in ((0.001, False), (0.05, True)):
        gusts = gusts_of(model, Noise(sds, np.array([kick]), dt=DT))
        met = Committee([model], sds, True, gusts=gusts, foretells=True).disturbances(8, STEPS)
        assert (met is not None) == counts
