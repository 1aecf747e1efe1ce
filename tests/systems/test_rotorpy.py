"""The third-party vehicle: its physics untouched, its attitude read rightly, its task a task."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import twinloop as tl
from oracles import Pid, same_bits
from twinloop.contracts import check_controller, check_system
from twinloop.systems.rotorpy import _euler_angles, _quaternion

VEHICLES = ["hummingbird", "crazyflie"]
INSTALL = 'needs the simulator: pip install --no-deps "rotorpy>=3,<4"'


@pytest.fixture(params=VEHICLES)
def system(request):
    pytest.importorskip("rotorpy", reason=INSTALL)
    return tl.systems.RotorPy(request.param)


def first_test(system, steps=100, **changes):
    family = system.controller.bind(system.signals)
    genes = family.genes(changes.pop("gains", system.default_gains))
    return tl.Test(family, genes, changes.pop("initial", system.initial_state), system.target_state, steps)


def test_attitudes_are_those_of_scipy():
    for angles in np.random.default_rng(0).uniform(-1.4, 1.4, (50, 3)):
        turned = Rotation.from_euler("ZYX", angles[::-1])
        np.testing.assert_allclose(Rotation.from_quat(_quaternion(*angles)).as_matrix(), turned.as_matrix())
        np.testing.assert_allclose(_euler_angles(*turned.as_quat()), angles, atol=1e-12)


def test_it_keeps_to_the_contracts(system):
    check_system(system, steps=5)
    check_controller(system.controller, system.signals)


def test_the_first_controller_flies_and_has_far_to_go(system):
    test = first_test(system)
    flight = system.run(test)
    assert flight.ended == "completed" and flight.states.shape == (101, 6)
    left = np.abs(flight.states[-1, :3] - system.target_state[:3])
    assert 0.01 < left.max() < 0.3
    limits = np.array([state.envelope[1] for state in system.signals.states])
    assert (np.abs(flight.states) < limits).all()


def test_a_flight_is_what_the_vehicles_own_equations_integrate(system):
    """The vehicle's slope under a tight integrator; ours takes fewer steps and no shortcuts."""
    test = first_test(system, 20)
    flight = system.run(test)
    vehicle = system._multirotor
    hover = system.signals.commands[0].size
    x = np.concatenate([np.zeros(6), [0.0, 0.0, 0.0, 1.0], np.zeros(6), np.full(4, hover)])
    for command, after in zip(flight.commands, flight.states[1:], strict=True):
        x = solve_ivp(
            lambda t, x, u=command: vehicle._s_dot_fn(t, x, u), (0.0, 0.02), x, rtol=1e-8, atol=1e-10
        ).y[:, -1]
        np.testing.assert_allclose(after[:3], _euler_angles(*(x[6:10] / np.linalg.norm(x[6:10]))), atol=2e-4)
        np.testing.assert_allclose(after[3:], x[10:13], atol=2e-3)


def test_at_hover_thrust_it_stays_where_it_is(system):
    family = system.controller.bind(system.signals)
    task = tl.Test(family, family.genes(system.default_gains), np.zeros(6), np.zeros(6), 10)
    np.testing.assert_allclose(system.run(task).states, 0.0, atol=1e-9)


def test_the_noisy_state_is_read_and_recorded_and_the_true_one_kept():
    pytest.importorskip("rotorpy", reason=INSTALL)
    system = tl.systems.RotorPy("crazyflie", noise=2e-3, seed=1)
    test = first_test(system, 10)
    one, two = system.run(test), system.run(test)
    assert not same_bits(one.states, one.true_states) and not same_bits(one.states, two.states)
    assert same_bits(tl.systems.RotorPy("crazyflie", noise=2e-3, seed=1).run(test).states, one.states)
    own, bounds = system.controller.output, [command.bounds for command in system.signals.commands]
    plain = Pid([(0, 3), (1, 4), (2, 5)], test.genes, 0.02, own.matrix, own.offset, 0.5, bounds)
    commands = [plain.command(reading, test.target_state) for reading in one.states[:-1]]
    np.testing.assert_allclose(one.commands, commands, rtol=1e-11)


def test_a_tumble_ends_the_run_and_says_so():
    pytest.importorskip("rotorpy", reason=INSTALL)
    system = tl.systems.RotorPy("crazyflie")
    start = np.array([math.radians(70.0), 0.0, 0.0, 8.0, 0.0, 0.0])
    flight = system.run(first_test(system, 50, initial=start))
    assert flight.ended == "diverged" and "tumbled" in flight.reason
    assert np.isfinite(flight.states).all() and flight.steps < 50


def test_an_unknown_vehicle_is_refused():
    with pytest.raises(tl.InvalidInput, match="did you mean 'crazyflie'"):
        tl.systems.RotorPy("crazyfly")


def test_without_the_simulator_it_says_what_to_install(monkeypatch):
    def absent(name):
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr("importlib.import_module", absent)
    with pytest.raises(tl.NotAvailable, match="pip install --no-deps"):
        tl.systems.RotorPy()
