"""A twin from logs alone is the one that a campaign learns from the same runs, and it knows the plant."""

import dataclasses

import numpy as np
import pytest

import twinloop as tl
from lives import PLANT, SIGNALS, SMALL, by_hand, made
from twinloop.campaign.data.odd_one_out import odd_one_out
from twinloop.campaign.from_logs import learnt_from_logs


def test_a_twin_from_logs_is_that_of_a_campaign_with_attached_runs():
    runs = [by_hand(30, seed=1), by_hand(45, seed=2)]
    twin = tl.identify(runs, SIGNALS, options=SMALL, threads=1)
    campaign = made(duration=45 * SIGNALS.dt)
    for run in runs:
        campaign.attach(run)
    assert twin.equations(17) == campaign.twin.equations(17)
    assert [(row.test, row.attached) for row in twin.errors] == [(None, 1), (None, 2)]


def test_it_foretells_a_run_that_it_has_not_seen():
    twin = tl.identify([by_hand(60, seed=1), by_hand(60, seed=2)], SIGNALS, options=SMALL, threads=1)
    other = by_hand(40, seed=3)
    states = twin.simulate_commands(other.states[0], other.commands).states
    moved = np.abs(other.states - other.states[0]).max()
    assert np.abs(states - other.states).max() < 0.05 * moved
    assert PLANT.signals is SIGNALS


def motor(seed):
    """A motor that is held at several speeds, as its driver logs it."""
    stream, dt = np.random.default_rng(seed), 0.01
    state, wound, states, commands = np.zeros(2), 0.0, [], []
    for target in np.repeat(stream.uniform(-15.0, 15.0, 5), 40):
        states.append(state + stream.normal(size=2) * [0.03, 0.02])
        error = target - states[-1][0]
        wound += error * dt
        commands.append(0.5 * error + 6.0 * wound)
        for _ in range(20):
            speed, current = state
            torque = 25.0 * current - 0.5 * speed - 3.0 * np.tanh(2.0 * speed)
            state = state + dt / 20 * np.array([torque, 50.0 * (commands[-1] - 0.8 * current - 0.5 * speed)])
    return tl.Trajectory(dt * np.arange(201), np.array([*states, state]), np.array(commands)[:, np.newaxis])


MOTOR = tl.Signals(
    [tl.State("speed", "rad/s", 15.0), tl.State("current", "A", 5.0)],
    [tl.Command("voltage", "V", (-60.0, 60.0))],
    0.01,
)


def remarks_on(runs, logs=()):
    return {
        each.code: each
        for each in learnt_from_logs(runs, MOTOR, logs=logs, options=SMALL, threads=1)[0].remarks
    }


@pytest.mark.filterwarnings("ignore::twinloop.errors.RemarkWarning")
def test_the_one_log_with_a_wrong_sign_is_named_instead_of_the_wind():
    runs = [motor(seed) for seed in range(3)]
    assert "odd-one-out" not in remarks_on(runs)
    runs[1] = dataclasses.replace(runs[1], commands=-runs[1].commands)
    found = remarks_on(runs, ["mon.csv", "tue.csv", "wed.csv"])
    assert found["odd-one-out"].serious
    assert found["odd-one-out"].sentence.startswith(
        "Without tue.csv one linear law explains most of the other 2"
    )
    assert "with the sign of its voltage changed" in found["odd-one-out"].sentence
    assert not any("wind" in each.sentence for each in found.values())


def pushed(seed, dt=0.05):
    """A cart that a thrust in % pushes against the wind."""
    stream = np.random.default_rng(seed)
    thrust, speed = np.repeat(stream.uniform(20.0, 90.0, 12), 12), [3.0]
    for u in thrust:
        speed.append(speed[-1] + dt * (0.1 * u - speed[-1] - 0.05 * speed[-1] * abs(speed[-1])))
    readings = np.array(speed) + 0.01 * stream.standard_normal(len(speed))
    return tl.Trajectory(dt * np.arange(len(speed)), readings[:, np.newaxis], thrust[:, np.newaxis])


