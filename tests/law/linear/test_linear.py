"""Laws and controllers around a point: beside differences of what the twin predicts, SciPy and python-control."""

import dataclasses
import math

import control
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import twinloop as tl
from law_twins import PENDULUM, SIGNALS, model_of
from strategies import programs
from twinloop.campaign.examination.loops import loops_around
from twinloop.errors import NotAvailable
from twinloop.law.expressions import Expressions
from twinloop.law.forms import DERIVATIVES, FORMS
from twinloop.law.law import Law
from twinloop.law.linear.controller import linear_controller
from twinloop.law.linear.jacobian import jacobian
from twinloop.law.linear.margins import LoopMargins, Loops, worst
from twinloop.law.linear.plant import linearised, trimmed


def twin(lines, form="acceleration", actuators=None, hidden=(), inputs=4, signals=SIGNALS):
    return tl.Twin(model_of(lines, form, signals, inputs, actuators, hidden), signals)


def differences(function, point, step=1e-6):
    columns = []
    for i in range(len(point)):
        nudge = np.zeros(len(point))
        nudge[i] = step
        columns.append((function(point + nudge) - function(point - nudge)) / (2.0 * step))
    return np.stack(columns, axis=-1)


@settings(deadline=None)
@given(programs(inputs=3, outputs=2), st.integers(0, 2**32 - 1))
def test_derivatives_are_those_of_differences(program, seed):
    point = np.random.default_rng(seed).uniform(-1.5, 1.5, 3)
    store = Expressions()
    roots = store.entered(program)
    values, slopes = jacobian(store, roots, point)
    with np.errstate(all="ignore"):
        coarse, fine = (differences(lambda x: program.run(x[np.newaxis])[0], point, h) for h in (1e-5, 1e-6))
        # Away from kinks, jumps and roots of 0 both differences agree.
        assume(np.abs(fine).max() < 1e3 and np.abs(fine - coarse).max() < 1e-6)
    np.testing.assert_allclose(values, program.run(point[np.newaxis])[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(slopes, fine, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("form", FORMS)
def test_over_a_period_it_moves_as_the_twin_predicts(form):
    lines = PENDULUM if form in DERIVATIVES else [*PENDULUM, "r5 = r0 * 0.9"]
    model = twin(lines, form)
    state, command = np.array([0.4, -0.3]), np.array([0.5, 2.0])
    found = model.linearise(state, command, discrete=True)
    np.testing.assert_allclose(found.A, differences(lambda x: model.predict(x, command), state), atol=1e-8)
    np.testing.assert_allclose(found.B, differences(lambda u: model.predict(state, u), command), atol=1e-8)
    np.testing.assert_allclose(found.drift, model.predict(state, command) - state, atol=1e-12)
    assert found.states == ("angle", "rate") and found.commands == ("torque", "fan") and found.dt == 0.05


@pytest.mark.parametrize("form", DERIVATIVES)
@pytest.mark.parametrize("usual", [1.0, 20.0])
def test_kinematics_are_among_the_equations(usual, form):
    body = tl.Signals(
        states=[tl.State(name, "rad", 1.0) for name in ("roll", "pitch", "yaw")]
        + [tl.State(name, "rad/s", usual) for name in ("p", "q", "r")],
        commands=[tl.Command("torque", "N m", (-2.0, 2.0))],
        dt=0.05,
        kinematics=tl.RigidBody(("roll", "pitch", "yaw"), ("p", "q", "r")),
    )
    assert body.substeps == (1 if usual == 1.0 else 4)
    model = twin(["r7 = r6 * 2.0", "r8 = r3 * r5", "r9 = sin(r0)"], form, inputs=7, signals=body)
    # Upright, all but vertical, turned over; slow and by a radian a period.
    for pitch in (0.4, -1.1, 1.5, 2.2):
        for fast in (1.0, 20.0):
            state = np.array([0.3, pitch, -0.2, 0.5 * fast, -0.7 * fast, 0.9 * fast])
            found = model.linearise(state, [0.3], discrete=True)
            expected = differences(lambda x: model.predict(x, [0.3]), state, 1e-6)
            np.testing.assert_allclose(found.A, expected, rtol=1e-5, atol=1e-6)
            np.testing.assert_allclose(state + found.drift, model.predict(state, [0.3]), atol=1e-12)


ACTUATED = {
    "actuators": [(0.08, 2, None, 0.0), (0.0, 1, 2.0, 0.0)],
    "hidden": [((0, 1), True, None, 0.7, (), False, 0.0, 0.0, 0.0)],
    "inputs": 5,
}
FILLED = ["r5 = r4 * 3.0", "r6 = r2 * 11.0", "r5 = r5 + r6", "r6 = r3 * r0", "r5 = r5 - r6"]


def test_lags_delays_and_hidden_states_are_states_of_a_period():
    model = twin(FILLED, **ACTUATED)
    state, command = np.array([6.875, 0.0]), np.array([0.5, 2.0])  # 11 · 0.5 / 2 = 6.875 · 2 / 5: at rest
    found = model.linearise(state, command, discrete=True)
    np.testing.assert_allclose(found.drift, 0.0, atol=1e-12)
    assert found.states[2:] == (
        "torque_effect",
        "hidden",
        "torque_2_before",
        "torque_1_before",
        "fan_1_before",
    )
    rng = np.random.default_rng(0)
    small = 1e-6 * rng.normal(size=(30, 2))
    small[0] = 0.0
    runs = [model.simulate_commands(state, command + sign * small).states for sign in (1.0, -1.0)]
    expected = (runs[0] - runs[1]) / 2.0
    departed, seen = np.zeros(len(found.A)), []
    for u in small:
        seen.append(departed[:2])
        departed = found.A @ departed + found.B @ u
    np.testing.assert_allclose([*seen, departed[:2]], expected, atol=1e-11)


def test_in_continuous_time_it_is_the_derivative_and_delays_stand_beside():
    model = twin(FILLED, **ACTUATED)
    found = model.linearise([0.2, -0.1], [0.5, 2.0])
    np.testing.assert_allclose(found.delays, [0.1, 0.05])
    assert found.states == ("angle", "rate", "torque_effect", "hidden") and found.dt is None
    expected = [
        [0.0, 1.0, 0.0, 0.0],
        [-2.0 / 5.0, 0.0, 11.0 / 2.0, 3.0],
        [0, 0, -1 / 0.08, 0],
        [0, 0, 0, -1 / 0.7],
    ]
    np.testing.assert_allclose(found.A, expected, atol=1e-12)
    np.testing.assert_allclose(found.B[1], [0.0, -0.2 / 5.0], atol=1e-12)
    np.testing.assert_allclose(found.B[3], [2 * 0.25 * 0.5 / 2, 2 * 0.4 * 0.2 / 2], atol=1e-12)
    free = twin(PENDULUM)
    continuous, discrete = (free.linearise([0.4, 0.0], [0.5, 2.0], discrete=d) for d in (False, True))
    both = scipy.linalg.expm(0.05 * np.block([[continuous.A, continuous.B], [np.zeros((2, 4))]]))
    np.testing.assert_allclose(discrete.A, both[:2, :2], atol=1e-4)
    np.testing.assert_allclose(discrete.B, both[:2, 2:], atol=1e-4)


def test_a_hidden_state_that_commands_fill_knows_them_before_their_delays():
    model = twin(FILLED, **{**ACTUATED, "actuators": [(0.3, 6, None, 0.0), (0.0, 4, 2.0, 0.0)]})
    slow, steps = (model.linearise([0.2, -0.1], [0.5, 2.0], discrete=each) for each in (False, True))
    assert [slow.states[place] for place in slow.at_once] == ["hidden"] and steps.at_once == ()
    frequencies = np.array([0.2, 0.5, 1.0, 2.0])
    expected = steps.response(frequencies)[:, :2]
    # Commands are held for a period, of which half is lost on average.
    held = np.exp(-0.5j * frequencies * steps.dt)[:, np.newaxis, np.newaxis]
    np.testing.assert_allclose(slow.response(frequencies)[:, :2] * held, expected, rtol=0.01, atol=1e-4)


def test_frequency_responses_are_those_of_python_control():
    found = twin(FILLED, **ACTUATED).linearise([0.2, -0.1], [0.5, 2.0], discrete=True)
    plant = control.ss(found.A, found.B, np.eye(len(found.A)), 0.0, found.dt)
    frequencies = np.geomspace(0.1, 60.0, 20)
    expected = control.frequency_response(plant, frequencies, squeeze=False).frdata
    np.testing.assert_allclose(found.response(frequencies), np.moveaxis(expected, 2, 0), rtol=1e-9)
    slow = twin(FILLED, **ACTUATED).linearise([0.2, -0.1], [0.5, 2.0])
    near = slow.response(frequencies[:5])[:, :2]
    np.testing.assert_allclose(near, found.response(frequencies[:5])[:, :2] * 1.0, rtol=0.2, atol=1e-3)


def test_it_is_a_system_of_python_control():
    found = twin(FILLED, **ACTUATED).linearise([6.875, 0.0], [0.5, 2.0], discrete=True)
    system = found.to_control()
    assert system.dt == 0.05 and system.state_labels == list(found.states)
    assert system.input_labels == ["torque", "fan"]
    model = twin(FILLED, **ACTUATED)
    small = 1e-6 * np.ones((30, 2)) * (np.arange(30)[:, np.newaxis] > 0)
    run = control.forced_response(system, 0.05 * np.arange(30), small.T)
    command = np.array([0.5, 2.0])
    pair = [model.simulate_commands([6.875, 0.0], command + s * small).states[:30] for s in (1.0, -1.0)]
    np.testing.assert_allclose(run.states[:2].T, (pair[0] - pair[1]) / 2.0, atol=1e-11)
    with pytest.raises(NotAvailable, match="discrete=True"):
        twin(FILLED, **ACTUATED).linearise([6.875, 0.0], [0.5, 2.0]).to_control()
    assert twin(PENDULUM).linearise([0.4, 0.0], [0.5, 2.0]).to_control().isctime()


def test_without_a_command_the_state_is_held():
    model = twin(PENDULUM)
    found = model.linearise([0.6, 0.0])
    np.testing.assert_allclose(found.drift, 0.0, atol=1e-9)
    law = Law.of(model.model, SIGNALS)
    far = trimmed(law, np.array([1.5, 0.0]), np.array([0.0, 0.0]))
    assert (far <= [2.0, 5.0]).all() and (far >= [-2.0, 0.0]).all()


@pytest.mark.parametrize("start", [(-2.0, 0.0), (2.0, 0.0), (-2.0, 5.0), (0.5, 2.0)])
@pytest.mark.parametrize("pull", [0.6, -0.4, 3.0])
def test_what_holds_a_state_is_found_beside_commands_at_their_bounds(start, pull):
    """Two commands that do nearly the same, with SciPy's bounded least squares as the oracle."""
    signals = tl.Signals([tl.State("a", "1", 1.0), tl.State("b", "1", 1.0)], SIGNALS.commands, SIGNALS.dt)
    lines = [f"r4 = r2 - {pull}", "r5 = r3 * 0.98", "r5 = r2 - r5", f"r5 = r5 - {pull}"]

    held = trimmed(Law.of(model_of(lines, signals=signals), signals), np.zeros(2), np.array(start))

    # The law has commands in units of their scales, 2 and 5.
    effects, bounds = np.array([[0.5, 0.0], [0.5, -0.196]]), ([-2.0, 0.0], [2.0, 5.0])
    best = scipy.optimize.lsq_linear(effects, [pull, pull], bounds, tol=1e-12).x
    np.testing.assert_allclose(effects @ held, effects @ best, atol=1e-5)
    assert (held >= bounds[0]).all() and (held <= bounds[1]).all()


def test_what_has_no_derivative_is_refused():
    with pytest.raises(NotAvailable, match="discrete=True"):
        twin(["r4 = r0 * 0.9"], "absolute").linearise([0.0, 0.0], [0.0, 0.0])
    with pytest.raises(NotAvailable, match="finite derivatives"):
        twin(["r4 = sqrt(r0)"]).linearise([0.0, 0.0], [0.0, 0.0])
    # Nor is a command looked for that holds a state there: Newton's steps would not be finite.
    with pytest.raises(NotAvailable, match="finite derivatives"):
        twin(["r4 = sqrt(r0)", "r4 = r4 * r2"]).linearise([0.0, 0.0])
    with pytest.raises(tl.InvalidInput):
        twin(PENDULUM).linearise([0.0, 0.0, 0.0])


# Controllers


def pid(rate, mixer=None, ki=(0.0, 5.0)):
    gains = {"angle.kp": (0.0, 5.0), "angle.ki": ki, "angle.kd": (0.0, 5.0)}
    output = tl.controllers.Mixer([[1.0], [0.0]]) if mixer is None else mixer
    return tl.controllers.PID(axes=[("angle", rate)], gains=gains, output=output).bind(SIGNALS)


@pytest.mark.parametrize("rate", ["rate", None])
def test_a_pid_is_realised_as_its_formula_says(rate):
    family, genes = pid(rate), np.array([1.5, 0.8, 0.3])
    found = linear_controller(family, genes, np.array([0.2, 0.0]))
    frequencies = np.geomspace(0.01, 60.0, 9)
    z = np.exp(1j * 0.05 * frequencies)
    angle = -(1.5 + 0.8 * 0.05 * z / (z - 1.0))
    angle = angle - 0.3 * (1.0 - 1.0 / z) / 0.05 if rate is None else angle
    response = found.response(frequencies)
    np.testing.assert_allclose(response[:, 0, 0], angle, rtol=1e-6)
    np.testing.assert_allclose(response[:, 0, 1], 0.0 if rate is None else -0.3, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(response[:, 1], 0.0, atol=1e-9)
    assert len(found.A) == (2 if rate is None else 1)


def test_a_controller_on_a_bound_is_refused():
    family = pid("rate", tl.controllers.Mixer([[1.0], [1.0]]))
    with pytest.raises(NotAvailable, match="slope where it rests"):
        linear_controller(family, np.array([1.0, 0.5, 0.2]), np.zeros(2))


# Margins


def loops(ki=0.5, kp=1.5, kd=0.3, actuators=((0.05, 1, None, 0.0), (0.0, 0, None, 0.0))):
    law = Law.of(twin(PENDULUM, actuators=list(actuators)).model, SIGNALS)
    target = np.array([0.4, 0.0])
    family = pid("rate")
    controller = linear_controller(family, np.array([kp, ki, kd]), target)
    plant = linearised(law, target, trimmed(law, target, controller.rest), discrete=True)
    return Loops(plant, controller, np.array([[1.0], [0.0]])), plant, controller


def test_margins_are_those_of_python_control():
    closed, plant, controller = loops()
    found = closed.margins(0, "angle")
    process = control.ss(plant.A, plant.B[:, :1], np.eye(len(plant.A))[:2], 0.0, 0.05)
    law = control.ss(controller.A, controller.B, controller.C[:1], controller.D[:1], 0.05)
    loop = -(law * process)
    sampled = control.frequency_response(loop, np.geomspace(1e-3, 62.8, 4000))
    gains, phases, nearest, _, crossovers, _ = control.stability_margins(sampled, returnall=True)
    assert found.stable
    assert found.gain == pytest.approx(min(g for g in gains if g > 1.0), rel=1e-5)
    assert found.phase == pytest.approx(math.radians(min(abs(p) for p in phases)), rel=1e-5)
    assert found.crossover == pytest.approx(max(crossovers), rel=1e-5)
    assert 1.0 / found.sensitivity == pytest.approx(min(nearest), rel=1e-3)
    delays = [math.radians(p % 360.0) / w for p, w in zip(phases, crossovers, strict=True)]
    assert found.delay == pytest.approx(min(delays), rel=1e-5)
    poles = np.sort_complex(control.feedback(loop, 1).poles())
    ours = closed.closed_poles()
    assert max(min(abs(pole - ours)) for pole in poles) < 1e-6


def test_at_its_gain_margin_the_loop_stands_on_the_edge():
    closed, _, _ = loops()
    factor = closed.margins(0, "angle").gain
    for share, stable in ((0.999, True), (1.001, False)):
        stronger, _, _ = loops(0.5 * factor * share, 1.5 * factor * share, 0.3 * factor * share)
        assert stronger.margins(0, "angle").stable is stable


@pytest.mark.parametrize("stiffness", [5.0, 12.0, 30.0])
def test_an_oscillation_without_damping_is_no_edge(stiffness):
    # Semi-implicit, it has its poles on the very circle of frequencies.
    model = twin([f"r4 = r0 * -{stiffness}", "r5 = r2 * 2.0", "r4 = r4 + r5"], "semi-implicit-euler")
    plant = linearised(model.law, np.zeros(2), np.zeros(2), True)
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(plant.A)), 1.0, rtol=1e-12)

    def closed(factor):
        law = linear_controller(pid("rate"), factor * np.array([2.0, 0.2, 1.0]), np.zeros(2))
        return Loops(plant, law, np.array([[1.0], [0.0]])).margins(0, "angle")

    gain = closed(1.0).gain
    assert 1.0 < gain < 1000.0 and closed(1.0).stable
    assert closed(0.999 * gain).stable and not closed(1.001 * gain).stable


def test_at_its_delay_margin_too():
    delay = loops(actuators=((0.05, 0, None, 0.0), (0.0, 0, None, 0.0)))[0].margins(0, "angle").delay
    periods = delay / 0.05
    below, above = math.floor(periods), math.ceil(periods)
    for steps, stable in ((below, True), (above, False)):
        assert (
            loops(actuators=((0.05, steps, None, 0.0), (0.0, 0, None, 0.0)))[0].margins(0, "angle").stable
            is stable
        )


def test_the_margins_of_a_campaign_are_those_of_its_twin_and_the_worst_of_its_committee():
    system = tl.systems.Quadrotor(noise=1e-3)
    campaign = tl.Campaign(
        system.signals, controller=system.controller, initial_state=system.initial_state,
        target_state=system.target_state, duration=system.duration,
        options={"generations": 0, "moves": 2000, "starts": 2, "committee_size": 3},
    )  # fmt: skip
    campaign.run(system, experiments=1)
    found = campaign.margins(system.default_gains)
    assert [row.loop for row in found.nominal] == ["roll", "pitch", "yaw"] and found.broken_at == "axes"
    assert found.members == len(campaign.twin.members)
    for nominal, least in zip(found.nominal, found.worst, strict=True):
        assert nominal.stable and 1.0 < least.gain <= nominal.gain and 0.0 < least.phase <= nominal.phase
        assert least.sensitivity >= nominal.sensitivity > 1.0
    # Axes of a vehicle at its target hardly touch each other: each loop alone has the margins of all closed.
    text = str(found)
    assert "roll" in text and "worst" in text
    assert len(campaign.margins(system.default_gains, broken_at="commands").nominal) == 4
    with pytest.raises(tl.InvalidInput, match="axes"):
        campaign.margins(broken_at="wires")


def heated(power):
    """A heater of 20 kW at most that cools by 1 % of its temperature a second, under a PI: the loops at 40 degC."""
    signals = tl.Signals([tl.State("temp", "degC", 50.0)], [tl.Command("heater", "kW", (0.0, 20.0))], dt=5.0)
    pi = tl.controllers.PID([("temp", None)], {"temp.kp": (0.0, 5.0), "temp.ki": (0.0, 0.1), "temp.kd": 0.0})
    campaign = tl.Campaign(signals, controller=pi, initial_state=[20.0], target_state=[40.0], duration=600.0)
    model = twin(["r2 = r0 * -0.01", f"r3 = r1 * {power}", "r2 = r2 + r3"], inputs=2, signals=signals)
    return loops_around(model, campaign.setup, np.array([2.0, 0.02]), "axes")[0][0]


def test_a_heater_that_rests_on_its_bound_has_the_margins_of_where_it_holds_its_target():
    found = heated(0.5).margins(0, "temp")

    def loop(w):
        z, a = np.exp(5j * w), math.exp(-0.05)
        return (2.0 + 0.02 * 5.0 * z / (z - 1.0)) * 0.025 * (1.0 - a) / 0.01 / (z - a)

    crossover = scipy.optimize.brentq(lambda w: abs(loop(w)) - 1.0, 1e-3, 0.3)
    assert found.stable and found.crossover == pytest.approx(crossover, rel=1e-4)
    assert found.phase == pytest.approx(math.pi + np.angle(loop(crossover)), rel=1e-4)


def test_a_heater_that_is_too_weak_for_its_target_has_no_margins_there():
    with pytest.raises(NotAvailable, match="heater at a bound"):
        heated(0.3)


def test_the_worst_of_each_margin_is_the_one_nearest_to_the_edge():
    """Gains may rise up to `gain` and fall to `gain_down`, both nearest to 1 at worst."""
    calm = LoopMargins("roll", True, 4.0, 0.2, 1.0, 0.3, 5.0, 1.3, 1.1, friction="sliding")
    edgy = LoopMargins("roll", True, 1.5, 0.7, 0.4, 0.1, 9.0, 3.0, 2.5, friction="sticking")
    assert worst([calm, edgy]) == worst([edgy, calm]) == edgy
    mixed = dataclasses.replace(calm, gain_down=0.9, complementary=3.5)
    both = dataclasses.replace(edgy, gain_down=0.9, complementary=3.5)
    assert worst([edgy, mixed]) == worst([mixed, edgy]) == both
    lost = dataclasses.replace(calm, stable=False)
    assert not worst([calm, lost]).stable and worst([edgy, lost]).friction == "sliding"
