"""The zoo's plants against closed forms, balances and SciPy's integrator."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import twinloop as tl
from twinloop.contracts import check_controller, check_system
from twinloop_exam.zoo import (
    aircraft,
    arm,
    biology,
    body_delayed,
    body_drag,
    body_late,
    body_semi_implicit,
    end_stop,
    heater,
    motors,
    optima,
    reactors,
    rigid_body,
    tanks,
)
from twinloop_exam.zoo.halves import HALVES
from twinloop_exam.zoo.plants import PLANTS, plant

OTHERS = ("rotorpy-hummingbird", "rotorpy-crazyflie", "pendulum", "cart-pole", "double-pendulum")
"""Simulators by others: their packages are extras, and another version may round otherwise."""


def there(name):
    missing = plant(name).why_missing
    if missing is not None:
        pytest.skip(missing)
    return plant(name)


def test_the_halves_are_the_zoo_and_share_no_plant():
    tune, report = (set(HALVES[half]) for half in ("tune", "report"))
    assert not tune & report and tune | report == set(PLANTS)
    assert len(tune) == len(report) == 12


@pytest.mark.parametrize("name", PLANTS)
def test_a_log_of_a_first_flight_is_called_late_only_where_sensors_are(name):
    found = there(name)
    asked, system = found.asked, found.make(0)
    campaign = tl.Campaign(
        system.signals, controller=asked.controller, initial_state=asked.start, target_state=asked.target,
        duration=asked.duration, threads=1, progress=None,
    )  # fmt: skip
    test = campaign.test(asked.first)
    said = []
    for run in (system.run(test), found.truth.run(test)):
        said += tl.check_log(run.t, run.states, run.commands, system.signals).remarks
    lines = [one.sentence for one in said if one.code in ("late", "alike-commands", "fed-back")]
    assert all("ms later than p, q and r" in line for line in lines)
    assert bool(lines) == (name == "body-late")


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_keeps_to_the_contracts(name):
    found = there(name)
    asked = found.asked
    arguments = {
        "gains": asked.first,
        "initial_state": np.asarray(asked.start, dtype=float),
        "target_state": np.asarray(asked.target, dtype=float),
    }
    for system in (found.truth, found.make(3)):
        check_system(system, asked.controller, **arguments)
    check_controller(asked.controller, found.signals)


@pytest.mark.parametrize("name", PLANTS)
def test_the_first_controller_is_three_to_five_times_worse_than_the_optimum(name):
    found, kept = there(name), optima.kept()[name]
    rounding = 0.02 if name in OTHERS else 1e-6
    assert found.true_quality(kept["gains"]) == pytest.approx(kept["quality"], rel=rounding)
    assert found.true_quality(found.asked.first) == pytest.approx(kept["first"], rel=rounding)
    assert 3.0 <= kept["first"] / kept["quality"] <= 5.0
    assert len(kept["starts"]) > 2 and kept["flights"] >= 300 and min(kept["starts"]) >= kept["quality"]


@pytest.mark.parametrize("name", PLANTS)
def test_a_first_flight_can_be_asked_for_and_keeps_the_envelope(name):
    found = there(name)
    asked, system = found.asked, found.make(5)
    campaign = tl.Campaign(
        system.signals,
        controller=asked.controller,
        initial_state=asked.start,
        target_state=asked.target,
        duration=asked.duration,
        weights=dict(asked.weights) or None,
        threads=1,
    )
    test = campaign.test(asked.first)
    flight = system.run(test)
    campaign.tell(test, flight)
    assert campaign.experiments[0].kept_envelope
    assert campaign.experiments[0].quality == pytest.approx(
        found.quality_of_states(flight.states, test), rel=1e-12
    )


def held(machine, commands, start):
    """A run under commands that were held."""
    zero = tl.controllers.StateFeedback(None, gains=(-1.0, 1.0)).bind(machine.signals)
    offsets = np.asarray(commands) - 0.0
    test = tl.Test(
        zero, np.zeros(zero.size), np.asarray(start, float), np.zeros(len(start)), len(commands), offsets
    )
    return machine.run(test)


def drawn(signals, periods, seed=1, share=0.6):
    low, high = np.array([command.bounds for command in signals.commands]).T
    middle, half = (low + high) / 2.0, share * (high - low) / 2.0
    return middle + half * np.random.default_rng(seed).uniform(-1.0, 1.0, (periods, signals.n_u))


DERIVATIVES = {
    "body-late": rigid_body.free(body_late.INERTIA, body_late.torques),
    "body-drag": rigid_body.free(body_drag.INERTIA, body_drag.torques),
    "aircraft": aircraft.derivative,
    "arm": arm.derivative,
    "reactor-inhibited": reactors.inhibited,
    "reactor-catalyst": reactors.on_catalyst,
    "chemostat": biology.chemostat,
    "gene": biology.gene,
    "heater": heater.derivative,
    "motor-friction": motors.rubbing,
    "motor-backlash": motors.geared,
    "end-stop": end_stop.derivative,
}


@pytest.mark.parametrize("name", DERIVATIVES)
def test_a_plant_flies_as_scipy_integrates_it(name):
    machine, derivative = PLANTS[name].truth, DERIVATIVES[name]
    start = np.asarray(PLANTS[name].asked.start, dtype=float)
    run = held(machine, drawn(machine.signals, 25), start)
    z, dt = np.array(machine.mechanism.inner(start.tolist())), machine.signals.dt
    scales = np.array([state.scale for state in machine.signals.states])
    for k, command in enumerate(run.commands):
        z = solve_ivp(
            lambda _, y, u=command: derivative(y.tolist(), u.tolist()), (0.0, dt), z, rtol=1e-10, atol=1e-12,
            method="LSODA", max_step=dt / 20.0,
        ).y[:, -1]  # fmt: skip
        outer = np.array(machine.mechanism.outer(z.tolist()))
        np.testing.assert_allclose(run.true_states[k + 1] / scales, outer / scales, atol=2e-4)
    assert run.steps == 25


def test_angles_are_read_twelve_milliseconds_late():
    machine = body_late.PLANT.truth
    run = held(machine, drawn(machine.signals, 20), np.zeros(6))
    derivative = rigid_body.free(body_late.INERTIA, body_late.torques)
    z = np.zeros(6)
    for k, command in enumerate(run.commands):
        path = solve_ivp(
            lambda _, y, u=command: derivative(y.tolist(), u.tolist()),
            (0.0, 0.02),
            z,
            rtol=1e-10,
            atol=1e-12,
            dense_output=True,
        ).sol
        np.testing.assert_allclose(run.states[k + 1, :3], path(0.008)[:3], atol=1e-7)
        np.testing.assert_allclose(run.states[k + 1, 3:], path(0.02)[3:], atol=1e-7)
        z = path(0.02)


def test_torques_lag_and_come_two_periods_late():
    machine = body_delayed.PLANT.truth
    run = held(machine, np.tile([0.1, 0.0, 0.0], (6, 1)), np.zeros(6))
    assert not run.states[:3].any() and run.states[3, 3] > 0.0
    # J p' + d p = torque, torque = u (1 − exp(−t / lag)), two periods later.
    t, rate, lag = 4 * 0.02, body_delayed.DAMPING / body_delayed.INERTIA[0], body_delayed.LAG
    per = 0.1 / body_delayed.INERTIA[0]
    expected = per * (
        (1.0 - math.exp(-rate * t)) / rate - (math.exp(-t / lag) - math.exp(-rate * t)) / (rate - 1.0 / lag)
    )
    assert run.states[6, 3] == pytest.approx(expected, rel=1e-5)


def test_a_semi_implicit_step_turns_with_the_rates_at_its_end():
    machine = body_semi_implicit.PLANT.truth
    run = held(machine, drawn(machine.signals, 5), np.zeros(6))
    J, x = np.diag(body_semi_implicit.INERTIA), np.zeros(6)
    for command, state in zip(run.commands, run.states[1:], strict=True):
        w = x[3:]
        w = w + 0.025 * np.linalg.solve(J, command - body_semi_implicit.DAMPING * w - np.cross(w, J @ w))
        x = np.concatenate([x[:3] + 0.025 * np.array(rigid_body.turning(x[:3], w)), w])
        np.testing.assert_allclose(state, x, atol=1e-12)


def test_euler_angles_turn_as_rotations_do():
    angles, rates, h = np.array([0.4, -0.7, 1.1]), np.array([0.9, -1.3, 0.6]), 1e-6
    turned = Rotation.from_euler("ZYX", angles[::-1]) * Rotation.from_rotvec(h * rates)
    slope = (turned.as_euler("ZYX")[::-1] - angles) / h
    np.testing.assert_allclose(rigid_body.turning(angles, rates), slope, atol=1e-5)


def test_a_free_body_keeps_energy_and_momentum():
    J, w = np.array([0.02, 0.03, 0.05]), np.array([1.0, -2.0, 3.0])
    slope = np.array(rigid_body.spinning(J, w, [0.0, 0.0, 0.0]))
    assert (J * w) @ slope == pytest.approx(0.0, abs=1e-15)
    assert (J * J * w) @ slope == pytest.approx(0.0, abs=1e-15)


def test_the_arm_gains_the_energy_that_its_joints_are_given():
    stream = np.random.default_rng(0)
    for _ in range(20):
        z, u = stream.normal(size=4), stream.normal(size=2)
        slope, h = np.array(arm.derivative(z, u)), 1e-6
        gained = (arm.energy(z + h * slope) - arm.energy(z - h * slope)) / (2.0 * h)
        assert gained == pytest.approx(u @ z[2:] - np.array(arm.FRICTION) @ z[2:] ** 2, abs=1e-6)


def test_the_aircraft_is_trimmed_and_falls_without_air(monkeypatch):
    trimmed = aircraft.from_air_data(aircraft.TRIMMED)
    np.testing.assert_allclose(aircraft.derivative(trimmed, [0.0, aircraft.ELEVATOR]), 0.0, atol=1e-9)
    assert 0.0 < aircraft.ALPHA < 0.15 and 0.0 < aircraft.THRUST < 30.0
    np.testing.assert_allclose(aircraft.air_data(trimmed), aircraft.TRIMMED, atol=1e-14)
    monkeypatch.setattr(aircraft, "DENSITY", 0.0)
    monkeypatch.setattr(aircraft, "THRUST", 0.0)
    z = [0.3, -0.4, 0.8, -1.1, 0.7, 24.0, 2.0, 3.0]
    slope = aircraft.derivative(z, [0.1, 0.1])
    inertia = np.array(
        [[aircraft.JX, 0.0, -aircraft.JXZ], [0.0, aircraft.JY, 0.0], [-aircraft.JXZ, 0.0, aircraft.JZ]]
    )
    w, v, turning, rising = np.array(z[2:5]), np.array(z[5:]), np.array(slope[2:5]), np.array(slope[5:])
    np.testing.assert_allclose(inertia @ turning, -np.cross(w, inertia @ w), atol=1e-12)
    down = Rotation.from_euler("ZYX", [0.0, z[1], z[0]]).inv().apply([0.0, 0.0, aircraft.GRAVITY])
    np.testing.assert_allclose(rising + np.cross(w, v), down, atol=1e-12)


def test_what_goes_into_a_reactor_stays_or_comes_out():
    """Sums and differences that no reaction changes follow the flow alone: exponentials."""
    run = held(reactors.LANGMUIR.truth, np.tile([3.0, 1.0], (20, 1)), [0.5, 0.8])
    kept = np.exp(-reactors.FLOW * run.t)
    np.testing.assert_allclose(run.states[:, 0] - run.states[:, 1], 2.0 - 2.3 * kept, atol=1e-8)
    run = held(reactors.HALDANE.truth, np.full((20, 1), 4.0), [0.3, 1.0])
    kept = np.exp(-reactors.DILUTION * run.t)
    np.testing.assert_allclose(run.states.sum(axis=1), 4.0 - 2.7 * kept, atol=1e-8)
    run = held(biology.MONOD.truth, np.full((20, 1), 0.3), [4.0, 0.5])
    total, kept = run.states @ [1.0, biology.YIELD], np.exp(-0.3 * run.t)
    np.testing.assert_allclose(total, 5.0 + (4.25 - 5.0) * kept, atol=1e-8)


@pytest.mark.parametrize(
    "found", [reactors.HALDANE, reactors.LANGMUIR, biology.MONOD, biology.HILL, tanks.PLANT]
)
def test_a_plant_at_rest_stays_there(found):
    rest = found.asked.controller.output.offset
    start = np.asarray(found.asked.start, dtype=float)
    run = held(found.truth, np.tile(rest, (20, 1)), start)
    np.testing.assert_allclose(run.states, np.tile(start, (21, 1)), rtol=1e-9)


def test_a_gene_makes_half_as_much_at_its_threshold():
    made = biology.gene([0.0, biology.THRESHOLD], [1.0])[0]
    assert made == pytest.approx(biology.TRANSCRIPTION / 2.0)


def test_a_tank_empties_by_torricelli_after_three_samples():
    machine = tanks.PLANT.truth
    run = held(machine, np.zeros((30, 1)), [0.3, 0.0])
    speed = tanks.HOLES[0] * math.sqrt(2.0 * tanks.GRAVITY) / (2.0 * tanks.AREA)
    # For three samples the pump still gives what it gave at rest.
    begun = run.states[3, 0]
    expected = (math.sqrt(begun) - speed * (run.t[3:] - run.t[3])) ** 2
    np.testing.assert_allclose(run.states[3:, 0], expected, atol=1e-8)
    other = held(machine, np.full((30, 1), 9.0), [0.3, 0.0])
    assert (other.states[:4] == run.states[:4]).all() and other.states[4, 0] > run.states[4, 0]


def test_heat_is_kept_but_for_what_the_plate_loses():
    slope = np.array(heater.derivative([120.0, 80.0], [150.0]))
    assert slope @ heater.CAPACITIES == pytest.approx(150.0 - heater.loss(80.0))
    assert heater.loss(0.0) == 0.0
    run = held(heater.PLANT.truth, np.zeros((60, 1)), [50.0, 30.0])
    assert (np.diff(run.states @ heater.CAPACITIES) < 0.0).all() and (run.states > 0.0).all()


def test_a_motor_with_dry_friction_sticks_and_one_that_coasts_never_turns_back():
    assert motors.friction(0.05) > motors.friction(0.8) > 0.0  # Stribeck
    assert motors.friction(-0.3) == -motors.friction(0.3)
    coasting = held(motors.FRICTION.truth, np.zeros((100, 1)), [0.0, 3.0])
    assert (coasting.states[:, 1] > -1e-9).all() and coasting.states[-1, 1] < 1e-3
    pushed = held(motors.FRICTION.truth, np.full((100, 1), 0.05), [0.0, 0.0])
    assert abs(pushed.states[-1, 0]) < 0.05


def test_a_load_rests_inside_the_gap_and_shares_momentum_beyond_it():
    assert motors.geared([0.04, 0.0, 1.0, 0.0], [0.1])[3] == 0.0
    z, u = [0.3, 0.1, 1.0, -0.5], [0.2]
    slope = motors.geared(z, u)
    balance = motors.MOTOR * slope[2] + motors.LOAD * slope[3]
    assert balance == pytest.approx(0.2 - motors.BEARINGS[0] * 1.0 + motors.BEARINGS[1] * 0.5)
    # Leaving faster than the spring pushes, the shaft does not pull.
    assert motors.through_the_gap(motors.GAP + 1e-3, -10.0) == 0.0


def test_a_stop_pushes_back_and_takes_energy():
    beyond = end_stop.STOP + 0.01
    assert end_stop.contact(end_stop.STOP - 0.01, 5.0) == 0.0 and end_stop.contact(beyond, -10.0) == 0.0
    assert end_stop.contact(beyond, 0.0) == pytest.approx(-0.01 * end_stop.STIFFNESS)
    run = held(end_stop.PLANT.truth, np.zeros((60, 1)), [0.8, 3.0])
    energy = (
        0.5 * run.states[:, 1] ** 2
        + 0.5 * end_stop.STIFFNESS * np.maximum(run.states[:, 0] - end_stop.STOP, 0.0) ** 2
    )
    assert (np.diff(energy) <= 1e-9).all() and run.states[-1, 1] < 0.0
