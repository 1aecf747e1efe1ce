"""Options of the laws against plain NumPy: fixed gains, anti-windup, a filter of the rates, a loop inside a loop.

Each law gives the same bits in a roll-out of many lanes and as the single controller of a real run.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import Pid, same_bits
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop.contracts import check_controller
from twinloop.controllers import PID, Cascade, Mixer, StateFeedback
from twinloop.faces.result import summary
from twinloop.faces.text import render

ANGLES = ("roll", "pitch", "yaw")
SYSTEM = tl.systems.Quadrotor()
OUTPUT = SYSTEM.controller.output
ROTORS = [(0.0, 300.0)] * 4
PID_GAINS = SYSTEM.controller.gains
CASCADE_GAINS = {f"{angle}.kp": (0.0, 20.0) for angle in ANGLES} | {
    f"{angle}_rate.{term}": (0.0, high)
    for angle in ANGLES
    for term, high in (("kp", 0.2), ("ki", 0.4), ("kd", 0.004))
}


def pid(rates=True, **options):
    axes = [(name, f"{name}_rate" if rates else None) for name in ANGLES]
    return PID(axes=axes, gains=PID_GAINS, output=OUTPUT, **options)


def cascade(**options):
    return Cascade(
        axes=[(name, f"{name}_rate") for name in ANGLES], gains=CASCADE_GAINS, output=OUTPUT, **options
    )


def one_axis(gains, **options):
    """A PID on an angle in V and rad, whose command saturates at ±1 V."""
    signals = tl.Signals([tl.State("angle", "rad", 1.0)], [tl.Command("u", "V", (-1.0, 1.0))], 0.1)
    bounds = {f"angle.{term}": value for term, value in zip(("kp", "ki", "kd"), gains, strict=True)}
    return PID(axes=[("angle", None)], gains=bounds, **options).bind(signals)


def plain(family_axes, genes, **options):
    return Pid(family_axes, genes, 0.02, OUTPUT.matrix, OUTPUT.offset, OUTPUT.power, ROTORS, **options)


def commands_alike(controller, oracle, stream, size):
    target = stream.uniform(-1.0, 1.0, 6)
    for _ in range(40):
        state = stream.normal(0.0, size, 6)
        np.testing.assert_allclose(
            controller.command(state, target), oracle.command(state, target), rtol=1e-11, atol=1e-9
        )


seeds = st.integers(0, 2**32 - 1)
times = st.sampled_from([0.0, 0.01, 0.3])
sizes = st.sampled_from([0.1, 2.0])


@given(seeds, st.booleans(), times, st.sampled_from([None, "clamping"]), sizes)
def test_a_pid_with_its_options_is_the_plain_one(seed, rates, time, way, size):
    family = pid(rates, derivative_filter=time, anti_windup=way).bind(SYSTEM.signals)
    stream = np.random.default_rng(seed)
    genes = np.tile([0.3, 0.1, 0.1], 3) * stream.random(9)
    axes = [(i, 3 + i if rates else None) for i in range(3)]
    oracle = plain(axes, genes, derivative_filter=time, anti_windup=way is not None)
    commands_alike(family.controller(genes), oracle, stream, size)


@given(seeds, st.sampled_from([None, 1.5]), st.sampled_from([None, "clamping"]), sizes)
def test_a_cascade_is_a_loop_around_a_plain_pid(seed, limit, way, size):
    limits = None if limit is None else {"roll_rate": limit, "yaw_rate": 2 * limit}
    description = cascade(rate_limits=limits, derivative_filter=0.01, anti_windup=way)
    family = description.bind(SYSTEM.signals)
    stream = np.random.default_rng(seed)
    genes = np.array([gain.high for gain in family.gains]) * stream.random(12)
    bounds = [np.inf] * 3 if limit is None else [limit, np.inf, 2 * limit]
    axes = [(3 + i, None, i, bounds[i]) for i in range(3)]
    oracle = plain(axes, genes, derivative_filter=0.01, anti_windup=way is not None)
    commands_alike(family.controller(genes), oracle, stream, size)


FAMILIES = {
    "a PID": pid(),
    "a PID that clamps and filters": pid(rates=False, anti_windup="clamping", derivative_filter=0.05),
    "a PID with gains that are fixed": PID(
        axes=pid().axes, gains={**PID_GAINS, "roll.ki": 0.0, "yaw.kp": 0.05}, output=OUTPUT
    ),
    "a cascade": cascade(rate_limits={"roll_rate": 2.0}, anti_windup="clamping", derivative_filter=0.01),
    "a state feedback": StateFeedback(None, (-0.1, 0.3), OUTPUT, ["yaw"]),
}


@pytest.mark.parametrize("name", FAMILIES)
def test_a_law_keeps_to_the_contract(name):
    check_controller(FAMILIES[name], SYSTEM.signals)


@pytest.mark.parametrize("name", FAMILIES)
def test_a_real_run_has_the_bits_of_a_roll_out_of_many_lanes(name):
    family = FAMILIES[name].bind(SYSTEM.signals)
    low, high = (np.array([getattr(gain, end) for gain in family.gains]) for end in ("low", "high"))
    genes = low + (high - low) * np.random.default_rng(0).random((70, family.size))
    target = 3.0 * np.asarray(SYSTEM.target_state)
    task = _core.Task(np.zeros(6), target, 40)
    plant = SYSTEM.dynamics
    for width in _core.vector_widths():
        workers = _core.Workers(1, width)
        runs = _core.rollout(
            plant, Limits(SYSTEM.signals, 1e6).setting(family.engine), genes, task, workers=workers
        )
        for row in (0, 33, 69):
            controller, state = family.controller(genes[row]), np.zeros(6)
            for k in range(40):
                command = controller.command(state, target)
                assert same_bits(command, runs.commands[row, k])
                state = plant.step(state[np.newaxis], command[np.newaxis])[0]
                assert same_bits(state, runs.states[row, k + 1])


def test_a_fixed_gain_is_no_gene_and_is_shown_with_the_others():
    gains = {**PID_GAINS, "roll.ki": 0.0, "pitch.ki": 0, "yaw.kd": 0.04}
    family = PID(axes=pid().axes, gains=gains, output=OUTPUT).bind(SYSTEM.signals)
    full = pid().bind(SYSTEM.signals)
    assert family.size == len(family.names) == 6 and "roll.ki" not in family.names
    assert family.fixed == {"roll.ki": 0.0, "pitch.ki": 0.0, "yaw.kd": 0.04}
    parameters = family.parameters([0.1, 0.02, 0.1, 0.02, 0.1, 0.01])
    assert list(parameters) == list(full.names)
    assert parameters["roll.ki"] == 0.0 and parameters["yaw.kd"] == 0.04 and parameters["yaw.ki"] == 0.01
    one = family.controller(family.genes(parameters))
    other = full.controller(full.genes(parameters))
    assert one.parameters == other.parameters
    for state in np.random.default_rng(1).normal(size=(20, 6)):
        assert same_bits(one.command(state, np.zeros(6)), other.command(state, np.zeros(6)))


def test_a_state_feedback_has_fixed_gains_too(pendulum_signals):
    family = StateFeedback(None, {"angle": (0.0, 6.0), "rate": 0.5}).bind(pendulum_signals)
    assert family.names == ("angle->torque",)
    assert family.parameters([2.0]) == {"angle->torque": 2.0, "rate->torque": 0.5}
    assert family.controller([2.0]).command([0.1, -1.0], [0.3, 0.0])[0] == pytest.approx(2.0 * 0.2 + 0.5)


def test_the_regulator_leaves_a_fixed_gain_as_it_is(pendulum_signals):
    family = StateFeedback(None, {"angle": (0.0, 6.0), "rate": 0.5}).bind(pendulum_signals)
    gains = tl.controllers.lqr_gains(
        lambda x, u: [x[0] + 0.05 * x[1], x[1] + 0.05 * (u[0] - x[0])], family, [0.0, 0.0]
    )
    assert gains["rate->torque"] == 0.5 and 0.0 < gains["angle->torque"] <= 6.0
    assert family.genes(gains).shape == (1,)


def test_a_campaign_searches_the_free_gains_alone(pendulum, new_campaign):
    gains = {"angle.kp": (0.0, 6.0), "angle.ki": 0.0, "angle.kd": (0.0, 1.0)}
    campaign = new_campaign(controller=PID(axes=[("angle", "rate")], gains=gains))
    first = campaign.test({"angle.kp": 2.0, "angle.kd": 0.3})
    campaign.tell(first, pendulum.run(first))
    test = campaign.ask()
    assert test.genes.shape == (2,) and test.parameters["angle.ki"] == 0.0
    campaign.tell(test, pendulum.run(test))
    result = summary(campaign, {"name": "pendulum"}, {})
    rows = {row["name"]: row for row in result["controller"]["gains"]}
    assert rows["angle.ki"]["value"] == 0.0 and rows["angle.ki"]["low"] is None
    assert "1 gain fixed at 0 left out." in render(result)


def test_a_fixed_gain_cannot_be_given_another_value():
    family = one_axis([(0.0, 1.0), 0.25, 0.0])
    assert family.genes({"angle.kp": 0.5, "angle.ki": 0.25}).tolist() == [0.5]
    with pytest.raises(tl.InvalidInput, match=r"'angle.ki': expected 0.25, which it is fixed at, found 0.3"):
        family.genes({"angle.kp": 0.5, "angle.ki": 0.3})


def test_a_family_without_a_free_gain_is_refused():
    with pytest.raises(tl.InvalidInput, match="at least one gain with bounds"):
        one_axis([1.0, 0.0, 0.0])


def integral_after(family, genes, errors):
    """The integral part of a controller with K_I = 1, read off at no error."""
    controller = family.controller(genes)
    for error in errors:
        controller.command([-error], [0.0])
    return controller.command([0.0], [0.0])[0]


def test_without_anti_windup_an_integral_winds_up_behind_the_bound():
    assert integral_after(one_axis([(0.0, 9.0), 1.0, 0.0]), [0.0], [5.0] * 10) == 1.0
    controller = one_axis([(0.0, 9.0), 1.0, 0.0]).controller([0.0])
    found = [controller.command([-error], [0.0])[0] for error in [5.0] * 10 + [-5.0] * 8]
    assert found[10:] == [1.0] * 8  # eight periods the other way, and still at the bound


def test_clamping_stops_an_integral_at_the_bound_and_lets_it_come_back_at_once():
    controller = one_axis([(0.0, 9.0), 1.0, 0.0], anti_windup="clamping").controller([0.0])
    found = [controller.command([-error], [0.0])[0] for error in [5.0] * 10 + [-5.0] * 3]
    # The integral reaches 0.5; a further step would be 1.0, the bound, and is taken back each time.
    np.testing.assert_allclose(found, [0.5] + [1.0] * 9 + [0.0, -0.5, -1.0], atol=1e-12)


def test_clamping_changes_nothing_where_no_command_is_at_a_bound():
    genes = np.tile([0.02, 0.01, 0.01], 3)
    clamped, free = (
        pid(anti_windup=way).bind(SYSTEM.signals).controller(genes) for way in ("clamping", None)
    )
    for state in np.random.default_rng(2).normal(0.0, 0.05, (50, 6)):
        assert same_bits(clamped.command(state, np.zeros(6)), free.command(state, np.zeros(6)))


def test_an_axis_that_does_not_move_a_saturated_command_integrates_on():
    signals = tl.Signals(
        [tl.State("x", "m", 1.0), tl.State("y", "m", 1.0)],
        [tl.Command("u", "V", (-1.0, 1.0)), tl.Command("w", "V", (-100.0, 100.0))],
        0.1,
    )
    gains = {f"{name}.{term}": 0.0 for name in "xy" for term in ("kp", "ki", "kd")}
    gains |= {"x.ki": (0.0, 9.0), "y.ki": 1.0}
    family = PID(
        axes=[("x", None), ("y", None)],
        gains=gains,
        output=Mixer([[1.0, 0.0], [0.0, 1.0]]),
        anti_windup="clamping",
    ).bind(signals)
    controller = family.controller([1.0])
    found = [controller.command([-30.0, -30.0], [0.0, 0.0]) for _ in range(3)]
    np.testing.assert_allclose(found, [[1.0, 3.0], [1.0, 6.0], [1.0, 9.0]])


def test_the_filter_passes_a_steady_rate_and_takes_the_edge_off_a_jump(pendulum_signals):
    gains = {"angle.kp": 0.0, "angle.ki": 0.0, "angle.kd": (0.0, 1.0)}
    family = PID(axes=[("angle", "rate")], gains=gains, derivative_filter=0.15).bind(pendulum_signals)
    controller = family.controller([1.0])
    found = [controller.command([0.0, rate], [0.0, 0.0])[0] for rate in (0.5, 0.5, 1.5, 1.5)]
    # dt / (dt + T) = 0.05 / 0.2: a quarter of the way each period.
    np.testing.assert_allclose(found, [-0.5, -0.5, -0.75, -0.9375])


def test_a_cascade_asks_for_no_more_than_its_limit_and_follows_the_targets_rate(pendulum_signals):
    gains = {"angle.kp": 8.0, "rate.kp": (0.0, 1.0), "rate.ki": 0.0, "rate.kd": 0.0}
    family = Cascade(axes=[("angle", "rate")], gains=gains, rate_limits={"rate": 2.0}).bind(pendulum_signals)
    controller = family.controller([0.5])
    for state, target, expected in (
        ([0.0, 0.0], [0.1, 0.0], 0.5 * 0.8),
        ([0.0, 0.3], [0.1, 0.0], 0.5 * (0.8 - 0.3)),
        ([0.0, 0.0], [0.1, 0.4], 0.5 * 1.2),
        ([0.0, 0.0], [9.0, 0.0], 0.5 * 2.0),
        ([0.0, 0.0], [-9.0, 0.0], -0.5 * 2.0),
    ):
        assert controller.command(state, target)[0] == pytest.approx(expected)
    assert [(gain.name, gain.unit) for gain in family.law_gains] == [
        ("angle.kp", "(rad/s)/rad"),
        ("rate.kp", "N m/(rad/s)"),
        ("rate.ki", "N m/((rad/s) s)"),
        ("rate.kd", "N m s/(rad/s)"),
    ]


def test_a_campaign_tunes_a_cascade(pendulum, new_campaign):
    gains = {"angle.kp": (0.5, 20.0, "log"), "rate.kp": (0.0, 1.0), "rate.ki": (0.0, 2.0), "rate.kd": 0.0}
    campaign = new_campaign(controller=Cascade(axes=[("angle", "rate")], gains=gains))
    first = campaign.test({"angle.kp": 4.0, "rate.kp": 0.3, "rate.ki": 0.5})
    campaign.tell(first, pendulum.run(first))
    assert list(campaign.ask().parameters) == ["angle.kp", "rate.kp", "rate.ki", "rate.kd"]


AXIS = {"axes": [("angle", "rate")]}
INNER = {"rate.kp": (0, 1), "rate.ki": 0, "rate.kd": 0}
OUTER = {"angle.kp": (0, 1), **INNER}
PLAIN = {"angle.kp": (0, 1), "angle.ki": 0, "angle.kd": 0}
REFUSED = {
    "another anti-windup": (lambda: PID(**AXIS, gains=PLAIN, anti_windup="back"), '"clamping" or None'),
    "a filter that looks ahead": (lambda: PID(**AXIS, gains=PLAIN, derivative_filter=-1), "at least 0 s"),
    "a filter in words": (lambda: PID(**AXIS, gains=PLAIN, derivative_filter="10 Hz"), "derivative_filter"),
    "a gain fixed at NaN": (lambda: PID(**AXIS, gains={**PLAIN, "angle.ki": np.nan}), "angle.ki"),
    "a cascade without rates": (lambda: Cascade(axes=[("angle", None)], gains=OUTER), "pairs"),
    "a cascade without its outer gain": (lambda: Cascade(**AXIS, gains=INNER), "none for angle.kp"),
    "a limit of another rate": (lambda: Cascade(**AXIS, gains=OUTER, rate_limits={"angle": 1}), "rate to limit"),
    "a limit of 0": (lambda: Cascade(**AXIS, gains=OUTER, rate_limits={"rate": 0}), "rate limit of 'rate'"),
    "one limit for all": (lambda: Cascade(**AXIS, gains=OUTER, rate_limits=3.0), "a dict of limits"),
    "a rate of two angles": (
        lambda: Cascade(axes=[("angle", "rate"), ("other", "rate")], gains=OUTER),
        "a rate of its own",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_law_is_refused(case):
    make, sentence = REFUSED[case]
    with pytest.raises(tl.InvalidInput, match=sentence):
        make()
