"""The paper's plant, against scipy's integrator and the numbers of the specification."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import twinloop as tl
from oracles import Pid, quadrotor_derivative, same_bits
from twinloop.contracts import check_system
from twinloop.law.flight import fly
from twinloop.objectives import frozen_error
from twinloop.systems.gusts import as_disturbance, gust_accelerations
from twinloop.systems.sensors import run_stream
from twinloop.test import final_distance

SIGN = {"physical": 1.0, "print": -1.0}
INERTIA = (7.5e-3, 7.5e-3, 1.3e-2)
UNEQUAL = (7.0e-3, 8.5e-3, 1.3e-2)

states = st.tuples(*[st.floats(-1.0, 1.0)] * 3, *[st.floats(-5.0, 5.0)] * 3)
speeds = st.tuples(*[st.floats(0.0, 300.0)] * 4)


@given(states, speeds, st.sampled_from(["physical", "print"]), st.sampled_from([INERTIA, UNEQUAL]))
def test_the_derivative_is_that_of_the_equations(state, speeds, gyroscopic, inertia):
    plant = tl.systems.Quadrotor(gyroscopic=gyroscopic, inertia=inertia).dynamics
    expected = quadrotor_derivative(state, speeds, SIGN[gyroscopic], inertia)
    np.testing.assert_allclose(plant.derivative(state, speeds), expected, rtol=1e-10, atol=1e-10)


@given(states, speeds, st.sampled_from(["physical", "print"]), st.sampled_from([INERTIA, UNEQUAL]))
def test_a_period_is_what_scipy_integrates_under_the_held_command(state, speeds, gyroscopic, inertia):
    plant = tl.systems.Quadrotor(gyroscopic=gyroscopic, inertia=inertia).dynamics
    exact = solve_ivp(
        lambda _, x: quadrotor_derivative(x, speeds, SIGN[gyroscopic], inertia),
        (0.0, 0.02), state, rtol=1e-10, atol=1e-12,
    ).y[:, -1]  # fmt: skip
    np.testing.assert_allclose(plant.step([state], [speeds])[0], exact, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("gyroscopic", ["physical", "print"])
def test_a_whole_flight_is_what_scipy_integrates(quadrotor_family, first_test, gyroscopic):
    flight = tl.systems.Quadrotor(gyroscopic=gyroscopic).run(first_test)
    state = np.zeros(6)
    for speeds, after in zip(flight.commands, flight.states[1:], strict=True):
        state = solve_ivp(
            lambda _, x, w=speeds: quadrotor_derivative(x, w, SIGN[gyroscopic]),
            (0.0, 0.02), state, rtol=1e-10, atol=1e-12,
        ).y[:, -1]  # fmt: skip
        np.testing.assert_allclose(after, state, rtol=0.0, atol=1e-6)


def test_the_two_signs_differ_in_roll_and_agree_in_pitch():
    state, spinning = [0.0, 0.0, 0.0, 1.0, 1.0, 0.0], [100.0, 200.0, 100.0, 200.0]
    physical = tl.systems.Quadrotor(gyroscopic="physical").dynamics.derivative(state, spinning)
    printed = tl.systems.Quadrotor(gyroscopic="print").dynamics.derivative(state, spinning)
    term = 6e-5 * 200.0 / 7.5e-3
    assert physical[3] - printed[3] == pytest.approx(2.0 * term)
    assert physical[4] == printed[4]


def test_rotors_of_the_physical_plant_do_no_work():
    """The gyroscopic torques turn the axis and leave the energy as it is; the printed signs do not."""
    state, spinning = np.array([0.0, 0.0, 0.0, 2.0, -3.0, 1.0]), [150.0, 200.0, 150.0, 200.0]

    def power(gyroscopic):
        plant = tl.systems.Quadrotor(gyroscopic=gyroscopic, inertia=UNEQUAL).dynamics
        slope = plant.derivative(state, spinning)
        yaw_torque = 7.5e-7 * (2 * 200.0**2 - 2 * 150.0**2)
        return float(np.array(UNEQUAL) * state[3:] @ slope[3:] - yaw_torque * state[5])

    assert abs(power("physical")) < 1e-12
    assert abs(power("print")) > 1e-3


@pytest.mark.parametrize(
    ("gyroscopic", "delta", "frozen"), [("physical", 0.2013, 0.294), ("print", 0.2008, 0.296)]
)
def test_the_first_flight_ends_where_the_specification_says(first_test, gyroscopic, delta, frozen):
    flight = tl.systems.Quadrotor(gyroscopic=gyroscopic).run(first_test)
    assert flight.steps == 100 and flight.states.shape == (101, 6) and flight.ended == "completed"
    assert round(final_distance(flight.states[-1], first_test.target_state), 4) == delta
    assert round(frozen_error(flight), 3) == frozen


@pytest.mark.parametrize(("frequency", "delta", "frozen"), [(1.8, 0.27, 0.268), (2.2, 0.15, 0.318)])
def test_the_studys_first_controllers_span_what_the_specification_says(
    quadrotor_family, first_test, frequency, delta, frozen
):
    system = tl.systems.Quadrotor(natural_frequency=frequency)
    genes = quadrotor_family.genes(system.default_gains)
    test = tl.Test(quadrotor_family, genes, first_test.initial_state, first_test.target_state, 100)
    flight = system.run(test)
    assert round(final_distance(flight.states[-1], test.target_state), 2) == delta
    assert round(frozen_error(flight), 3) == frozen


def test_doing_nothing_ends_at_the_distance_of_the_task(first_test):
    distance = final_distance(first_test.initial_state, first_test.target_state)
    assert round(distance, 3) == 1.429


def test_the_target_is_the_papers(quadrotor):
    np.testing.assert_allclose(np.rad2deg(quadrotor.target_state), [-30, 30, -70, 0, 0, 0], atol=1e-12)
    assert quadrotor.duration == 2.0 and quadrotor.signals.dt == 0.02


def test_the_hover_speed_carries_the_weight(quadrotor):
    assert round(quadrotor.hover_speed, 2) == 225.68
    assert all(command.size == quadrotor.hover_speed for command in quadrotor.signals.commands)
    assert all(command.bounds == (0.0, 300.0) for command in quadrotor.signals.commands)


def test_envelopes_are_those_of_the_specification(quadrotor):
    envelopes = [state.envelope[1] for state in quadrotor.signals.states]
    np.testing.assert_allclose(envelopes, [*np.deg2rad([60.0, 60.0, 180.0]), 5.0, 5.0, 5.0])
    assert all(state.envelope[0] == -state.envelope[1] for state in quadrotor.signals.states)
    assert [state.scale for state in quadrotor.signals.states] == [math.pi] * 3 + [10.0] * 3


def test_random_gains_leave_the_envelope_in_about_a_fifth_of_the_runs(quadrotor, first_test):
    family = first_test.family
    limits = np.array([state.envelope[1] for state in quadrotor.signals.states])
    high = np.array([gain.high for gain in family.gains])
    left = 0
    for genes in np.random.default_rng(0).random((300, 9)) * high:
        test = tl.Test(family, genes, first_test.initial_state, first_test.target_state, 100)
        left += bool((np.abs(quadrotor.run(test).states) > limits).any())
    assert 0.1 < left / 300 < 0.3


# Noise


def test_the_noisy_state_is_read_and_recorded_and_the_true_one_kept(first_test):
    system = tl.systems.Quadrotor(noise=2e-3, seed=1)
    flight = system.run(first_test)
    own = system.controller.output
    plain = Pid(
        [(0, 3), (1, 4), (2, 5)], first_test.genes, 0.02, own.matrix, own.offset, 0.5, [(0.0, 300.0)] * 4
    )
    commands = [plain.command(reading, first_test.target_state) for reading in flight.states[:-1]]
    np.testing.assert_allclose(flight.commands, commands, rtol=1e-13)
    following = system.dynamics.step(flight.true_states[:-1], flight.commands)
    assert same_bits(following, flight.true_states[1:])
    assert not same_bits(flight.states, flight.true_states)


def test_the_noise_is_five_times_as_large_on_rates(first_test):
    system = tl.systems.Quadrotor(noise=2e-3)
    added = np.concatenate([(f := system.run(first_test)).states - f.true_states for _ in range(20)])
    np.testing.assert_allclose(added.std(axis=0), [2e-3] * 3 + [1e-2] * 3, rtol=0.08)
    np.testing.assert_allclose(added.mean(axis=0), 0.0, atol=1e-3)


def test_every_run_has_its_own_noise_and_a_seed_repeats_them_all(first_test):
    def three(seed):
        system = tl.systems.Quadrotor(noise=1e-3, seed=seed)
        return [system.run(first_test).states for _ in range(3)]

    once, again, other = three(4), three(4), three(5)
    assert all(same_bits(a, b) for a, b in zip(once, again, strict=True))
    assert not same_bits(once[0], once[1]) and not same_bits(once[0], other[0])


def test_without_noise_the_true_states_are_the_recorded_ones(quadrotor, first_test):
    flight = quadrotor.run(first_test)
    assert same_bits(flight.states, flight.true_states)
    assert same_bits(quadrotor.run(first_test).states, flight.states)


def test_a_gust_moves_the_true_state(quadrotor, first_test):
    gusts = np.zeros((100, 6))
    gusts[60] = [0.1, 0.0, 0.0, 0.0, -1.0, 0.0]
    calm, gusty = fly(quadrotor.dynamics, first_test), fly(quadrotor.dynamics, first_test, disturbance=gusts)
    assert same_bits(calm.states[:61], gusty.states[:61])
    assert same_bits(gusty.true_states[61], calm.states[61] + gusts[60])
    assert not same_bits(calm.commands[61], gusty.commands[61])


# Rough air, slow motors


def lagging(x, speeds, drag, motor_lag):
    """Slope of the six states and the four rotor speeds."""
    slope = quadrotor_derivative(x[:6], x[6:])
    slope[3:] -= np.asarray(drag) * np.abs(x[3:6]) * x[3:6] / INERTIA
    return np.concatenate([slope, (speeds - x[6:]) / motor_lag])


@pytest.mark.parametrize(("drag", "motor_lag"), [(0.05, 0.03), ((0.01, 0.02, 0.03), 0.1), (0.0, 0.05)])
def test_a_flight_with_drag_and_lag_is_what_scipy_integrates(first_test, drag, motor_lag):
    system = tl.systems.Quadrotor(drag=drag, motor_lag=motor_lag)
    flight = system.run(first_test)
    x = np.concatenate([np.zeros(6), np.full(4, system.hover_speed)])
    for speeds, after in zip(flight.commands, flight.states[1:], strict=True):
        x = solve_ivp(
            lambda _, x, w=speeds: lagging(x, w, drag, motor_lag),
            (0.0, 0.02), x, rtol=1e-10, atol=1e-12,
        ).y[:, -1]  # fmt: skip
        np.testing.assert_allclose(after, x[:6], rtol=0.0, atol=1e-4)


@given(states, speeds)
def test_drag_alone_brakes_each_rate_by_its_square(state, speeds):
    drag = np.array([0.01, 0.02, 0.03])
    plant = tl.systems.Quadrotor(drag=drag.tolist()).dynamics
    expected = quadrotor_derivative(state, speeds)
    expected[3:] -= drag * np.abs(state[3:]) * state[3:] / INERTIA
    np.testing.assert_allclose(plant.derivative(state, speeds), expected, rtol=1e-10, atol=1e-10)


def test_a_lag_that_is_nearly_none_is_none(quadrotor, first_test):
    quick = tl.systems.Quadrotor(motor_lag=1e-5).run(first_test)
    np.testing.assert_allclose(quick.states, quadrotor.run(first_test).states, atol=0.02)
    slow = tl.systems.Quadrotor(motor_lag=0.03).run(first_test)
    assert np.abs(slow.states - quadrotor.run(first_test).states).max() > 0.02


def test_every_flight_starts_with_its_rotors_at_hover(first_test):
    system = tl.systems.Quadrotor(motor_lag=0.1)
    assert same_bits(system.run(first_test).states, system.run(first_test).states)


def test_gusts_are_what_an_ornstein_uhlenbeck_process_is():
    draws = gust_accelerations(np.random.default_rng(0), 200_000, 0.5, 0.02)
    np.testing.assert_allclose(draws.std(axis=0), 0.5, rtol=0.03)
    for lag in (1, 10, 20):
        correlation = (draws[lag:] * draws[:-lag]).mean(axis=0) / 0.25
        np.testing.assert_allclose(correlation, np.exp(-lag * 0.02 / 0.2), atol=0.04)
    first = [gust_accelerations(np.random.default_rng(i), 1, 0.5, 0.02)[0, 0] for i in range(2000)]
    assert np.std(first) == pytest.approx(0.5, rel=0.05)


def test_a_gust_moves_rates_and_angles_as_a_held_acceleration_does():
    added = as_disturbance(np.array([[1.0, 2.0, -3.0]]), 0.02)
    np.testing.assert_allclose(added, [[2e-4, 4e-4, -6e-4, 0.02, 0.04, -0.06]], rtol=1e-14)


def test_gusts_are_added_to_the_true_states(first_test):
    system = tl.systems.Quadrotor(gusts=0.5, seed=3)
    flight = system.run(first_test)
    still = system.dynamics.step(flight.true_states[:-1], flight.commands)
    expected = as_disturbance(gust_accelerations(run_stream(3, 0, 1), 100, 0.5, 0.02), 0.02)
    np.testing.assert_allclose(flight.true_states[1:] - still, expected, atol=1e-13)


def test_gusts_leave_the_sensors_noise_as_it_is(first_test):
    def noise(gusts):
        flight = tl.systems.Quadrotor(noise=1e-3, seed=2, gusts=gusts).run(first_test)
        return flight.states - flight.true_states

    np.testing.assert_allclose(noise(0.0), noise(0.5), atol=1e-13)


def test_the_harsh_quadrotor_flies_and_keeps_to_the_contract(first_test):
    system = tl.systems.Quadrotor.harsh(noise=2e-3, seed=5)
    assert system.drag.tolist() == [0.05] * 3 and (system.motor_lag, system.gusts) == (0.03, 0.5)
    check_system(system)
    flight = system.run(first_test)
    again = tl.systems.Quadrotor.harsh(noise=2e-3, seed=5)
    again.run(first_test), again.run(first_test)
    assert flight.ended == "completed" and same_bits(again.run(first_test).states, flight.states)


@pytest.mark.parametrize("name", ["drag", "motor_lag", "gusts", "noise", "rotor_inertia"])
def test_what_cannot_be_negative_is_refused(name):
    with pytest.raises(tl.InvalidInput, match=rf"{name}.*expected at least 0"):
        tl.systems.Quadrotor(**{name: -1e-3})


def test_drag_is_one_number_or_three():
    with pytest.raises(tl.InvalidInput, match=r"drag.*expected the shape \(3,\)"):
        tl.systems.Quadrotor(drag=[0.1, 0.2])
    with pytest.raises(tl.InvalidInput, match="drag"):
        tl.systems.Quadrotor(drag="much")
