"""Models with a memory: their errors walk through each test in the order of time, and a past can be told."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from twinloop import _core, objectives
from twinloop._experiment.limits import Limits

DT, SCALE = 0.1, 2.0
LAW = _core.Program.parse(
    "program inputs=4 outputs=2 registers=8\npage 1\n"
    "r6 = r2 * 0.5\nr4 = r1 * 0.25\nr4 = r4 + r6\nr6 = r3 * 0.125\nr5 = r0 * -0.5\nr5 = r5 - r6\n"
)
"""Inputs x, v, u / scale, h; outputs 0.25 v + 0.5 u / scale and −0.5 x − 0.125 h."""


def signals():
    return tl.Signals(
        states=[tl.State("x", "m", scale=1.0), tl.State("v", "bar", scale=1.0)],
        commands=[tl.Command("u", "N", bounds=(-SCALE, SCALE), scale=SCALE)],
        dt=DT,
    )


SIGNALS = signals()
FAMILY = tl.controllers.PID(
    axes=[("x", "v")], gains={"x.kp": (0.0, 1.0), "x.ki": (0.0, 1.0), "x.kd": (0.0, 1.0)}
).bind(SIGNALS)
FORMS = st.sampled_from(["absolute", "increment"])
LAGS, DELAYS = st.sampled_from([0.0, 0.03, 0.4]), st.integers(0, 3)
TIMES = st.sampled_from([0.05, 0.3, 5.0])


def model_of(form, lag, delay, rest, time):
    hidden = [([0], True, rest, time, [], False, 0.0, 0.0, 0.0)]
    return _core.Model(LAW, form, SIGNALS.engine, [(lag, delay, rest, 0.0)], hidden)


def run(seed, steps):
    random = np.random.default_rng(seed)
    return random.normal(size=(steps + 1, 2)), random.uniform(-SCALE, SCALE, size=(steps, 1))


def selected(runs):
    empty = _core.SelectedTests(Limits(SIGNALS).setting(FAMILY.engine))
    for states, commands in runs:
        empty = empty.with_test([0.5, 0.5, 0.5], [0.0, 0.0], states, commands)
    return empty


def middles(commands, lag, delay, rest, time):
    """The command's effect and the hidden state in the middle of each period, from their differential equations."""
    u = commands[:, 0]
    sent = np.concatenate([np.full(delay, u[0] if rest is None else rest), u])[: len(u)]
    effect, filled = (u[0] if rest is None else rest), 0.0
    at_rest = (u[0] / SCALE) ** 2 if rest is None else rest
    found = []
    for arrived, commanded in zip(sent, u, strict=True):
        half = np.exp(-0.5 * DT / lag) if lag else 0.0
        empties, level = np.exp(-0.5 * DT / time), (commanded / SCALE) ** 2 - at_rest
        middle = arrived + (effect - arrived) * half
        effect = arrived + (middle - arrived) * half
        hidden = filled * empties + level * time * (1.0 - empties)
        filled = hidden * empties + level * time * (1.0 - empties)
        found.append((middle, hidden))
    return found


def expected_error(form, states, commands, actuation, horizon):
    """Mean squared error of free runs of some steps from each recorded state, one after another."""
    inputs, errors = middles(commands, *actuation), []
    for start in range(len(commands) - horizon + 1):
        x, v = states[start]
        for effect, hidden in inputs[start : start + horizon]:
            outputs = 0.25 * v + 0.5 * effect / SCALE, -0.5 * x - 0.125 * hidden
            x, v = outputs if form == "absolute" else (x + outputs[0], v + outputs[1])
        errors.append((np.array([x, v]) - states[start + horizon]) ** 2)
    return np.mean(errors)


@given(FORMS, LAGS, DELAYS, st.sampled_from([None, 0.25]), TIMES, st.integers(1, 6), st.integers(0, 5))
def test_errors_are_those_of_runs_from_each_state_with_the_memory_of_what_was_commanded_before(
    form, lag, delay, rest, time, horizon, seed
):
    runs = [run(seed, 12), run(seed + 1, 7), run(seed + 2, 30)]
    actuation = (lag, delay, rest, time)
    model = model_of(form, *actuation)
    expected = [expected_error(form, *one, actuation, horizon) for one in runs]
    found = objectives.k_step([model], selected(runs), horizon)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    if horizon == 1:
        np.testing.assert_array_equal(found, objectives.open_loop([model], selected(runs))[0])


