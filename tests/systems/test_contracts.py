"""The contract suites pass what keeps its promises and catch what does not."""

import copy

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, PENDULUM_SIGNALS, pendulum_step
from oracles import same_bits
from twinloop.contracts import ContractBroken, check_controller, check_system


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("gyroscopic", ["physical", "print"])
def test_the_quadrotor_keeps_to_the_contract(noise, gyroscopic):
    check_system(tl.systems.Quadrotor(noise=noise, gyroscopic=gyroscopic))


def test_a_simulated_system_keeps_to_the_contract(pendulum, pendulum_controller):
    check_system(pendulum, pendulum_controller, target_state=np.array([1.0, 0.0]))
    assert isinstance(pendulum, tl.System)


def test_the_quadrotors_controllers_keep_to_the_contract(quadrotor):
    check_controller(quadrotor.controller, quadrotor.signals)


def test_controllers_without_a_rate_keep_to_the_contract(pendulum_signals, pendulum_controller):
    check_controller(pendulum_controller, pendulum_signals)
    lazy = tl.controllers.PID(axes=[("angle", None)], gains=pendulum_controller.gains)
    check_controller(lazy, pendulum_signals, seed=3)


def rotorpy():
    pytest.importorskip("rotorpy", reason='needs pip install --no-deps "rotorpy>=3,<4"')
    return tl.systems.RotorPy(noise=1e-3, seed=4)


def gymnasium():
    pytest.importorskip("gymnasium", reason="needs pip install 'twinloop[gymnasium]'")
    return tl.systems.Gymnasium("Pendulum-v1", noise=1e-3, seed=4)


SYSTEMS = {
    "quadrotor": lambda: tl.systems.Quadrotor.harsh(seed=4),
    "rotorpy": rotorpy,
    "gymnasium": gymnasium,
    "simulated": lambda: tl.systems.Simulated(PENDULUM_SIGNALS, pendulum_step, noise=1e-3, seed=4),
}


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_copy_of_a_system_makes_the_runs_that_this_one_would(name, copied):
    def flights(system, number):
        law = tl.controllers.StateFeedback(None, (0.0, 0.5)).bind(system.signals)
        still = np.zeros(system.signals.n_x)
        test = tl.Test(law, np.full(law.size, 0.01), still, still, 10)
        return [system.run(test).states for _ in range(number)]

    system, expected = SYSTEMS[name](), flights(SYSTEMS[name](), 3)
    flights(system, 1)
    other = copied(system)
    assert same_bits(flights(other, 2), expected[1:]) and not same_bits(*expected[1:])
    assert system.runs == 1 and same_bits(flights(system, 2), expected[1:])


@pytest.mark.parametrize("base", [tl.System, object])
def test_signals_may_be_an_attribute_also_of_a_subclass(pendulum, pendulum_controller, base):
    class Rig(base):
        default_gains = PENDULUM_GAINS
        controller = pendulum_controller

        def __init__(self):
            self.signals = pendulum.signals

        def run(self, test):
            return pendulum.run(test)

    assert isinstance(Rig(), tl.System)
    check_system(Rig(), target_state=np.array([1.0, 0.0]))


class Broken(tl.System):
    """A pendulum with one promise broken."""

    default_gains = PENDULUM_GAINS

    def __init__(self, system, controller, spoil):
        self.system, self.controller, self.spoil, self.count = system, controller, spoil, 0

    @property
    def signals(self):
        return self.system.signals

    def run(self, test):
        self.count += 1
        return self.spoil(self.system.run(test), self.count)


def rebuilt(run, count, **changes):
    parts = {"t": run.t, "states": run.states, "commands": run.commands, "true_states": run.true_states}
    return tl.Trajectory(**{**parts, **changes})


BROKEN = {
    "commands out of bounds": (
        lambda r, n: rebuilt(r, n, commands=r.commands + 3.0),
        "torque within -2 to 2",
    ),
    "a cut run that claims to be complete": (
        lambda r, n: tl.Trajectory(r.t[:9], r.states[:9], r.commands[:8]),
        "a completed run of 20 steps",
    ),
    "a cut run without a reason": (
        lambda r, n: tl.Trajectory(r.t[:9], r.states[:9], r.commands[:8], ended="aborted"),
        "a reason why",
    ),
    "another answer each time": (
        lambda r, n: rebuilt(r, n, states=r.states + 1e-9 * n),
        "answer a test twice alike",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_promise_is_caught(pendulum, pendulum_controller, case):
    spoil, sentence = BROKEN[case]
    with pytest.raises(ContractBroken, match=sentence):
        check_system(Broken(pendulum, pendulum_controller, spoil), target_state=np.array([1.0, 0.0]))


def test_a_system_at_another_period_is_caught(pendulum, pendulum_controller):
    with pytest.raises(tl.InvalidInput, match="expected a period"):
        check_system(Broken(pendulum, pendulum_controller, lambda r, n: rebuilt(r, n, t=r.t * 2.0)))


def test_a_controller_that_does_not_forget_is_caught(monkeypatch, pendulum_signals, pendulum_controller):
    monkeypatch.setattr("twinloop.controllers.family.Controller.reset", lambda self: None)
    with pytest.raises(ContractBroken, match=r"reset\(\) to forget"):
        check_controller(pendulum_controller, pendulum_signals)


def test_a_system_without_a_controller_is_told_to_pass_one(pendulum):
    with pytest.raises(ContractBroken, match="pass them"):
        check_system(pendulum)
