"""Gains from a model: the Riccati equation against scipy, the regulator against scipy and in flight."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

import twinloop as tl
from conftest import pendulum_step
from twinloop.controllers import Mixer, StateFeedback, lqr_gains
from twinloop.controllers.riccati import solve_linear, solve_riccati

WIDE = (-1e6, 1e6)


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 4), st.floats(0.2, 1.5))
def test_the_equation_is_solved_as_scipy_solves_it(seed, n, m, radius):
    stream = np.random.default_rng(seed)
    a = stream.normal(size=(n, n))
    a *= radius / np.abs(np.linalg.eigvals(a)).max()
    b = stream.normal(size=(n, m))
    root_q, root_r = stream.normal(size=(n, n)), stream.normal(size=(m, m))
    q, r = root_q @ root_q.T + 0.01 * np.eye(n), root_r @ root_r.T + 0.01 * np.eye(m)
    expected = solve_discrete_are(a, b, q, r)
    assume(np.abs(expected).max() < 1e5 * np.abs(q).max())  # beyond it, scipy itself warns of its accuracy
    found = solve_riccati(a, b, q, r)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())


@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_linear_systems_are_solved(seed, n):
    stream = np.random.default_rng(seed)
    matrix, right = stream.normal(size=(n, n)), stream.normal(size=(n, 3))
    assume(np.linalg.cond(matrix) < 1e6)
    np.testing.assert_allclose(
        solve_linear(matrix, right), np.linalg.solve(matrix, right), rtol=1e-7, atol=1e-7
    )
    assert solve_linear(np.zeros((n, n)), right) is None


UNSTABILISABLE = {
    "unstable, out of reach": ([[1.5]], [[0.0]]),
    "drifting, out of reach": ([[1.0]], [[0.0]]),
    "a double integrator out of reach": ([[1.0, 0.1], [0.0, 1.0]], [[0.0], [0.0]]),
    "one of two out of reach": ([[0.5, 0.0], [0.0, 1.2]], [[1.0], [0.0]]),
}


@pytest.mark.parametrize("case", UNSTABILISABLE)
def test_what_no_feedback_stabilises_has_no_solution(case):
    a, b = (np.array(matrix) for matrix in UNSTABILISABLE[case])
    assert solve_riccati(a, b, np.eye(len(a)), np.eye(1)) is None


def test_the_gains_of_a_linear_plant_are_scipys(pendulum_signals):
    a, b = np.array([[1.0, 0.05], [0.1, 0.98]]), np.array([[0.01], [0.4]])
    family = StateFeedback(None, WIDE).bind(pendulum_signals)
    found = lqr_gains(lambda x, u: a @ x + b @ u, family, [0.3, 0.0])
    q, r = np.diag([1 / np.pi**2, 1 / 64.0]), np.array([[1 / 4.0]])
    x = solve_discrete_are(a, b, q, r)
    expected = np.linalg.solve(r + b.T @ x @ b, b.T @ x @ a)[0]
    np.testing.assert_allclose([found["angle->torque"], found["rate->torque"]], expected, rtol=1e-7)


def test_weights_and_integrals_reach_the_equation(pendulum_signals):
    a, b, dt = np.array([[1.0, 0.05], [0.1, 0.98]]), np.array([[0.01], [0.4]]), 0.05
    family = StateFeedback(None, WIDE, integral=["angle"]).bind(pendulum_signals)
    weights = {"angle": 3.0, "rate": 0.0, "angle.integral": 0.7}
    found = lqr_gains(lambda x, u: a @ x + b @ u, family, [0.0, 0.0], weights, {"torque": 0.2})
    # The integral counts the coming error: I' = I + dt e'.
    c = np.array([[dt, 0.0]])
    a3 = np.block([[a, np.zeros((2, 1))], [c @ a, np.eye(1)]])
    b3 = np.vstack([b, c @ b])
    x = solve_discrete_are(a3, b3, np.diag([3.0, 0.0, 0.7]), np.array([[0.2]]))
    expected = np.linalg.solve(0.2 + b3.T @ x @ b3, b3.T @ x @ a3)[0]
    np.testing.assert_allclose(list(found.values()), expected, rtol=1e-6)


@pytest.mark.parametrize(
    "factors", [(2.0**40, 1.0, 1.0), (1.0, 2.0**-30, 2.0**20), (2.0**-50, 2.0**45, 2.0**30)]
)
def test_a_power_of_two_in_the_units_of_a_state_or_command_changes_no_bit(factors):
    angle, rate, torque = factors
    a, b = np.array([[1.0, 0.05], [0.1, 0.98]]), np.array([[0.01], [0.4]])

    def gains(angle, rate, torque):
        states, command = np.array([angle, rate]), np.array([torque])
        signals = tl.Signals(
            [tl.State("angle", "", np.pi * angle), tl.State("rate", "", 8.0 * rate)],
            [tl.Command("torque", "", (-2.0 * torque, 2.0 * torque))],
            dt=0.05,
        )
        family = StateFeedback(None, (-1e30, 1e30), integral=["angle"]).bind(signals)
        found = lqr_gains(
            lambda x, u: (a @ (x / states) + b @ (u / command)) * states, family, [0.25 * angle, 0.0]
        )
        return [found[f"{name}->torque"] for name in ("angle", "rate", "angle.integral")]

    expected = np.array(gains(1.0, 1.0, 1.0)) * torque / np.array([angle, rate, angle])
    assert gains(angle, rate, torque) == expected.tolist()


def test_an_integrals_default_weight_is_that_of_an_error_for_a_second(pendulum_signals):
    family = StateFeedback(None, WIDE, integral=["angle"]).bind(pendulum_signals)
    a_second = {"angle.integral": 1.0 / np.pi**2}  # the angle's scale is π
    assert lqr_gains(pendulum_step, family, [0.0, 0.0]) == lqr_gains(
        pendulum_step, family, [0.0, 0.0], a_second
    )


def test_a_mixers_slope_at_rest_stands_between_output_and_command(pendulum_signals):
    """Through command = √(u + 1.44), a gain must undo the slope 1 / 2.4 at the rest of 1.2."""
    a, b = np.array([[1.0, 0.05], [0.1, 0.98]]), np.array([[0.01], [0.4]])

    def step(x, u):
        return a @ x + b @ u

    direct = StateFeedback(None, WIDE).bind(pendulum_signals)
    mixed = StateFeedback(None, WIDE, Mixer([[1.0]], [1.44], power=0.5)).bind(pendulum_signals)
    plain, through = lqr_gains(step, direct, [0.0, 0.0]), lqr_gains(step, mixed, [0.0, 0.0])
    np.testing.assert_allclose(list(through.values()), 2.4 * np.array(list(plain.values())), rtol=1e-6)


def test_a_quadrotor_comes_to_its_target_sooner_than_with_the_first_controller(quadrotor, first_test):
    output = quadrotor.controller.output
    family = StateFeedback(None, (-1.0, 1.0), output).bind(quadrotor.signals)
    gains = lqr_gains(quadrotor.dynamics, family, quadrotor.target_state, {"yaw": 1.0})
    test = tl.Test(family, family.genes(gains), np.zeros(6), quadrotor.target_state, 100)
    target = quadrotor.target_state

    def absolute_error(flight):
        return float(np.abs(flight.states[:, :3] - target[:3]).sum())

    assert absolute_error(quadrotor.run(test)) < 0.7 * absolute_error(quadrotor.run(first_test))


def test_gains_are_clipped_to_the_familys_bounds(quadrotor):
    output = quadrotor.controller.output
    family = StateFeedback(None, (0.0, 0.01), output).bind(quadrotor.signals)
    gains = lqr_gains(quadrotor.dynamics, family, quadrotor.target_state)
    assert gains["roll->u1"] == 0.01 and gains["roll->u2"] >= 0.0
    family.genes(gains)


def test_states_that_are_not_fed_back_are_left_out(pendulum_signals):
    family = StateFeedback(["rate"], WIDE).bind(pendulum_signals)
    gains = lqr_gains(lambda x, u: (0.0, 0.5 * x[1] + u[0]), family, [0.0, 0.0])
    x = solve_discrete_are([[0.5]], [[1.0]], [[1 / 64.0]], [[1 / 4.0]])
    np.testing.assert_allclose(gains["rate->torque"], 0.5 * x / (0.25 + x), rtol=1e-6)


NOT_THERE = {
    "a model that ignores its commands": (lambda x, u: (x[0] + 0.05 * x[1], x[1]), "no feedback stabilises"),
    "a model that runs away": (lambda x, u: (np.nan, x[1]), "diverges there at once"),
}


@pytest.mark.parametrize("case", NOT_THERE)
def test_gains_that_do_not_exist_are_said_not_to(pendulum_signals, case):
    step, sentence = NOT_THERE[case]
    family = StateFeedback(None, WIDE).bind(pendulum_signals)
    with pytest.raises(tl.NotAvailable, match=sentence):
        lqr_gains(step, family, [0.0, 0.0])


def test_an_output_that_is_clipped_at_rest_leads_nowhere(pendulum_signals):
    family = StateFeedback(None, WIDE, Mixer([[1.0]], [5.0])).bind(pendulum_signals)
    with pytest.raises(tl.NotAvailable, match="no feedback stabilises"):
        lqr_gains(lambda x, u: (x[0] + 0.05 * x[1], x[1] + u[0]), family, [0.0, 0.0])


def test_a_root_of_nothing_has_no_slope(pendulum_signals):
    family = StateFeedback(None, WIDE, Mixer([[1.0]], power=0.5)).bind(pendulum_signals)
    with pytest.raises(tl.NotAvailable, match="give the Mixer an offset"):
        lqr_gains(pendulum_step, family, [0.0, 0.0])


def test_what_cannot_be_asked_for_is_refused(pendulum_signals, quadrotor_family):
    family = StateFeedback(None, WIDE).bind(pendulum_signals)
    asked = {
        "family of a StateFeedback": lambda: lqr_gains(pendulum_step, quadrotor_family, np.zeros(6)),
        "a step function": lambda: lqr_gains(3, family, [0.0, 0.0]),
        "next states of 2 numbers": lambda: lqr_gains(lambda x, u: [1.0], family, [0.0, 0.0]),
        "did you mean 'angle'": lambda: lqr_gains(pendulum_step, family, [0.0, 0.0], {"angel": 1.0}),
        "expected at least 0": lambda: lqr_gains(pendulum_step, family, [0.0, 0.0], {"angle": -1.0}),
        "weights above 0": lambda: lqr_gains(pendulum_step, family, [0.0, 0.0], None, {"torque": 0.0}),
    }
    for sentence, call in asked.items():
        with pytest.raises(tl.InvalidInput, match=sentence):
            call()
