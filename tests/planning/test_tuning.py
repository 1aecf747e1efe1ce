"""Actuators, rigid bodies and the tuning of constants, beside plain loops, SciPy's rotations and its least squares."""

from collections import deque

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from oracles import Pid, close_loop, rk4, same_bits
from strategies import program_text
from twinloop import _core
from twinloop.law.forms import DERIVATIVES, EULER, FORMS

DT = 0.05
QUIET = (0.0, 0.0, 1.0)


class Line:
    """One actuator: whole periods of delay, then a first-order lag, solved exactly within each period."""

    def __init__(self, lag, delay, rest, ramp):
        assert ramp == 0.0
        self.lag, self.delay, self.rest, self.waiting = lag, delay, rest, None

    def effects(self, command, dt):
        if self.waiting is None:
            before = command if self.rest is None else self.rest
            self.waiting, self.value = deque([before] * self.delay), before
        self.waiting.append(command)
        arrived = self.waiting.popleft()
        if self.lag == 0.0:
            self.value = arrived
            return [arrived] * 3
        found = [arrived + (self.value - arrived) * np.exp(-t / self.lag) for t in (0.0, dt / 2, dt)]
        self.value = found[2]
        return found


ACTUATORS = [
    [(0.08, 0, None, 0.0), (0.0, 2, None, 0.0)],
    [(0.03, 3, 0.5, 0.0), (0.2, 0, -1.0, 0.0)],
    [(0.0, 0, None, 0.0), (0.5, 1, 0.0, 0.0)],
]


