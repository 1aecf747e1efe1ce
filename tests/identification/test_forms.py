"""Whether a law is one of derivatives or of steps is found out from readings, and said."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import twinloop as tl
from late_sensors import BODY, PENDULUM, read, swinging, turning
from late_sensors import DT as LATE_DT
from oracles import solved
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.forms import _described, brief_look, candidates
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.sensors.euler_steps import euler_form
from twinloop.law.forms import FORMS

WORKERS = _core.Workers(1)
FAST = {"moves": 2000, "starts": 2, "generations": 0, "lags": False, "committee_size": 2, "tuning_steps": 8}
DT = 0.1


def slope(x):
    return np.array([x[1], -x[0] + 0.6 * x[1] - 0.6 * x[0] * x[0] * x[1]])


def euler(x):
    return x + DT * slope(x)


def half_implicit(x):
    rate = x[1] + DT * slope(x)[1]
    return np.array([x[0] + DT * rate, rate])


def flow(x):
    return solve_ivp(lambda _, y: slope(y), (0.0, DT), x, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]


def recorded(step, noise=0.0, start=(1.5, 0.0), count=120):
    states = [np.array(start)]
    for _ in range(count):
        states.append(step(states[-1]))
    states = np.array(states)
    states = states + noise * np.random.default_rng(3).standard_normal(states.shape)
    return Run.of(states, np.zeros((count, 1)))


def signals_of(derivative_of=None):
    return tl.Signals(
        [tl.State("x", "m", 2.0), tl.State("v", "m/s", 2.0, derivative_of=derivative_of)],
        [tl.Command("idle", "1", (0.0, 1.0))],
        DT,
    )


def identified(run, signals, **changes):
    options = options_of("default", {**FAST, **changes})
    return identify_runs([run], signals, options, workers=WORKERS)


def terms(found, output):
    sums, pool = found.sums[output], found.pool
    return {pool.text(node, ["x", "v", "idle"]): weight for node, weight in sums.weights.items()}


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_flow_is_described_by_its_derivatives(noise):
    found = identified(recorded(flow, noise), signals_of())
    assert found.model.form == "acceleration"
    assert set(terms(found, 0)) == {"v"} and set(terms(found, 1)) == {"x", "v", "x**2*v"}
    (said,) = [remark for remark in found.remarks if remark.code == "form"]
    assert "derivatives (form 'acceleration')" in said.sentence and said.severity == "note"


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_the_step_of_a_simulator_is_described_by_its_increments(noise):
    found = identified(recorded(euler, noise), signals_of())
    assert found.model.form == "increment"
    assert set(terms(found, 0)) == {"v"} and set(terms(found, 1)) == {"x", "v", "x**2*v"}
    assert terms(found, 0)["v"] == pytest.approx(DT, rel=1e-2)


STEPS = [(euler, "explicit-euler"), (half_implicit, "semi-implicit-euler")]


@pytest.mark.parametrize(("step", "form"), STEPS)
@pytest.mark.parametrize("noise", [0.0, 3e-4])
def test_a_step_of_euler_is_found_and_its_law_has_one_equation_a_driven_state(step, form, noise):
    run = recorded(step, noise)
    found = identified(run, signals_of("x"))
    assert found.model.form == form and found.actuation.hidden == () and not found.offsets.any()
    expected = {"x": -1.0, "v": 0.6, "x**2*v": -0.6}
    assert terms(found, 0) == pytest.approx(expected, rel=5e-2 if noise else 1e-9)
    assert all(chain.motion.correlated == 0.0 for chain in found.chains)
    free = [run.states[0]]
    for _ in range(20):
        free.append(found.model.step([free[-1]], [[0.0]])[0])
    np.testing.assert_allclose(free, run.states[:21], atol=1e-2 if noise else 1e-9)
    (said,) = [remark for remark in found.remarks if remark.code == "form"]
    assert f"(form '{form}')" in said.sentence and "late or early by half a period" in said.sentence


@pytest.mark.parametrize(("step", "form"), STEPS)
@pytest.mark.parametrize("noise", [0.0, 1e-3, 1e-2])
def test_a_state_and_its_derivative_tell_which_step_is_taken(step, form, noise):
    assert euler_form([recorded(step, noise)], signals_of("x"), WORKERS) == form
    assert euler_form([recorded(step, noise)], signals_of(), WORKERS) is None
    assert candidates(options_of("default", {}), signals_of("x"), [recorded(step)], WORKERS) == (
        "acceleration",
        form,
    )


CHAIN = tl.Signals(
    [tl.State("y", "m", 2.0), tl.State("v", "m/s", 2.0, derivative_of="y"),
     tl.State("a", "m/s2", 4.0, derivative_of="v")],
    [tl.Command("u", "1", (-1.0, 1.0))],
    DT,
)  # fmt: skip


def chained(kind, noise=0.0):
    """A run of a chain of three; `kind` of "mixed": its position goes on by the start, its velocity by the end."""
    stream = np.random.default_rng(4)
    x, rows = np.zeros(3), [np.zeros(3)]
    commands = np.repeat(stream.uniform(-1.0, 1.0, (40, 1)), 5, axis=0)
    for u in commands[:, 0]:
        a = x[2] + DT * (-2.0 * x[2] - 3.0 * x[1] - x[0] + 4.0 * u)
        v = x[1] + DT * (x[2] if kind == "explicit-euler" else a)
        x = np.array([x[0] + DT * (v if kind == "semi-implicit-euler" else x[1]), v, a])
        rows.append(x)
    states = np.array(rows)
    return Run.of(states + noise * stream.normal(size=states.shape), commands)


@pytest.mark.parametrize("form", ["explicit-euler", "semi-implicit-euler"])
def test_a_longer_chain_steps_as_one(form):
    assert euler_form([chained(form, 1e-3)], CHAIN, WORKERS) == form
    found = identified(chained(form), CHAIN)
    assert found.model.form == form and not found.offsets.any()
    sums, pool = found.sums[0], found.pool
    law = {pool.text(node, ["y", "v", "a", "u"]): weight for node, weight in sums.weights.items()}
    assert law == pytest.approx({"a": -2.0, "v": -3.0, "y": -1.0, "u": 4.0}, rel=1e-6)


def test_pairs_that_do_not_agree_show_no_step():
    assert euler_form([chained("mixed", 1e-3)], CHAIN, WORKERS) is None
    states = [tl.State(name, "m", 2.0) for name in "ab"]
    states += [tl.State(f"d{name}", "m/s", 2.0, derivative_of=name) for name in "ab"]
    two = tl.Signals(states, [tl.Command("idle", "1", (0.0, 1.0))], DT)
    runs = [recorded(step, 1e-3) for step in (euler, half_implicit)]
    several = np.stack([run.states for run in runs], axis=2).reshape(-1, 4)
    assert euler_form([Run.of(several, runs[0].commands)], two, WORKERS) is None
    same = np.repeat(runs[0].states, 2, axis=1)
    assert euler_form([Run.of(same, runs[0].commands)], two, WORKERS) == "explicit-euler"


def body_run(kind, noise=0.0):
    """A body whose angles go on by its rates at the start or at the end of a period."""
    stream = np.random.default_rng(6)
    x, rows = np.zeros(6), [np.zeros(6)]
    commands = np.repeat(stream.uniform(-1.5, 1.5, (30, 3)), 4, axis=0)
    for command in commands:
        slopes = turning(x, command)
        rates = x[3:] + LATE_DT * slopes[3:]
        if kind == "semi-implicit-euler":
            slopes = turning(np.concatenate([x[:3], rates]), command)
        x = np.concatenate([x[:3] + LATE_DT * slopes[:3], rates])
        rows.append(x)
    states = np.array(rows)
    return Run.of(states + noise * stream.normal(size=states.shape), commands)


@pytest.mark.parametrize("form", ["explicit-euler", "semi-implicit-euler"])
def test_angles_that_body_rates_turn_show_it_too(form):
    assert euler_form([body_run(form, 1e-3)], BODY, WORKERS) == form
    found = identified(body_run(form, 1e-4), BODY)
    assert found.model.form == form and not found.offsets.any()
    names = [*BODY.state_names, *BODY.command_names]
    laws = [
        {found.pool.text(node, names): weight for node, weight in sums.weights.items()} for sums in found.sums
    ]
    assert laws[0] == pytest.approx({"p": -1.0, "u": 3.0}, rel=1e-2)
    assert laws[1] == pytest.approx({"q": -1.0, "b": -3.0, "v": 2.0}, rel=1e-2)
    assert laws[2] == pytest.approx({"r": -1.0, "p*q": 0.5, "w": 2.0}, rel=1e-2)
    assert all(chain.motion.correlated == 0.0 for chain in found.chains)


def test_a_body_that_turns_steadily_takes_no_step_of_euler():
    for late in (0.0, 0.3, -0.2):
        assert euler_form([read(turning, BODY, 1, late * LATE_DT)], BODY, WORKERS) is None


@pytest.mark.parametrize("late", [0.5, -0.5])
def test_a_sensor_that_is_late_by_half_a_period_is_told_from_a_step_of_euler(late):
    # Where hardly anything is noisy kinematics tell the two apart, otherwise the law does.
    exact, *runs = [read(swinging, PENDULUM, 1, late * LATE_DT, noise) for noise in (1e-5, 3e-3)]
    assert euler_form([exact], PENDULUM, WORKERS) is None
    form = euler_form(runs, PENDULUM, WORKERS)
    assert form == ("explicit-euler" if late > 0.0 else "semi-implicit-euler")
    found = identify_runs(runs, PENDULUM, options_of("default", FAST), workers=WORKERS)
    assert found.model.form == "acceleration"
    assert found.offsets == pytest.approx([late * LATE_DT, 0.0], abs=0.1 * LATE_DT)
    (said,) = [remark for remark in found.remarks if remark.code == "form"]
    assert "derivatives (form 'acceleration')" in said.sentence and "late or early by" in said.sentence


@pytest.mark.parametrize("late", [0.1, 0.3, -0.2, 0.7])
def test_a_sensor_that_is_late_is_no_step_of_euler(late):
    run = read(swinging, PENDULUM, 1, late * LATE_DT)
    assert candidates(options_of("default", {}), PENDULUM, [run], WORKERS) == ("acceleration",)


def test_declared_derivatives_of_a_flow_are_believed_at_once():
    run = recorded(flow)
    assert candidates(options_of("default", {}), signals_of("x"), [run], WORKERS) == ("acceleration",)
    assert euler_form([recorded(flow, 0.05)], signals_of("x"), WORKERS) is None
    assert [remark.code for remark in identified(run, signals_of("x")).remarks if remark.code == "form"] == []


@pytest.mark.parametrize("form", FORMS)
def test_a_form_of_the_options_is_the_form(form):
    found = identified(recorded(flow), signals_of(), form=form)
    assert found.model.form == form and all(remark.code != "form" for remark in found.remarks)


def test_a_disturbance_that_explains_all_hides_no_form():
    # A cubic law, whose terms stand on the last rung: under a lasting disturbance that explains all they gain nothing.
    states = solved(lambda x: [0.3 * x * x - 0.2 * x - 0.1 * x * x * x], [1.4], DT * np.arange(150))
    signals = tl.Signals([tl.State("x", "1", 1.4)], [tl.Command("idle", "1", (0.0, 1.0))], DT)
    found = identified(Run.of(states, np.zeros((149, 1))), signals)
    assert found.model.form == "acceleration"


def test_formulas_of_a_user_mean_one_form():
    told = options_of("default", {"fixed_terms": ["v: -1.0 * x"]})
    run = recorded(flow)
    assert candidates(told, signals_of("x"), [run], WORKERS) == ("acceleration",)
    assert candidates(told, signals_of(), [run], WORKERS) == ("increment",)


@pytest.mark.parametrize("rate", [-0.04, -0.004, 0.01])
@pytest.mark.parametrize("noise", [0.05, 0.5])
def test_of_a_linear_system_both_forms_are_described_alike(rate, noise):
    """Its exact step is linear, too: neither form knows more, and the readings cannot prefer one."""
    dt, count, runs = 3.0, 120, []
    signals = tl.Signals([tl.State("air", "K", 50.0)], [tl.Command("power", "W", (0.0, 1.0), scale=1.0)], dt)
    growth = np.exp(rate * dt)
    for seed in range(3):
        stream = np.random.default_rng(seed)
        power, air = np.repeat(stream.uniform(0.0, 1.0, count // 10), 10), [0.0]
        for u in power:
            air.append(growth * air[-1] + (growth - 1.0) / rate * 2.5 * u)
        readings = np.array(air)[:, None]
        runs.append(Run.of(readings + noise * stream.normal(size=readings.shape), power[:, None]))
    context = Context(
        [run.continued(signals) for run in runs], signals, options_of("default", {}), Unit(0), WORKERS
    )
    first, other = (brief_look(context, form, 1) for form in ("acceleration", "increment"))
    stepping = 12.0
    assert _described(context, other) - _described(context, first) == pytest.approx(stepping, abs=6.0)
    # A law of derivatives is read at both ends of a period, which residuals alone do not show.
    assert other.length - first.length == pytest.approx(rate * dt * count * len(runs), abs=6.0)
