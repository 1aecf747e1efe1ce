"""A step function with noisy sensors: what is read is noisy, the rest is not, and a restart gives the same noise."""

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from oracles import same_bits
from twinloop.contracts import check_system


@pytest.fixture
def test(pendulum_signals, pendulum_controller):
    family = pendulum_controller.bind(pendulum_signals)
    return tl.Test(family, family.genes(PENDULUM_GAINS), np.zeros(2), np.array([1.0, 0.0]), 400)


def simulated(signals, **changes):
    return tl.systems.Simulated(signals, pendulum_step, default_gains=PENDULUM_GAINS, **changes)


def test_sensors_have_the_noise_that_was_asked_for_and_the_true_states_obey_the_step(pendulum_signals, test):
    run = simulated(pendulum_signals, noise={"angle": 0.01, "rate": 0.2}).run(test)
    errors = run.states - run.true_states
    np.testing.assert_allclose(
        errors.std(axis=0), [0.01, 0.2], rtol=0.12
    )  # 401 readings: 3.5 % is one sd of it
    for before, command, after in zip(run.true_states, run.commands, run.true_states[1:], strict=False):
        np.testing.assert_array_equal(pendulum_step(before, command), after)
    # The controller reads the noisy state.
    controller = test.controller()
    read = [controller.command(state, test.target_state) for state in run.states[:-1]]
    np.testing.assert_array_equal(run.commands, read)


def test_each_run_has_noise_of_its_own_that_depends_on_seed_and_count_alone(pendulum_signals, test):
    system = simulated(pendulum_signals, noise=[0.01, 0.1], seed=4)
    one, two = system.run(test), system.run(test)
    assert system.runs == 2 and not same_bits(one.states, two.states)
    again = simulated(pendulum_signals, noise=[0.01, 0.1], seed=4)
    again.runs = 1  # what a campaign sets when it goes on in another process
    assert same_bits(again.run(test).states, two.states)
    assert not same_bits(simulated(pendulum_signals, noise=[0.01, 0.1], seed=5).run(test).states, one.states)


def test_a_run_that_failed_uses_up_no_noise(pendulum_signals, test):
    broken = True

    def step(x, u):
        if broken:
            raise RuntimeError("not today")
        return pendulum_step(x, u)

    system = tl.systems.Simulated(pendulum_signals, step, noise=0.01)
    with pytest.raises(tl.SystemFailure, match="not today"):
        system.run(test)
    broken = False
    assert same_bits(system.run(test).states, simulated(pendulum_signals, noise=0.01).run(test).states)


def test_a_campaign_on_noisy_sensors_goes_on_with_the_same_bits(tmp_path, pendulum_signals, new_campaign):
    whole, one = new_campaign(), simulated(pendulum_signals, noise=0.01)
    for experiments in (1, 2, 3):
        whole.run(one, experiments)
        parts = new_campaign(
            store=tmp_path / "x.db"
        )  # as in another process: a campaign and a system of its own
        parts.run(simulated(pendulum_signals, noise=0.01), experiments)
        parts.close()
    for a, b in zip(whole.experiments, parts.experiments, strict=True):
        assert same_bits(a.trajectory.states, b.trajectory.states)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_it_keeps_to_the_contract(pendulum_signals, pendulum_controller, noise):
    check_system(simulated(pendulum_signals, noise=noise), pendulum_controller)


@pytest.mark.parametrize(
    ("noise", "sentence"),
    [({"rat": 0.1}, "did you mean 'rate'"), ([0.1], "one number for each"), (-0.1, "at least 0")],
)
def test_a_noise_that_cannot_be_used_is_refused(pendulum_signals, noise, sentence):
    with pytest.raises(tl.InvalidInput, match=sentence):
        simulated(pendulum_signals, noise=noise)