@pytest.mark.filterwarnings("ignore::twinloop.errors.RemarkWarning")
def test_a_log_in_another_unit_is_named_though_a_law_with_terms_for_it_alone_explains_all():
    cart = tl.Signals([tl.State("speed", "m/s", 5.0)], [tl.Command("thrust", "%", (0.0, 100.0))], 0.05)
    runs = [pushed(seed) for seed in range(3)]
    healthy = tl.identify(runs, cart, options=SMALL, threads=1)
    assert "odd-one-out" not in [each.code for each in healthy.remarks] and "Max" not in healthy.equations()
    runs[2] = dataclasses.replace(runs[2], commands=runs[2].commands / 100.0)
    twin = tl.identify(runs, cart, options=SMALL, threads=1)
    # Two terms begin where only the third log has been.
    assert twin.follows and "Max" in twin.equations()
    (said,) = (each for each in twin.remarks if each.code == "odd-one-out")
    assert said.serious and "with its thrust multiplied by about 100" in said.sentence


@pytest.mark.filterwarnings("ignore::twinloop.errors.RemarkWarning")
def test_where_a_law_explains_all_logs_none_is_accused_though_no_linear_law_does():
    """A heater takes its voltage squared: to a linear law the log below 0 has the other sign."""
    heater = tl.Signals([tl.State("heat", "K", 3.0)], [tl.Command("voltage", "V", (-2.0, 2.0))], 0.05)
    runs = []
    for seed, sign in enumerate((1.0, 1.0, -1.0)):
        commands = sign * np.repeat(np.random.default_rng(seed).uniform(0.3, 1.5, (10, 1)), 15, axis=0)
        heat = [0.0]
        for (u,) in commands:
            heat.append(heat[-1] + 0.05 * (3.0 * u * u - heat[-1]))
        runs.append(tl.Trajectory(0.05 * np.arange(151), np.array(heat)[:, np.newaxis], commands))
    assert odd_one_out(runs, heater).place == 2
    twin = tl.identify(runs, heater, options=SMALL, threads=1)
    assert twin.follows and "odd-one-out" not in [each.code for each in twin.remarks]


def test_an_envelope_that_does_not_hold_zero_is_no_hindrance():
    states = [tl.State("level", "m", 1.0, envelope=(2.0, 4.0))]
    signals = tl.Signals(states, [tl.Command("inflow", "m/s", (0.0, 1.0))], 0.1)
    stream = np.random.default_rng(0)
    commands = np.repeat(stream.uniform(0.0, 1.0, (8, 1)), 5, axis=0)
    level = [2.5]
    for (u,) in commands:
        level.append(level[-1] + 0.1 * (u - 0.2 * level[-1]))
    run = tl.Trajectory(0.1 * np.arange(41), np.array(level)[:, None], commands)
    twin = tl.identify([run], signals, options={**SMALL, "libraries": ("linear",)}, threads=1)
    assert max(row.normalised for row in twin.errors) < 1e-3


def test_a_run_that_is_learnt_is_not_held_out():
    run = by_hand(40)
    with pytest.raises(tl.InvalidInput, match="hold out that are not learnt"):
        learnt_from_logs([run], SIGNALS, [by_hand(40)])


def test_a_copy_of_a_run_that_is_learnt_is_not_held_out_either():
    run = by_hand(40)
    noise = 1e-3 * np.random.default_rng(0).normal(size=run.states.shape)
    noisy = dataclasses.replace(run, states=run.states + noise)
    copy = dataclasses.replace(run, states=np.round(noisy.states, 4), commands=np.round(run.commands, 4))
    with pytest.raises(
        tl.InvalidInput, match="found a copy of one that is: their readings differ by far less"
    ):
        learnt_from_logs([noisy], SIGNALS, [copy])


@pytest.mark.parametrize(
    ("runs", "found"),
    [
        ([], "an empty list"),
        ([np.zeros((3, 2))], "ndarray in it; load"),
        ("flight.csv", "str in it; load"),
        (None, "NoneType; load"),
        (by_hand(40), r"one without a list around it; write \[run\]"),
    ],
)
def test_what_is_no_list_of_runs_is_refused(runs, found):
    with pytest.raises(tl.InvalidInput, match=f"at least one Trajectory.*found {found}"):
        tl.identify(runs, SIGNALS)


@pytest.mark.parametrize("names", [["a.csv"], ["a.csv", "b.csv", "c.csv"]])
def test_names_are_of_all_runs_or_of_none(names):
    runs = [motor(0), motor(1)]
    with pytest.raises(tl.InvalidInput, match=f"as many names as runs, 2, found {len(names)}"):
        learnt_from_logs(runs, MOTOR, logs=names)
