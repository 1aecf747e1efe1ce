"""Whether a law is one of derivatives or of steps is found out from readings, and said."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import twinloop as tl
from late_sensors import DT as LATE_DT
from late_sensors import PENDULUM, read, swinging
from twinloop import _core
from twinloop.campaign.presets import options_of
from twinloop.identification.forms import candidates, steps_like_euler
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run

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
    return identify_runs([run], signals, options, workers=_core.Workers(1))


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


@pytest.mark.parametrize("step", [euler, half_implicit])
@pytest.mark.parametrize("noise", [0.0, 3e-4])
def test_a_declared_derivative_does_not_hide_a_step_of_euler(step, noise):
    run = recorded(step, noise)
    assert steps_like_euler([run], signals_of("x"))
    found = identified(run, signals_of("x"))
    assert found.model.form == "increment" and found.actuation.hidden == () and not found.offsets.any()
    free = [run.states[0]]
    for _ in range(20):
        free.append(found.model.step([free[-1]], [[0.0]])[0])
    np.testing.assert_allclose(free, run.states[:21], atol=1e-2 if noise else 1e-5)


@pytest.mark.parametrize("late", [0.1, 0.3, -0.2, 0.7])
def test_a_sensor_that_is_late_is_no_step_of_euler(late):
    run = read(swinging, PENDULUM, 1, late * LATE_DT)
    assert candidates(options_of("default", {}), PENDULUM, [run]) == ("acceleration",)


def test_declared_derivatives_of_a_flow_are_believed_at_once():
    run = recorded(flow)
    assert candidates(options_of("default", {}), signals_of("x"), [run]) == ("acceleration",)
    assert not steps_like_euler([recorded(flow, 0.05)], signals_of("x"))
    assert [remark.code for remark in identified(run, signals_of("x")).remarks if remark.code == "form"] == []


@pytest.mark.parametrize("form", ["absolute", "increment", "acceleration"])
def test_a_form_of_the_options_is_the_form(form):
    found = identified(recorded(flow), signals_of(), form=form)
    assert found.model.form == form and all(remark.code != "form" for remark in found.remarks)


def test_a_disturbance_that_explains_all_hides_no_form():
    # A cubic law, whose terms stand on the last rung: under a lasting disturbance that explains all they gain nothing.
    t = DT * np.arange(150)
    states = solve_ivp(
        lambda _, x: 0.3 * x * x - 0.2 * x - 0.1 * x * x * x,
        (0.0, t[-1]),
        [1.4],
        "DOP853",
        t,
        rtol=1e-13,
        atol=1e-13,
    ).y.T
    signals = tl.Signals([tl.State("x", "1", 1.4)], [tl.Command("idle", "1", (0.0, 1.0))], DT)
    found = identified(Run.of(states, np.zeros((149, 1))), signals)
    assert found.model.form == "acceleration"


def test_formulas_of_a_user_mean_one_form():
    told = options_of("default", {"fixed_terms": ["v: -1.0 * x"]})
    run = recorded(flow)
    assert candidates(told, signals_of("x"), [run]) == ("acceleration",)
    assert candidates(told, signals_of(), [run]) == ("increment",)
