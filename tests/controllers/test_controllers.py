"""Controllers: the law of the PID, the mixer, the names and bounds of the gains."""

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import Pid, same_bits
from twinloop._experiment.hold_back import HoldBack
from twinloop.controllers.gains import gain_units
from twinloop.systems.quadrotor import gains_from_backstepping, gains_from_frequency

ROTORS = [(0.0, 300.0)] * 4


def three_axes(rates=True):
    return [(i, 3 + i if rates else None) for i in range(3)]


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_a_controller_is_the_plain_pid(quadrotor_family, seed, rates):
    system = tl.systems.Quadrotor()
    own = system.controller
    axes = [(name, f"{name}_rate" if rates else None) for name in ("roll", "pitch", "yaw")]
    family = tl.controllers.PID(axes=axes, gains=own.gains, output=own.output).bind(system.signals)
    stream = np.random.default_rng(seed)
    genes = np.tile([0.3, 0.1, 0.1], 3) * stream.random(9)
    controller = family.controller(genes)
    target = stream.uniform(-1.0, 1.0, 6)
    plain = Pid(
        three_axes(rates), genes, 0.02, own.output.matrix, own.output.offset, own.output.power, ROTORS
    )
    for _ in range(30):
        state = stream.normal(0.0, 0.5, 6)
        np.testing.assert_allclose(
            controller.command(state, target), plain.command(state, target), rtol=1e-13, atol=1e-13
        )


def test_the_integral_is_updated_before_it_is_used(pendulum_signals, pendulum_controller):
    family = pendulum_controller.bind(pendulum_signals)
    controller = family.controller([0.0, 6.0, 0.0])
    found = [controller.command([0.0, 0.0], [1.0, 0.0])[0] for _ in range(3)]
    np.testing.assert_allclose(found, [0.3, 0.6, 0.9], rtol=1e-14)


def test_the_derivative_is_of_the_measurement_and_not_of_the_error(pendulum_signals, pendulum_controller):
    family = pendulum_controller.bind(pendulum_signals)
    for target in (0.0, 100.0):
        assert family.controller([0.0, 0.0, 1.0]).command([0.0, 0.5], [target, 7.0])[0] == -0.5


def test_without_a_rate_the_first_command_has_no_derivative(pendulum_signals):
    gains = {"angle.kp": (0.0, 1.0), "angle.ki": (0.0, 1.0), "angle.kd": (0.0, 1.0)}
    family = tl.controllers.PID(axes=[("angle", None)], gains=gains).bind(pendulum_signals)
    controller = family.controller([0.0, 0.0, 0.1])
    assert controller.command([0.7, 3.0], [0.0, 0.0])[0] == 0.0
    assert controller.command([0.8, 3.0], [0.0, 0.0])[0] == pytest.approx(-0.1 * 0.1 / 0.05)
    controller.reset()
    assert controller.command([0.5, 3.0], [0.0, 0.0])[0] == 0.0


def test_reset_forgets_the_run_before(quadrotor, quadrotor_family):
    controller = quadrotor_family.controller(quadrotor_family.genes(quadrotor.default_gains))
    readings = np.random.default_rng(0).normal(size=(10, 6))
    first = [controller.command(reading, quadrotor.target_state) for reading in readings]
    on = [controller.command(reading, quadrotor.target_state) for reading in readings]
    controller.reset()
    again = [controller.command(reading, quadrotor.target_state) for reading in readings]
    assert same_bits(first, again)
    assert not same_bits(first, on)


def test_an_excitation_is_added_row_after_row_and_starts_again_with_the_run(
    pendulum_signals, pendulum_controller
):
    family = pendulum_controller.bind(pendulum_signals)
    plain, excited = (
        family.controller([1.0, 0.0, 0.0]),
        family.controller([1.0, 0.0, 0.0], [[0.5], [-9.0], [0.25]]),
    )
    state, target = [0.25, 0.0], [0.5, 0.0]
    assert plain.command(state, target).tolist() == [0.25]
    for _ in range(2):
        excited.reset()
        found = [excited.command(state, target)[0] for _ in range(5)]
        assert found == [0.75, -2.0, 0.5, 0.25, 0.25]


def test_a_refused_reading_does_not_use_up_a_row_of_the_excitation(pendulum_signals, pendulum_controller):
    controller = pendulum_controller.bind(pendulum_signals).controller([1.0, 0.0, 0.0], [[0.5]])
    with pytest.raises(tl.InvalidInput):
        controller.command([np.nan, 0.0], [0.5, 0.0])
    assert controller.command([0.25, 0.0], [0.5, 0.0]).tolist() == [0.75]