@pytest.mark.parametrize("actuators", ACTUATORS)
def test_the_effects_of_commands_are_those_of_a_plain_loop(actuators):
    commands = np.random.default_rng(0).normal(size=(25, 2))
    found = _core.command_effects(actuators, [], np.ones(2), DT, commands)
    lines = [Line(*actuator) for actuator in actuators]
    expected = np.array(
        [[line.effects(c, DT) for line, c in zip(lines, row, strict=True)] for row in commands]
    )
    for stage in range(3):
        np.testing.assert_allclose(found[stage], expected[:, :, stage], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("lag", [0.0, 0.13])
def test_effects_that_move_at_a_limited_rate_are_those_of_scipy(lag):
    commands = np.repeat(np.random.default_rng(0).normal(size=(8, 1)), 4, axis=0)
    ramp, scale = 0.6, 2.0
    found = _core.command_effects([(lag, 1, 0.5, ramp)], [], [scale], DT, commands)
    rate, value, sent = scale / ramp, 0.5, [0.5, *commands[:-1, 0]]
    for k, command in enumerate(sent):

        def moves(_, e, command=command):
            return np.clip((command - e) / max(lag, 1e-6), -rate, rate)

        run = solve_ivp(
            moves, (0.0, DT), [value], "LSODA", [0.0, DT / 2, DT], rtol=1e-9, atol=1e-9, max_step=DT / 50
        )
        assert [stage[k, 0] for stage in found] == pytest.approx(run.y[0].tolist(), abs=2e-5)
        value = float(found[2][k, 0])
    assert np.abs(np.diff(found[2][:, 0])).max() == pytest.approx(rate * DT)


@pytest.mark.parametrize("actuators", ACTUATORS)
@pytest.mark.parametrize("form", ["increment", "acceleration"])
def test_a_model_with_actuators_flies_as_a_plain_loop_does(rig, rig_setting, form, actuators):
    text = program_text(4, 2, 6, [["r4 = r1 * 0.1", "r5 = r2 * 0.4", "r4 = r4 + r5", "r5 = r3 - r1"]])
    if form == "acceleration":
        text = program_text(4, 1, 6, [["r4 = r2 * 2.0", "r5 = r3 - r1", "r4 = r4 + r5"]])
    program, scales = _core.Program.parse(text), np.array([1.0, 4.0])
    model = _core.Model(program, form, rig, actuators)
    assert model.actuators == actuators
    genes, steps = np.random.default_rng(1).uniform(0.0, 2.0, (5, 6)), 20
    runs = _core.rollout(model, rig_setting, genes, _core.Task([0.4, 0.0], [-0.2, 0.0], steps))
    for i in range(len(genes)):
        lines = [Line(*actuator) for actuator in actuators]

        def step(x, u, lines=lines):
            effects = np.array([line.effects(c, 0.1) for line, c in zip(lines, u, strict=True)]).T / scales
            if form == "increment":
                return x + program.run([[*x, *effects[1]]])[0]
            stages = iter([effects[0], effects[1], effects[1], effects[2]])
            return rk4(lambda s: np.array([s[1], program.run([[*s, *next(stages)]])[0, 0]]), np.array(x), 0.1)

        pid = Pid(
            [(0, 1), (1, None)], genes[i], 0.1, [[1.0, 0.25], [0.5, -2.0]], [0.1, -0.2], 1.0,
            [(-1.0, 1.0), (-3.0, 2.0)],
        )  # fmt: skip
        states, _, commands, lasted = close_loop(
            step, pid, [0.4, 0.0], np.array([-0.2, 0.0]), steps, np.array([10.0, 20.0])
        )
        assert lasted == runs.lasted[i]
        np.testing.assert_allclose(runs.states[i, : lasted + 1], states, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(runs.commands[i, :lasted], commands, rtol=1e-9, atol=1e-11)


class Filling:
    """A hidden state that commands fill, integrated in small steps rather than solved."""

    def __init__(self, commands, squared, rest, time, states, settled, turns):
        assert not states and not settled and not turns
        self.commands, self.squared, self.rest, self.time, self.value = commands, squared, rest, time, 0.0

    def values(self, command, scales, dt, steps=4000):
        given = np.array([command[i] / scales[i] for i in self.commands])
        level = np.mean(given**2 if self.squared else given)
        self.rest = level if self.rest is None else self.rest
        found = [self.value]
        for _ in range(2):
            for _ in range(steps // 2):
                # Heun's rule.
                h = dt / steps
                first = level - self.rest - self.value / self.time
                second = level - self.rest - (self.value + h * first) / self.time
                self.value += 0.5 * h * (first + second)
            found.append(self.value)
        return found


HIDDEN = [
    [([0, 1], True, 0.3, 0.7, [], False, 0.0, 0.0, 0.0)],
    [([1], False, None, 0.2, [], False, 0.0, 0.0, 0.0)],
    [([0], True, None, 5.0, [], False, 0.0, 0.0, 0.0), ([0, 1], False, 0.0, 0.1, [], False, 0.0, 0.0, 0.0)],
]


@pytest.mark.parametrize("hidden", HIDDEN)
def test_hidden_states_are_those_of_a_plain_loop(hidden):
    commands, scales = np.random.default_rng(0).normal(size=(25, 2)), np.array([2.0, 0.5])
    found = _core.command_effects(ACTUATORS[1], hidden, scales, DT, commands)
    plain = _core.command_effects(ACTUATORS[1], [], scales, DT, commands)
    states = [Filling(*parts[:7]) for parts in hidden]
    expected = np.array([[state.values(row, scales, DT) for state in states] for row in commands])
    for stage in range(3):
        assert same_bits(found[stage][:, :2], plain[stage])
        np.testing.assert_allclose(found[stage][:, 2:], expected[:, :, stage], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("actuators", [[(0.0, 0, None, 0.0)] * 2, ACTUATORS[1]])
@pytest.mark.parametrize("form", FORMS)
def test_a_model_with_hidden_states_flies_as_a_plain_loop_does(rig, rig_setting, form, actuators):
    hidden, scales = HIDDEN[2], np.array([1.0, 4.0])
    text = program_text(
        6, 2, 9, [["r6 = r1 * 0.1", "r8 = r2 * r4", "r6 = r6 + r8", "r7 = r3 - r1", "r7 = r7 + r5"]]
    )
    if form in DERIVATIVES:
        text = program_text(6, 1, 8, [["r6 = r2 * r4", "r7 = r3 - r1", "r6 = r6 + r7", "r6 = r6 + r5"]])
    program = _core.Program.parse(text)
    model = _core.Model(program, form, rig, actuators, hidden)
    assert model.hidden == hidden and model.actuators == actuators
    genes, steps = np.random.default_rng(1).uniform(0.0, 1.0, (3, 6)), 12
    runs = _core.rollout(model, rig_setting, genes, _core.Task([0.4, 0.0], [-0.2, 0.0], steps))
    for i in range(len(genes)):
        lasted = runs.lasted[i]
        effects = _core.command_effects(actuators, hidden, scales, 0.1, runs.commands[i, :lasted])
        inputs = [np.hstack([e[:, :2] / scales, e[:, 2:]]) for e in effects]
        state = np.array([0.4, 0.0])
        for k in range(lasted):
            seen = [stage[k] for stage in inputs]
            if form == "acceleration":
                stages = iter([seen[0], seen[1], seen[1], seen[2]])

                def slope(s, stages=stages):
                    return np.array([s[1], program.run([[*s, *next(stages)]])[0, 0]])

                state = rk4(slope, state, 0.1)
            elif form in EULER:
                after = state[1] + 0.1 * program.run([[*state, *seen[0]]])[0, 0]
                state = np.array([state[0] + 0.1 * (after if form == EULER[1] else state[1]), after])
            else:
                change = program.run([[*state, *seen[1]]])[0]
                state = change + (state if form == "increment" else 0.0)
            np.testing.assert_allclose(runs.states[i, k + 1], state, rtol=1e-9, atol=1e-11)
        assert lasted == steps


@pytest.mark.parametrize(
    "hidden",
    [
        ([], True, None, 1.0, [], False, 0.0, 0.0, 0.0),
        ([2], True, None, 1.0, [], False, 0.0, 0.0, 0.0),
        ([0], True, np.nan, 1.0, [], False, 0.0, 0.0, 0.0),
        ([0], True, None, 0.0, [], False, 0.0, 0.0, 0.0),
        ([0], True, 0.0, 1.0, [0], False, 0.0, 0.0, 0.0),
        ([0], True, 0.0, 1.0, [], True, 0.0, 0.0, 0.0),
        ([], True, None, 1.0, [0], False, 0.0, 0.0, 0.0),
        ([], True, 0.0, 1.0, [9], False, 0.0, 0.0, 0.0),
    ],
)
def test_hidden_states_that_there_are_none_of_are_refused(rig, hidden):
    program = _core.Program.parse(program_text(5, 2, 7, [["r5 = r2 + 0.0"]]))
    with pytest.raises(ValueError, match="expected"):
        _core.Model(program, "absolute", rig, [(0.0, 0, None, 0.0)] * 2, [hidden])
    with pytest.raises(ValueError, match="actuators: expected one for each of 2 commands, found 0"):
        _core.Model(program, "absolute", rig, None, [([0], True, None, 1.0, [], False, 0.0, 0.0, 0.0)])
    with pytest.raises(ValueError, match="expected a program of 4 inputs"):
        _core.Model(program, "absolute", rig, [(0.0, 0, None, 0.0)] * 2)


def test_actuators_that_act_at_once_are_none(rig, rig_setting):
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r2 + 0.0", "r5 = r3 + 0.0"]]))
    plain, direct = (
        _core.Model(program, "absolute", rig),
        _core.Model(program, "absolute", rig, [(0.0, 0, 1.0, 0.0)] * 2),
    )
    assert direct.actuators == []
    task, genes = _core.Task([0.4, 0.0], [-0.2, 0.0], 9), np.ones((1, 6))
    runs = [_core.rollout(model, rig_setting, genes, task).states for model in (plain, direct)]
    assert same_bits(*runs)


@pytest.mark.parametrize(
    "actuators",
    [
        [(0.1, 0, None, 0.0)],
        [(-0.1, 0, None, 0.0)] * 2,
        [(0.1, 0, np.nan, 0.0)] * 2,
        [(0.0, 1001, None, 0.0)] * 2,
    ],
)
def test_actuators_that_there_are_none_of_are_refused(rig, actuators):
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r2 + 0.0"]]))
    with pytest.raises(ValueError, match="expected"):
        _core.Model(program, "absolute", rig, actuators)


@pytest.fixture(scope="module")
def body():
    """Signals of a rigid body whose states are in no particular order, and the names of their places."""
    angles, rates = [4, 0, 2], [1, 5, 3]
    return (
        _core.Signals(0.01, [4.0] * 6, [(-1.0, 1.0)] * 3, [1.0] * 3, [None] * 6, (angles, rates)),
        np.array(angles),
        np.array(rates),
    )


def spinning(body, acceleration=(0.0, 0.0, 0.0)):
    signals, _, _ = body
    lines = [f"r{9 + i} = r{9 + i} + {float(a)!r}" for i, a in enumerate(acceleration)]
    return _core.Model(_core.Program.parse(program_text(9, 3, 12, [lines])), "acceleration", signals)


def orientation(states, angles):
    return Rotation.from_euler("ZYX", states[..., angles[::-1]])


def test_constant_rates_turn_a_body_about_a_fixed_axis(body):
    signals, angles, rates = body
    stream = np.random.default_rng(2)
    states = stream.uniform(-1.2, 1.2, (50, 6))
    model = spinning(body)
    assert model.shape("acceleration", signals) == (9, 3)
    after = model.step(states, np.zeros((50, 3)))
    expected = orientation(states, angles) * Rotation.from_rotvec(0.01 * states[:, rates])
    assert (orientation(after, angles).inv() * expected).magnitude().max() < 1e-9
    assert same_bits(after[:, rates], states[:, rates])


def test_a_turn_of_many_periods_is_the_product_of_small_rotations(body):
    _, angles, rates = body
    model, state = spinning(body, (1.0, -2.0, 0.5)), np.array([0.3, 0.2, -1.0, 0.4, 0.1, 0.5])[None]
    attitude, small = orientation(state[0], angles), 200
    rate = state[0, rates].copy()
    change = np.array([1.0, 0.5, -2.0])  # outputs are in the order of the states: p, r, q
    for _ in range(40):
        for _ in range(small):  # the middle of each small step
            h = 0.01 / small
            attitude = attitude * Rotation.from_rotvec(h * (rate + 0.5 * h * change))
            rate += h * change
        state = model.step(state, np.zeros((1, 3)))
    assert (orientation(state[0], angles).inv() * attitude).magnitude() < 1e-7
    np.testing.assert_allclose(state[0, rates], rate, rtol=1e-12)


def test_a_body_that_points_straight_up_stays_finite(body):
    _, angles, rates = body
    state = np.zeros((1, 6))
    state[0, angles[1]], state[0, rates] = np.pi / 2, 1.0
    assert np.isfinite(spinning(body).step(state, np.zeros((1, 3)))).all()


@pytest.mark.parametrize("kinematics", [([0, 1, 2], [3, 4, 4]), ([0, 1, 2], [3, 4, 6])])
def test_a_body_of_states_that_there_are_none_of_is_refused(kinematics):
    with pytest.raises(ValueError, match="six different states"):
        _core.Signals(0.01, [1.0] * 6, [(-1.0, 1.0)], [1.0], [None] * 6, kinematics)


# Tuning


SENSOR = 4e-4
"""Variance of the speed's sensor."""


def lagging(a, b, lag):
    """speed' = a speed + b u behind a lag, as a model with two constants."""
    signals = _core.Signals(DT, [5.0], [(-3.0, 3.0)], [1.0], [None])
    text = program_text(2, 1, 4, [["r2 = r0 * " + repr(a), "r3 = r1 * " + repr(b), "r2 = r2 + r3"]])
    return _core.Model(_core.Program.parse(text), "acceleration", signals, [(lag, 0, 0.0, 0.0)])


def flown(seed, steps=120, truth=(-1.3, 2.0, 0.12)):
    """A noisy run of the true plant under commands that change now and then."""
    a, b, lag = truth
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-2.0, 2.0, (steps // 10, 1)), 10, axis=0)
    states = loop(a, b, lag, commands, np.array([0.5]), lambda x, k: (x, 0.0))[1]
    readings = states + np.sqrt(SENSOR) * stream.normal(size=states.shape)
    return readings, np.ones_like(readings), commands


def loop(a, b, lag, commands, state, correct):
    """Innovations and states of the model, each state corrected after its reading."""
    line, errors, states = Line(lag, 0, 0.0, 0.0), [], []
    for k in range(len(commands) + 1):
        state, error = correct(state, k)
        errors.append(error)
        states.append(state)
        if k < len(commands):
            start, middle, end = line.effects(commands[k, 0], DT)
            stages = iter([start, middle, middle, end])
            state = rk4(lambda x, stages=stages: a * x + b * next(stages), np.asarray(state), DT)
    return np.array(errors), np.array(states)


def residuals(values, records):
    """What tuning should make small: errors of a filter that only has to find out where a run began."""
    found = []
    for readings, weights, commands in records:
        spread, gains = np.abs(readings).max() ** 2, []
        for weight in weights[:, 0]:
            variance = SENSOR if weight else 1e12 * SENSOR
            gains.append((spread / (spread + variance), np.sqrt(spread + variance)))
            spread *= 1.0 - gains[-1][0]

        def correct(state, k, readings=readings, gains=gains):
            gain, size = gains[k]
            innovation = readings[k] - state
            return state + gain * innovation, float(innovation[0] / size)

        errors = loop(*values, commands, readings[0], correct)[0]
        found.append(np.where(weights[:, 0] > 0.0, errors, 0.0))
    return np.concatenate(found)


UNIT = (3, "members", [0])
CHAIN = [([0], [SENSOR], QUIET, "acceleration")]
LIMITS = _core.Limits(_core.Signals(DT, [5.0], [(-3.0, 3.0)], [1.0], [None]))


def test_constants_and_a_lag_are_those_that_scipy_finds():
    records = [flown(1), flown(2)]
    start = (-0.8, 1.5, 0.2)
    tuned, left, readings, covariance, members = _core.tune(
        lagging(*start), LIMITS, CHAIN, records, free=[0, 1], lags=[[0]], iterations=30, draws=400, unit=UNIT
    )
    expected = least_squares(residuals, start, args=(records,), xtol=1e-12, ftol=1e-12)
    errors = np.sqrt(np.diag(np.linalg.inv(expected.jac.T @ expected.jac)))
    found = np.array([*tuned.constants, tuned.actuators[0][0]])
    assert (np.abs(found - expected.x) < 0.05 * errors).all()
    assert (np.abs(found - [-1.3, 2.0, 0.12]) < 4.0 * errors).all()
    assert left == pytest.approx(2.0 * expected.cost, rel=1e-4) and readings == 242
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), errors, rtol=1e-2)
    drawn = np.array([[*member.constants, member.actuators[0][0]] for member in members])
    np.testing.assert_allclose(np.cov(drawn.T), covariance, rtol=0.3, atol=0.1 * covariance.max() * 0.1)


def test_constants_that_do_the_same_are_drawn_as_far_as_the_runs_bear_it():
    """speed' = a speed + b c u: only the product of b and c shows, and they may move against each other."""
    signals = _core.Signals(DT, [5.0], [(-3.0, 3.0)], [1.0], [None])
    page = ["r3 = r1 * 4.0", "r2 = r0 * -1.0", "r3 = r3 * 0.5", "r2 = r2 + r3"]
    model = _core.Model(_core.Program.parse(program_text(2, 1, 4, [page])), "acceleration", signals)
    records = [flown(1, truth=(-1.3, 2.0, 1e-9)), flown(2, truth=(-1.3, 2.0, 1e-9))]
    tuned, left, _, covariance, members = _core.tune(
        model, LIMITS, CHAIN, records, free=[0, 1, 2], lags=[], iterations=30, draws=200, unit=UNIT
    )
    drawn = np.array([member.constants for member in members])
    outer, damping, inner = np.array(tuned.constants), drawn[:, 1], drawn[:, 0] * drawn[:, 2]
    assert (np.sqrt(np.diag(covariance)) <= np.abs(outer) * (1.0 + 1e-9)).all()
    assert np.std(drawn[:, 0]) > 0.02 * abs(outer[0])
    # As the runs have it where b c is one constant, within what a hundred draws can tell and halving takes away.
    _, _, _, plain, _ = _core.tune(
        lagging(-1.0, 2.0, 0.0), LIMITS, CHAIN, records, free=[0, 1], lags=[], iterations=30, draws=0
    )
    errors = np.sqrt(np.diag(plain))
    assert 0.1 * errors[0] < np.std(damping) < 1.3 * errors[0]
    assert np.abs(inner - outer[0] * outer[2]).max() < 8.0 * errors[1]
    for member in members[:20]:
        _, chi, *_ = _core.tune(member, LIMITS, CHAIN, records, free=[], lags=[], iterations=0)
        assert chi <= left + 3.0 + 3.0 * np.sqrt(6.0) + 1e-6


def test_predictions_are_those_of_a_plain_loop_and_a_reading_that_does_not_count_is_not_used():
    readings, weights, commands = flown(4)
    weights[37], readings[37] = 0.0, 3.0
    values = (-1.2, 1.9, 0.1)
    [(errors, states, _)] = _core.predictions(
        lagging(*values), LIMITS, CHAIN, [(readings, weights, commands)]
    )
    np.testing.assert_allclose(errors[:, 0], residuals(values, [(readings, weights, commands)]), atol=1e-6)
    assert errors[37, 0] == 0.0 and abs(states[37, 0] - 3.0) > 0.5
    _, left, counted, _, _ = _core.tune(
        lagging(*values), LIMITS, CHAIN, [(readings, weights, commands)], free=[], lags=[], iterations=5
    )
    assert left == pytest.approx((errors**2).sum(), rel=1e-9) and counted == 120


def test_errors_to_the_first_order_are_those_of_plain_differences():
    records, values = [flown(1), flown(2)], (-1.2, 1.9, 0.1)
    gram = _core.linearised(lagging(*values), LIMITS, CHAIN, records, free=[0, 1], lags=[[0]])
    left = residuals(values, records)
    slopes = [
        (residuals(np.array(values) + step, records) - left) / step.sum() for step in np.diag([1e-6] * 3)
    ]
    for columns in ([], [1], [0, 2], [0, 1, 2]):
        chosen = np.array([slopes[j] for j in columns]).reshape(-1, len(left)).T
        expected, *_ = np.linalg.lstsq(chosen, -left, rcond=None)
        step, _, chi_squared = gram.solve(columns)
        np.testing.assert_allclose(step, expected, rtol=1e-3)
        assert chi_squared == pytest.approx(np.square(left + chosen @ expected).sum(), rel=1e-5)
    assert gram.features == 3 and gram.readings == 242
    assert _core.linearised(lagging(40.0, 2.0, 0.1), LIMITS, CHAIN, records, free=[0], lags=[]) is None


def test_a_gust_that_is_predicted_is_that_of_a_kalman_filter():
    """speed' = u + g under a gust g that lasts: state and gust are filtered together."""
    signals = _core.Signals(DT, [5.0], [(-3.0, 3.0)], [1.0], [None])
    program = _core.Program.parse(program_text(2, 1, 3, [["r2 = r1 * 1.0"]]))
    model = _core.Model(program, "acceleration", signals)
    size, time, random = 0.8, 0.5, np.random.default_rng(0)
    kept, commands = float(np.exp(-DT / time)), np.sin(0.2 * np.arange(120))[:, np.newaxis]
    gust, speed, readings = [size * random.standard_normal()], 0.0, []
    for u in [*commands[:, 0], 0.0]:
        readings.append([speed + np.sqrt(SENSOR) * random.standard_normal()])
        speed += DT * (u + gust[-1])
        gust.append(kept * gust[-1] + np.sqrt(1.0 - kept * kept) * size * random.standard_normal())
    readings = np.array(readings)
    chain = [([0], [SENSOR], (1e-12, size * size, time), "acceleration")]
    [(_, states, gusts)] = _core.predictions(model, LIMITS, chain, [(readings, np.ones((121, 1)), commands)])
    moves, believed = np.array([[1.0, DT], [0.0, kept]]), []
    mean, covariance = np.array([readings[0, 0], 0.0]), np.diag([np.abs(readings).max() ** 2, size * size])
    for k in range(121):
        gain = covariance[:, 0] / (covariance[0, 0] + SENSOR)
        mean = mean + gain * (readings[k, 0] - mean[0])
        covariance = covariance - np.outer(gain, covariance[0])
        believed.append(mean)
        if k < 120:
            mean = moves @ mean + [DT * commands[k, 0], 0.0]
            covariance = moves @ covariance @ moves.T + np.diag([1e-12 * DT, (1.0 - kept**2) * size**2])
    np.testing.assert_allclose(np.column_stack([states, gusts]), believed, rtol=1e-6, atol=1e-9)
    assert np.corrcoef(gusts[:, 0], gust[:121])[0, 1] > 0.5


def test_only_what_is_free_moves_and_the_rest_stays_to_the_bit():
    start = (-0.8, 2.0, 0.12)
    tuned, left, *_ = _core.tune(lagging(*start), LIMITS, CHAIN, [flown(1)], free=[0], lags=[], iterations=30)
    assert tuned.constants[1] == 2.0 and tuned.actuators == [(0.12, 0, 0.0, 0.0)]
    assert tuned.constants[0] == pytest.approx(-1.3, rel=0.05)
    assert left < (residuals(start, [flown(1)]) ** 2).sum()
    same, *_ = _core.tune(lagging(*start), LIMITS, CHAIN, [flown(1)], free=[0, 1], lags=[[0]], iterations=0)
    assert same.constants.tolist() == [-0.8, 2.0]


def test_a_model_that_diverges_is_told_as_such():
    wild = lagging(40.0, 2.0, 0.1)
    _, left, _, covariance, members = _core.tune(
        wild, LIMITS, CHAIN, [flown(1)], free=[0, 1], lags=[[0]], iterations=5, draws=2, unit=UNIT
    )
    assert left == np.inf and covariance.size == 0
    assert [member.constants.tolist() for member in members] == [[40.0, 2.0]] * 2
    assert _core.predictions(wild, LIMITS, CHAIN, [flown(1)]) is None


def test_tuning_gives_the_same_bits_for_any_workers():
    def bits(workers):
        model, left, _, covariance, members = _core.tune(
            lagging(-0.8, 1.5, 0.2), LIMITS, CHAIN, [flown(1), flown(2)],
            free=[0, 1], lags=[[0]], iterations=6, draws=3,
            unit=UNIT, workers=workers,
        )  # fmt: skip
        return [*model.constants, left, *covariance.ravel(), *(c for m in members for c in m.constants)]

    expected = bits(_core.Workers())
    for workers in [_core.Workers(threads=2), *(_core.Workers(width=w) for w in _core.vector_widths())]:
        assert same_bits(bits(workers), expected)


@pytest.mark.parametrize(
    "wrong",
    [
        {"chains": [([0], [0.0], QUIET, "acceleration")]},
        {"chains": [([1], [1.0], QUIET, "acceleration")]},
        {"chains": []},
        {"chains": [([0], [1.0, 1.0], QUIET, "acceleration")]},
        {"free": [2]},
        {"lags": [[1]]},
        {"records": [(np.zeros((4, 1)), np.zeros((4, 1)), np.zeros((4, 1)))]},
    ],
)
def test_parts_that_do_not_fit_the_model_are_refused(wrong):
    given = {"chains": CHAIN, "records": [flown(1)], "free": [0], "lags": [], **wrong}
    with pytest.raises(ValueError, match="expected"):
        _core.tune(lagging(-1.0, 1.0, 0.1), LIMITS, iterations=1, **given)


def test_the_time_of_a_hidden_state_is_tuned_with_the_constants():
    truth = (-1.3, 2.0, -0.8, 0.6)
    signals = _core.Signals(DT, [5.0], [(-3.0, 3.0)], [1.0], [None])

    def model(a, b, c, time):
        lines = ["r3 = r0 * " + repr(a), "r4 = r1 * " + repr(b), "r3 = r3 + r4", "r4 = r2 * " + repr(c)]
        text = program_text(3, 1, 5, [[*lines, "r3 = r3 + r4"]])
        hidden = [([0], True, 0.0, time, [], False, 0.0, 0.0, 0.0)]
        return _core.Model(_core.Program.parse(text), "acceleration", signals, [(0.0, 0, None, 0.0)], hidden)

    stream, records, steps = np.random.default_rng(5), [], 160
    for _ in range(2):
        commands = np.repeat(stream.uniform(-2.0, 2.0, (steps // 10, 1)), 10, axis=0)
        inputs = _core.command_effects(
            [(0.0, 0, None, 0.0)], [([0], True, 0.0, truth[3], [], False, 0.0, 0.0, 0.0)], [1.0], DT, commands
        )
        states = [np.array([0.5])]
        for k in range(steps):
            stages = iter([inputs[0][k], inputs[1][k], inputs[1][k], inputs[2][k]])

            def slope(x, stages=stages):
                return np.array([np.dot(truth[:3], [x[0], *next(stages)])])

            states.append(rk4(slope, states[-1], DT))
        readings = np.array(states) + np.sqrt(SENSOR) * stream.normal(size=(steps + 1, 1))
        records.append((readings, np.ones_like(readings), commands))
    tuned, left, readings, covariance, members = _core.tune(
        model(-0.9, 1.5, -0.4, 0.3),
        LIMITS,
        CHAIN,
        records,
        free=[0, 1, 2],
        lags=[[1]],
        iterations=30,
        draws=300,
        unit=UNIT,
    )
    found = np.array([*tuned.constants, tuned.hidden[0][3]])
    np.testing.assert_allclose(found, truth, rtol=0.03)
    assert left == pytest.approx(readings, rel=0.2)
    assert (np.abs(found - truth) < 4.0 * np.sqrt(np.diag(covariance))).all()
    drawn = np.array([[*member.constants, member.hidden[0][3]] for member in members])
    np.testing.assert_allclose(drawn.std(axis=0), np.sqrt(np.diag(covariance)), rtol=0.2)
