"""A twin from logs alone is the one that a campaign learns from the same runs, and it knows the plant."""

import numpy as np
import pytest

import twinloop as tl
from lives import PLANT, SIGNALS, SMALL, by_hand, made
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