@pytest.mark.parametrize("excitation", [[0.5], [[0.5, 0.5]], [[np.nan]], "none"])
def test_an_excitation_of_another_shape_is_refused(pendulum_signals, pendulum_controller, excitation):
    with pytest.raises(tl.InvalidInput, match="Excitation"):
        pendulum_controller.bind(pendulum_signals).controller([1.0, 0.0, 0.0], excitation)


def test_a_command_stays_in_its_bounds_and_saturates_at_them(pendulum_signals, pendulum_controller):
    controller = pendulum_controller.bind(pendulum_signals).controller([6.0, 0.0, 0.0])
    assert controller.command([0.0, 0.0], [10.0, 0.0])[0] == 2.0
    assert controller.command([0.0, 0.0], [-10.0, 0.0])[0] == -2.0


@given(st.lists(st.floats(-0.02, 0.02), min_size=3, max_size=3))
def test_the_conversion_chart_is_the_inverse_of_the_mixing_at_hover_thrust(torques):
    arm, thrust, drag = 0.23, 3.13e-5, 7.5e-7
    output = tl.systems.Quadrotor().controller.output
    squared = output.matrix @ torques + output.offset
    w1, w2, w3, w4 = squared
    back = [arm * thrust * (w4 - w2), arm * thrust * (w1 - w3), drag * (-w1 + w2 - w3 + w4)]
    np.testing.assert_allclose(back, torques, rtol=1e-9, atol=1e-14)
    assert thrust * squared.sum() == pytest.approx(0.650 * 9.81, rel=1e-12)


def test_the_chart_is_clamped_to_what_a_rotor_can_do(quadrotor_family, quadrotor):
    controller = quadrotor_family.controller(np.tile([0.3, 0.0, 0.0], 3))
    speeds = controller.command(np.zeros(6), [0.0, 0.0, 3.0, 0.0, 0.0, 0.0])
    assert speeds.tolist() == [0.0, 300.0, 0.0, 300.0]
    level = controller.command(np.zeros(6), np.zeros(6))
    np.testing.assert_allclose(level, [225.68] * 4, atol=0.005)


@given(st.floats(-3.0, 3.0), st.sampled_from([0.5, 1.0, 2.0, 0.3]))
def test_a_power_keeps_the_sign(v, power):
    signals = tl.Signals([tl.State("x", "m", 1.0)], [tl.Command("u", "V", (-5.0, 5.0))], 0.1)
    gains = {"x.kp": (0.0, 1.0), "x.ki": (0.0, 1.0), "x.kd": (0.0, 1.0)}
    output = tl.controllers.Mixer([[1.0]], power=power)
    family = tl.controllers.PID(axes=[("x", None)], gains=gains, output=output).bind(signals)
    found = family.controller([1.0, 0.0, 0.0]).command([0.0], [v])[0]
    assert found == pytest.approx(np.clip(np.sign(v) * abs(v) ** power, -5.0, 5.0), rel=1e-12, abs=1e-300)


def test_gains_have_names_units_and_bounds_in_the_order_of_the_genes(quadrotor_family):
    axes = ("roll", "pitch", "yaw")
    assert quadrotor_family.names == tuple(f"{a}.{t}" for a in axes for t in ("kp", "ki", "kd"))
    units = [gain.unit for gain in quadrotor_family.gains[:3]]
    assert units == ["N m/rad", "N m/(rad s)", "N m s/rad"]
    assert [(g.low, g.high) for g in quadrotor_family.gains[:3]] == [(0.0, 0.3), (0.0, 0.1), (0.0, 0.1)]


def test_gains_by_name_and_in_order_are_the_same_genes(quadrotor_family, quadrotor):
    by_name = quadrotor_family.genes(quadrotor.default_gains)
    assert same_bits(by_name, quadrotor_family.genes(by_name))
    assert quadrotor_family.parameters(by_name) == quadrotor.default_gains
    shuffled = dict(reversed(quadrotor.default_gains.items()))
    assert same_bits(quadrotor_family.genes(shuffled), by_name)


def test_the_first_controller_is_the_specifications(quadrotor_family, quadrotor):
    expected = [0.03, 0.004, 0.024, 0.03, 0.004, 0.024, 0.052, 0.004, 0.0416]
    np.testing.assert_allclose(quadrotor_family.genes(quadrotor.default_gains), expected, rtol=1e-12)


def test_gains_follow_from_frequency_and_damping():
    gains = gains_from_frequency((2.0, 3.0, 4.0), 5.0, 0.5, 0.1)
    assert gains["pitch.kp"] == 75.0 and gains["yaw.kd"] == 20.0 and gains["roll.ki"] == 0.1


