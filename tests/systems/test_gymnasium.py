"""Environments of Gymnasium: placed, stepped and read as their own equations say; what does not fit is refused."""

import math

import numpy as np
import pytest

import twinloop as tl
from oracles import same_bits
from twinloop.contracts import check_system

gymnasium = pytest.importorskip("gymnasium", reason="needs pip install 'twinloop[gymnasium]'")

PENDULUM_PID = tl.controllers.PID(
    axes=[("angle", "rate")],
    gains={"angle.kp": (0.0, 60.0), "angle.ki": (0.0, 20.0), "angle.kd": (0.0, 10.0)},
)
FEEDBACK = tl.controllers.StateFeedback(None, gains=(-100.0, 100.0))


def flown(system, controller, gains, start, target, steps=40):
    family = controller.bind(system.signals)
    return system.run(tl.Test(family, family.genes(gains), np.array(start), np.array(target), steps))


def test_the_pendulum_moves_by_its_own_equations():
    """Pendulum-v1 as its page prints it: semi-implicit Euler, g = 10, l = m = 1, observed in single precision."""
    run = flown(tl.systems.Gymnasium("Pendulum-v1"), PENDULUM_PID, [12.0, 1.0, 3.0], [0.2, 0.1], [0.0, 0.0])
    angle, rate = 0.2, 0.1
    for command, read in zip(run.commands[:, 0], run.states[1:], strict=True):
        rate += (15.0 * math.sin(angle) + 3.0 * float(command)) * 0.05
        angle += rate * 0.05
        np.testing.assert_allclose(read, [angle, rate], atol=2e-5)
    assert run.ended == "completed" and abs(run.states[-1, 0]) < 0.05


def test_a_hanging_pendulum_swings_past_the_seam():
    run = flown(
        tl.systems.Gymnasium("Pendulum-v1"), PENDULUM_PID, [0.0, 0.0, 0.0], [2.9, 1.5], [0.0, 0.0], 10
    )
    assert run.states[:, 0].max() > 3.0 and run.states[:, 0].min() < -3.0  # wrapped as the sensor reads it


def test_mujoco_keeps_to_the_contract_and_ends_where_the_pole_falls():
    pytest.importorskip("mujoco", reason="needs pip install 'twinloop[mujoco]'")
    gains = dict(zip(("position", "angle", "velocity", "rate"), (-0.3, -8.0, -0.5, -1.0), strict=True))
    gains = {f"{name}->drive": gain for name, gain in gains.items()}
    system = tl.systems.Gymnasium("InvertedPendulum-v5", default_gains=gains)
    check_system(system, FEEDBACK, initial_state=np.array([0.0, 0.05, 0.0, 0.0]))
    one, two = (flown(system, FEEDBACK, gains, [0.1, 0.05, 0.0, 0.2], np.zeros(4)) for _ in range(2))
    np.testing.assert_allclose(one.states[0], [0.1, 0.05, 0.0, 0.2], atol=1e-12)
    assert same_bits(one.states, two.states) and one.ended == "completed"
    fallen = flown(system, FEEDBACK, np.zeros(4), [0.0, 0.1, 0.0, 0.5], np.zeros(4), 100)
    assert fallen.ended == "aborted" and "terminated" in fallen.reason
    assert np.abs(fallen.states[:-1, 1]).max() <= 0.2 < abs(fallen.states[-1, 1])


def test_discrete_actions_send_on_average_what_was_asked_for_and_record_what_was_sent():
    system = tl.systems.Gymnasium("CartPole-v1")
    gains = {"position->force": -1.0, "velocity->force": -2.0, "angle->force": -40.0, "rate->force": -8.0}
    run = flown(system, FEEDBACK, gains, [0.0, 0.0, 0.05, 0.0], np.zeros(4), 200)
    assert run.ended == "completed" and set(run.commands.ravel()) == {-10.0, 10.0}
    family = FEEDBACK.bind(system.signals)
    controller = family.controller(family.genes(gains))
    asked = np.array([controller.command(state, np.zeros(4)) for state in run.states[:-1]])
    assert np.abs(np.cumsum(run.commands - asked)).max() <= 10.0 + 1e-6
    with pytest.raises(tl.InvalidInput, match="levels"):
        tl.systems.Gymnasium("CartPole-v1", signals=system.signals)