@given(FORMS, LAGS, DELAYS, TIMES, st.permutations(range(5)), st.integers(1, 4))
def test_the_error_of_a_test_depends_on_no_other_test_and_on_no_order(form, lag, delay, time, order, count):
    runs = [run(seed, 3 + 11 * seed) for seed in range(5)]
    model = model_of(form, lag, delay, None, time)
    alone = [objectives.open_loop([model], selected([one]))[0, 0] for one in runs]
    some = order[:count]
    found = objectives.open_loop([model], selected([runs[i] for i in some]))[0]
    assert found.tolist() == [alone[i] for i in some]


def test_one_step_ahead_without_memory_is_what_it_was_and_so_are_k_steps_of_it():
    runs = [run(seed, 70) for seed in range(3)]
    model = _core.Model(_core.Program.parse(
        "program inputs=3 outputs=2 registers=6\npage 1\nr3 = r1 * 0.25\nr4 = r2 * 0.5\nr3 = r3 + r4\n"
    ), "increment", SIGNALS.engine)  # fmt: skip
    one = objectives.open_loop([model], selected(runs))
    np.testing.assert_allclose(objectives.k_step([model], selected(runs), 1), one, rtol=1e-12)
    states, commands = runs[0]
    following = states[:-3]
    for k in range(3):
        following = model.step(following, commands[k : len(commands) - 2 + k])
    expected = np.mean((following - states[3:]) ** 2)
    np.testing.assert_allclose(objectives.k_step([model], selected(runs[:1]), 3)[0, 0], expected, rtol=1e-12)


@pytest.mark.parametrize("steps", [0, 8, 2**40])
def test_more_steps_than_the_shortest_test_has_are_refused(steps):
    model = model_of("increment", 0.1, 1, None, 1.0)
    with pytest.raises(tl.InvalidInput, match="expected 1 to 7 steps"):
        objectives.k_step([model], selected([run(0, 12), run(1, 7)]), steps)


@given(FORMS, LAGS, DELAYS, st.sampled_from([None, 0.25]), TIMES)
def test_a_step_with_a_past_is_that_of_the_run_with_these_commands(form, lag, delay, rest, time):
    twin = tl.Twin(model_of(form, lag, delay, rest, time), SIGNALS)
    flown = twin.simulate_commands([0.1, -0.2], np.random.default_rng(1).uniform(-SCALE, SCALE, (9, 1)))
    for k in range(len(flown.commands)):
        past = flown.commands[:k]
        found = twin.predict(flown.states[k], flown.commands[k], past)
        np.testing.assert_allclose(found, flown.states[k + 1], rtol=1e-12, atol=1e-15)
    rows = np.stack([flown.commands[k : k + 3] for k in range(4)])
    together = twin.predict(flown.states[3:7], flown.commands[3:7], rows)
    for k in range(4):
        alone = twin.predict(flown.states[3 + k], flown.commands[3 + k], rows[k])
        np.testing.assert_array_equal(together[k], alone)


def test_a_past_of_other_commands_is_refused():
    twin = tl.Twin(model_of("increment", 0.1, 1, None, 1.0), SIGNALS)
    with pytest.raises(tl.InvalidInput, match="Past commands"):
        twin.predict([0.0, 0.0], [0.0], [[0.0, 0.0]])
    with pytest.raises(tl.InvalidInput, match="Past commands"):
        twin.predict([[0.0, 0.0]] * 2, [[0.0]] * 2, [[[0.0]]])


def test_lagging_rotors_remember_what_was_commanded():
    system = tl.systems.Quadrotor(motor_lag=0.05)
    family, plant = system.controller.bind(system.signals), system.dynamics
    start = np.array([0.3, -0.2, 0.1, 0.0, 0.0, 0.0])
    task = _core.Task(start, np.zeros(6), 6)
    gains = family.genes(system.default_gains)[np.newaxis]
    flown = _core.rollout(plant, Limits(system.signals).setting(family.engine), gains, task)
    commands, states = flown.commands[0], [start]
    for k in range(6):
        states.append(plant.step([states[-1]], commands[[k]], past=commands[np.newaxis, :k])[0])
    np.testing.assert_array_equal(states, flown.states[0])