def test_gains_follow_from_integral_backstepping():
    gains = gains_from_backstepping((2.0, 3.0, 4.0), c1=5.0, c2=7.0, lambda_=0.5)
    assert gains["roll.kp"] == pytest.approx(2.0 * (1.0 + 0.5 + 35.0))
    assert gains["pitch.ki"] == pytest.approx(3.0 * 7.0 * 0.5)
    assert gains["yaw.kd"] == pytest.approx(4.0 * 12.0)


def test_a_reading_that_is_not_finite_is_refused_and_changes_nothing(quadrotor_family, quadrotor):
    genes = quadrotor_family.genes(quadrotor.default_gains)
    spoilt, clean = quadrotor_family.controller(genes), quadrotor_family.controller(genes)
    target = quadrotor.target_state
    with pytest.raises(tl.InvalidInput, match="expected finite numbers"):
        spoilt.command([0.0, np.nan, 0.0, 0.0, 0.0, 0.0], target)
    assert same_bits(spoilt.command(np.zeros(6), target), clean.command(np.zeros(6), target))


def test_commands_of_a_whole_run_are_those_that_a_loop_gets(pendulum_signals, pendulum_controller):
    family = pendulum_controller.bind(pendulum_signals)
    draw = np.random.default_rng(4)
    states, targets = draw.normal(size=(2, 30, 2))
    excitation = 0.1 * draw.normal(size=(20, 1))
    one, other = (family.controller([2.0, 2.0, 0.3], excitation) for _ in range(2))
    other.command(states[3], targets[3])  # what was before is forgotten
    expected = np.array([one.command(*row) for row in zip(states, targets, strict=True)])
    assert other.commands(states, targets).tobytes() == expected.tobytes()
    for wrong in (states[:, :1], states[:-1], np.where(states > 1.0, np.nan, states)):
        with pytest.raises(tl.InvalidInput, match=r"Controller\.commands"):
            one.commands(wrong, targets)


class Counting:
    """A law in Python whose commands depend on all that it has heard."""

    def __init__(self, kp):
        self.kp = kp

    def reset(self):
        self.heard = 0.0

    def command(self, state, target):
        self.heard = 0.9 * self.heard + float(target[0] - state[0])
        return [self.kp * self.heard]


EXCITED = np.random.default_rng(3).normal(0.0, 0.2, (25, 1))
HELD = HoldBack([[-0.5, 0.5], [-np.inf, np.inf]], [[-1.0, 1.0], [-np.inf, np.inf]])
REMEMBERING = {
    "a PID that winds up": tl.controllers.PID(
        [("angle", None)],
        {"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)},
        derivative_filter=0.1,
    ),
    "a cascade": tl.controllers.Cascade(
        [("angle", "rate")],
        {"angle.kp": (0.0, 6.0), "rate.kp": (0.0, 6.0), "rate.ki": (0.0, 6.0), "rate.kd": (0.0, 1.0)},
        anti_windup="clamping",
    ),
    "a state feedback with an integral": tl.controllers.StateFeedback(None, (0.0, 2.0), integral=["angle"]),
    "a law in Python": tl.controllers.Custom(Counting, {"kp": (0.0, 2.0)}),
}


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
@pytest.mark.parametrize("law", REMEMBERING)
def test_a_copy_goes_on_in_the_midst_of_a_run_and_shares_no_memory(pendulum_signals, law, copied):
    family = REMEMBERING[law].bind(pendulum_signals)
    stream = np.random.default_rng(5)
    rows = stream.uniform(-0.8, 0.8, (40, 2, 2))

    def begun():
        controller = family.controller(0.7 * np.array([g.high for g in family.gains]), EXCITED, HELD)
        controller.commands(rows[:7, 0], rows[:7, 1])
        for state, target in rows[7:15]:
            controller.command(state, target)
        return controller

    def rest(controller):
        return [controller.command(*row) for row in rows[15:]]

    expected, original = rest(begun()), begun()
    other = copied(original)
    assert same_bits(rest(other), expected)  # the copy first, so that what it does would show in the original
    assert same_bits(rest(original), expected)
    other.reset()
    afresh = family.controller(original.genes, EXCITED, HELD)
    assert same_bits(copied(other).command(*rows[0]), afresh.command(*rows[0]))


@pytest.mark.parametrize(
    ("output", "state", "units"),
    [("1", "rad", ("1/rad", "1/(rad s)", "s/rad")), ("", "1", ("1", "1/s", "s")), ("kW", "", ("kW", "kW/s", "kW s"))],
)  # fmt: skip
def test_what_has_no_unit_is_not_in_the_units_of_gains(output, state, units):
    assert gain_units(output, state) == units