def test_without_a_way_to_place_it_a_run_is_recorded_from_where_reset_put_it():
    known = tl.systems.Gymnasium("Pendulum-v1").signals
    system = tl.systems.Gymnasium(
        "Pendulum-v1",
        signals=known,
        state=lambda seen: (np.arctan2(seen[1], seen[0]), seen[2]),
        options=lambda start: {"x_init": float(start[0]), "y_init": 0.0},
    )
    runs = [flown(system, PENDULUM_PID, [12.0, 1.0, 3.0], [0.3, 0.0], [0.0, 0.0]) for _ in range(3)]
    starts = [run.states[0, 0] for run in runs]
    assert len(set(starts)) == 3 and max(map(abs, starts)) <= 0.3  # drawn within ±x_init
    again = tl.systems.Gymnasium("Pendulum-v1", signals=known, state=system._state, options=system._options)
    again.runs = 2  # as a campaign that goes on in another process
    assert same_bits(
        flown(again, PENDULUM_PID, [12.0, 1.0, 3.0], [0.3, 0.0], [0.0, 0.0]).states, runs[2].states
    )


class Cut(gymnasium.Env):
    """Two numbers that stay; the third step fails or ends the episode."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))
    action_space = gymnasium.spaces.Box(-2.0, 2.0, (1,))

    def __init__(self, how):
        self.how = how

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.zeros(2, np.float32), {}

    def step(self, action):
        self.count += 1
        if self.count == 3 and self.how == "raise":
            raise RuntimeError("gear is broken")
        return np.full(2, 0.01 * self.count, np.float32), 0.0, False, self.count == 3, {}


def test_an_episode_that_is_cut_short_is_aborted_with_its_last_reading(pendulum_signals, pendulum_controller):
    system = tl.systems.Gymnasium(Cut("truncate"), signals=pendulum_signals)
    run = flown(system, pendulum_controller, [2.0, 2.0, 0.3], [0.0, 0.0], [1.0, 0.0])
    assert (run.ended, run.steps) == ("aborted", 3) and "truncated) 0.15 s" in run.reason
    assert run.states[-1, 0] == pytest.approx(0.03)
    with pytest.raises(tl.SystemFailure, match="gear is broken"):
        flown(
            tl.systems.Gymnasium(Cut("raise"), signals=pendulum_signals),
            pendulum_controller, [2.0, 2.0, 0.3], [0.0, 0.0], [1.0, 0.0],
        )  # fmt: skip


def test_what_does_not_fit_is_refused(pendulum_signals, monkeypatch):
    Box = gymnasium.spaces.Box
    with pytest.raises(tl.InvalidInput, match="expected the name of an environment"):
        tl.systems.Gymnasium("Pendulum-v77")
    with pytest.raises(tl.InvalidInput, match="describe its states"):
        tl.systems.Gymnasium("Acrobot-v1")
    with pytest.raises(tl.InvalidInput, match=r"a name or a gymnasium\.Env"):
        tl.systems.Gymnasium(3.0)
    other = tl.Signals(pendulum_signals.states, pendulum_signals.commands, 0.01)
    with pytest.raises(tl.InvalidInput, match=r"period of 0\.05 s"):
        tl.systems.Gymnasium("Pendulum-v1", signals=other)
    for space, sentence in ((Box(-1.0, 1.0, (1,)), "narrow them"), (Box(-2.0, 2.0, (3,)), "ActionWrapper")):
        monkeypatch.setattr(Cut, "action_space", space)
        with pytest.raises(tl.InvalidInput, match=sentence):
            tl.systems.Gymnasium(Cut(""), signals=pendulum_signals)


def test_without_gymnasium_it_says_what_to_install(monkeypatch):
    def absent(name):
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr("importlib.import_module", absent)
    with pytest.raises(tl.NotAvailable, match=r"twinloop\[gymnasium\]"):
        tl.systems.Gymnasium("Pendulum-v1")
