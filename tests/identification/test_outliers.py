"""One reading that is wrong, among few: it stands out, it is ignored, and what is learnt is what would have been."""

import numpy as np
import pytest
from scipy.linalg import expm

import twinloop as tl
from twinloop.identification.outliers import Suspect, ignoring, suspects
from twinloop.identification.records import Run

NOISE = 0.02
SIGNALS = tl.Signals(
    states=[tl.State("temperature", "K", scale=3.0)],
    commands=[tl.Command("voltage", "V", bounds=(-2.0, 2.0))],
    dt=0.1,
)
RATE, GAIN = -0.8, 3.0


def heated(seed, readings=31):
    """Readings of d x / dt = −0.8 x + 3 u with noise, under steps, by the matrix exponential."""
    random = np.random.default_rng(seed)
    step = expm(np.array([[RATE, GAIN], [0.0, 0.0]]) * SIGNALS.dt)
    commands = np.repeat(random.uniform(-2.0, 2.0, size=(readings // 5 + 1, 1)), 5, axis=0)[: readings - 1]
    states = [0.5]
    for (command,) in commands:
        states.append(step[0, 0] * states[-1] + step[0, 1] * command)
    return np.array(states)[:, np.newaxis] + NOISE * random.standard_normal((readings, 1)), commands


def suspected(states):
    run = Run.of(states, np.zeros((len(states) - 1, 1)))
    return [(suspect.row, suspect.state) for suspect in suspects([run], np.ones(states.shape[1]))]


@pytest.mark.parametrize("row", [4, 15, 26])
@pytest.mark.parametrize("size", [-30.0, 15.0])
def test_a_reading_that_is_wrong_stands_out(row, size):
    states = np.sin(0.2 * np.arange(31.0)) + NOISE * np.random.default_rng(1).standard_normal(31)
    states[row] += size * NOISE

    assert suspected(states[:, np.newaxis]) == [(row, 0)]


@pytest.mark.parametrize("row", [0, 1, 29, 30])
@pytest.mark.parametrize("size", [-60.0, 40.0])
def test_so_does_one_at_an_end_of_a_run_if_nothing_else_is_nearly_as_rough(row, size):
    noise = 1e-3 * np.random.default_rng(1).standard_normal(31)
    states = np.sin(0.1 * np.arange(31.0)) + noise
    states[row] += size * 1e-3 * (4.0 if row in (0, 30) else 1.0)

    assert suspected(states[:, np.newaxis]) == [(row, 0)]
    # In a run that jumps anywhere a jump at its end may be one, too.
    states[15:] += 0.1
    assert (row, 0) not in suspected(states[:, np.newaxis])


@pytest.mark.parametrize("row", [0, 1, 12, 29, 30])
def test_a_reading_that_is_ignored_stands_where_it_would_have_been(row):
    signals = tl.Signals(
        [tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 1.0, derivative_of="angle")],
        [tl.Command("torque", "N m", (-1.0, 1.0))],
        0.1,
    )
    time = 0.1 * np.arange(31.0)
    states = np.stack([np.sin(time), np.cos(time)], axis=1)
    wrong = states.copy()
    wrong[row] += 0.7
    run = Run.of(wrong, np.zeros((30, 1)))
    for state in (1, 0):
        run = ignoring(run, Suspect(0, row, state, 1.0), signals)

    np.testing.assert_allclose(run.states, states, atol=2e-3)
    assert (run.weights == 0.0).sum() == 2 and (run.weights[row] == 0.0).all()


@pytest.mark.parametrize("size", [-1.0, 3.0, 100.0])
def test_corners_and_jumps_of_the_motion_do_not(size):
    time = np.linspace(0.0, 3.0, 31)
    rough = 1e-3 * np.random.default_rng(2).standard_normal(31)
    corner, jump = size * np.abs(time - 1.5), size * (time > 1.55)

    assert suspected(np.stack([np.sin(time) + rough + corner, np.cos(time) + rough + jump], axis=1)) == []


@pytest.mark.parametrize("size", [15.0, 40.0])
def test_one_of_thirty_readings_that_is_wrong_spoils_nothing(size):
    states, commands = heated(4)
    clean = tl.identify([tl.Trajectory(SIGNALS.dt * np.arange(31), states, commands)], SIGNALS, seed=0)
    states[12] -= size * NOISE
    twin = tl.identify([tl.Trajectory(SIGNALS.dt * np.arange(31), states, commands)], SIGNALS, seed=0)

    assert any(remark.code == "outliers" for remark in twin.remarks)
    for learnt in (clean, twin):
        linear = learnt.linearise(at=np.zeros(1), command=np.zeros(1))
        np.testing.assert_allclose(linear.A, [[RATE]], rtol=0.05)
        np.testing.assert_allclose(linear.B, [[GAIN]], rtol=0.05)


def test_who_switches_all_cleaning_off_ignores_nothing():
    states, commands = heated(4)
    states[12] -= 15.0 * NOISE
    off = {"cleaning": False, "outliers": False}
    twin = tl.identify(
        [tl.Trajectory(SIGNALS.dt * np.arange(31), states, commands)], SIGNALS, seed=0, options=off
    )

    assert not any(remark.code == "outliers" for remark in twin.remarks)


def test_clean_readings_are_all_kept():
    for seed in range(3):
        states, commands = heated(seed)
        twin = tl.identify([tl.Trajectory(SIGNALS.dt * np.arange(31), states, commands)], SIGNALS, seed=0)

        assert not any(remark.code == "outliers" for remark in twin.remarks)


def test_a_wrong_reading_in_few_hides_no_state():
    runs = []
    for seed in (5, 6, 7):
        states, commands = heated(seed)
        states[11 + seed] += 40.0 * NOISE
        runs.append(tl.Trajectory(SIGNALS.dt * np.arange(31), states, commands))

    assert not tl.identify(runs, SIGNALS, seed=0).law.actuation.hidden
