"""A twin as an environment: Gymnasium finds no fault, and it moves as the twin does."""

import json
import subprocess
import sys

import numpy as np
import pytest

import twinloop as tl
from law_twins import ALL, TWINS, flown
from twinloop.law.exports.gymnasium_source import Episode

gymnasium = pytest.importorskip("gymnasium", reason="needs pip install 'twinloop[gymnasium]'")


def env_of(twin, steps=20, **changes):
    zeros = np.zeros(twin.signals.n_x)
    return twin.env(zeros, zeros, steps, **changes)


@ALL
@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")  # advice: commands are in their own units
@pytest.mark.filterwarnings("ignore:.*value is -?infinity")  # an angle that wraps goes on without end
def test_gymnasium_finds_no_fault(which):
    from gymnasium.utils.env_checker import check_env

    check_env(env_of(TWINS[which]()), skip_render_check=True)


@ALL
def test_it_moves_as_the_twin_does_with_all_that_it_remembers(which):
    twin = TWINS[which]()
    flight = flown(twin, seed=5)
    expected = twin.simulate_commands(flight.states[0], flight.commands).states
    env = env_of(twin, len(flight.commands))
    for _ in range(2):  # the second episode remembers nothing of the first
        seen = [env.reset(options={"initial_state": flight.states[0]})[0]]
        for command in flight.commands:
            state, _, terminated, truncated, _ = env.step(command)
            seen.append(state)
            assert not terminated
        assert truncated
        np.testing.assert_allclose(seen, expected, rtol=1e-9, atol=1e-9)


@ALL
def test_the_exported_file_moves_as_the_twin_does_in_a_process_without_the_twin(which, tmp_path):
    twin = TWINS[which]()
    twin.export(tmp_path / "taken.py", kind="gymnasium")
    flight = flown(twin, seed=7)
    given = json.dumps([flight.states[0].tolist(), (2.0 * flight.commands).tolist()])
    program = """
import json, sys
sys.path.insert(0, ".")
sys.modules["twinloop"] = None
import taken
start, commands = json.loads(sys.stdin.read())
env = taken.TwinEnv(steps=len(commands))
for _ in range(2):  # the second episode remembers nothing of the first
    seen = [env.reset(options={"initial_state": start})[0].tolist()]
    for command in commands:
        state, reward, terminated, truncated, _ = env.step(command)
        seen.append(state.tolist())
        if terminated: break
print(json.dumps([seen, reward, truncated]))
"""
    done = subprocess.run(
        [sys.executable, "-I", "-c", program],
        cwd=tmp_path, input=given, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found, reward, truncated = json.loads(done.stdout)
    run = twin.simulate_commands(flight.states[0], 2.0 * flight.commands)
    expected = run.states
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=1e-9, atol=1e-9)
    assert truncated and len(expected) == len(found)
    scales = np.array([state.scale for state in twin.signals.states])
    off = np.abs(twin.signals.difference(run.true_states[-1], np.zeros(len(scales))))
    assert reward == pytest.approx(-twin.signals.dt * float((off / scales).sum()), abs=1e-12)


def test_the_exported_file_begins_as_the_campaign_says_and_ends_where_the_twin_diverges():
    twin, names = TWINS["acceleration"](), {}
    scales = np.array([state.scale for state in twin.signals.states])
    episode = Episode(np.array([0.3, 0.0]), np.array([1.0, 0.0]), 7, twin.limits)
    exec(twin.export("gymnasium", episode=episode), names)
    env = names["TwinEnv"]()
    np.testing.assert_array_equal(env.reset()[0], [0.3, 0.0])
    steps = [env.step(env.action_space.low) for _ in range(7)]
    assert [truncated for *_, truncated, _ in steps] == [False] * 6 + [True]
    assert steps[0][1] == pytest.approx(-0.05 * (np.abs(steps[0][0] - [1.0, 0.0]) / scales).sum())
    env.reset(options={"initial_state": 0.999 * twin.limits.divergence_factor * scales})
    lost = [env.step(env.action_space.high) for _ in range(40)]
    assert any(terminated for _, _, terminated, _, _ in lost)
    assert all(np.isfinite(state).all() and np.isfinite(earned) for state, earned, *_ in lost)


def test_an_exported_environment_with_a_fault_is_refused(monkeypatch):
    from gymnasium.utils import env_checker

    def found(env, **_):
        raise AssertionError("a fault")

    twin = TWINS["acceleration"]()
    monkeypatch.setattr(env_checker, "check_env", found)
    with pytest.raises(tl.NotAvailable, match="a fault"):
        twin.export("gymnasium")
    assert "class TwinEnv" in twin.export("gymnasium", force=True)


def test_commands_are_clipped_rewards_are_errors_and_noise_is_that_of_the_sensors():
    twin = next(iter(TWINS.values()))()
    n_x, signals = twin.signals.n_x, twin.signals
    low, high = (np.array([command.bounds[i] for command in signals.commands]) for i in (0, 1))
    one, two = env_of(twin), env_of(twin)
    one.reset()
    two.reset()
    state, earned, *_ = one.step(high + 1.0)
    np.testing.assert_array_equal(state, two.step(high)[0])
    scales = np.array([state.scale for state in signals.states])
    assert earned == pytest.approx(-signals.dt * (np.abs(state) / scales).sum())
    own = env_of(twin, reward=lambda before, command, after: float(command[0] + before[0]))
    own.reset(options={"initial_state": np.full(n_x, 0.25)})
    assert own.step(low)[1] == low[0] + 0.25
    twin.noise = tl.law.noise.Noise(np.full(n_x, 0.1), np.zeros(n_x))
    noisy = env_of(twin, noisy=True)
    read = np.array([noisy.reset(seed=seed)[0] for seed in range(400)])
    np.testing.assert_allclose(read.std(axis=0), 0.1, rtol=0.15)
    assert noisy.reset(seed=3)[0].tobytes() == read[3].tobytes()


def test_what_diverges_terminates_with_a_finite_state():
    twin = next(iter(TWINS.values()))()
    env = env_of(twin)
    far = 0.999 * twin.limits.divergence_factor * np.array([state.scale for state in twin.signals.states])
    env.reset(options={"initial_state": far})
    for _ in range(20):
        state, earned, terminated, _, _ = env.step(env.action_space.high)
        assert np.isfinite(state).all() and np.isfinite(earned)
        if terminated:
            return
    pytest.fail("it did not diverge")


def test_misuse_is_refused(monkeypatch):
    twin = next(iter(TWINS.values()))()
    with pytest.raises(tl.InvalidInput, match="initial state"):
        twin.env([0.0] * (twin.signals.n_x + 1), np.zeros(twin.signals.n_x), 10)
    with pytest.raises(tl.InvalidInput, match="steps"):
        env_of(twin, 0)

    def absent(name):
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr("importlib.import_module", absent)
    with pytest.raises(tl.NotAvailable, match=r"twinloop\[gymnasium\]"):
        env_of(twin)
