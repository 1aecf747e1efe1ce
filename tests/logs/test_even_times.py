"""Logs whose times jitter, brought onto the period; and parts of a log."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from twinloop.logs import Log, Window, evenly
from twinloop.logs.even_times import part_of
from twinloop.logs.samples import Samples, mean_held

DT = 0.05
SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 1.0, periodic=True), tl.State("rate", "rad/s", 2.0)],
    [tl.Command("torque", "N m", (-2.0, 2.0))],
    DT,
)
steps = st.lists(st.floats(0.6 * DT, 1.4 * DT), min_size=4, max_size=40)


def log_at(t, states, commands, lines=None):
    return Log("log", SIGNALS, np.asarray(t), np.asarray(states), np.asarray(commands), lines)


@given(steps=steps, seed=st.integers(0, 99))
def test_what_is_straight_between_rows_is_read_as_it_was_and_commands_keep_their_impulse(steps, seed):
    draw = np.random.default_rng(seed)
    t = 3.0 + np.r_[0.0, np.cumsum(steps)]
    slope, sent = draw.uniform(-2.0, 2.0, 2), draw.uniform(-2.0, 2.0, (len(steps), 1))
    found = evenly(log_at(t, (t[:, np.newaxis] - 3.0) * slope, sent))
    n = len(found.commands)
    # The last row may come early, by a twentieth of a period.
    assert n == int((t[-1] - t[0]) / DT + 0.05) and np.allclose(found.t, DT * np.arange(n + 1), atol=1e-12)
    assert np.allclose(found.states, found.t[:, np.newaxis] * slope, atol=1e-9)
    # By hand: each command is held until the next one.
    fine = np.linspace(0.0, n * DT, 20 * n, endpoint=False) + 0.5 * DT / 20
    held = np.minimum(np.searchsorted(t - 3.0, fine, side="right"), len(sent)) - 1
    by_hand = sent[held, 0].reshape(n, 20).mean(axis=1)
    assert np.allclose(found.commands[:, 0], by_hand, atol=4.0 * 2 / 20)
    whole = np.r_[np.minimum(t[:-1] - 3.0, n * DT), n * DT]
    assert found.commands.sum() * DT == pytest.approx((sent[:, 0] * np.diff(whole)).sum(), abs=1e-9)
    assert tl.Trajectory(found.t, found.states, found.commands).steps == n


def test_an_even_log_stays_as_it_is():
    t, draw = DT * np.arange(30), np.random.default_rng(0)
    states, commands = draw.normal(size=(30, 2)), draw.uniform(-2.0, 2.0, (29, 1))
    log = log_at(t, states, commands)
    assert evenly(log) is log
    found = evenly(log_at(t * (1.0 + 1e-8), states, commands))
    assert np.allclose(found.states, states, atol=1e-6) and np.allclose(found.commands, commands, atol=1e-6)
    assert [said.code for said in found.remarks] == ["evenly"]


def test_an_angle_that_wraps_between_two_rows_takes_the_short_way():
    t = np.array([0.0, 0.04, 0.11, 0.15, 0.2])
    turned = 3.0 + 2.0 * t
    wrapped = turned - 2.0 * np.pi * np.round(turned / (2.0 * np.pi))
    found = evenly(log_at(t, np.stack([wrapped, np.zeros(5)], axis=1), np.zeros((4, 1))))
    off = found.states[:, 0] - (3.0 + 2.0 * found.t)
    assert np.allclose(off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)), 0.0, atol=1e-9)
    assert np.abs(np.diff(found.states[:, 0])).max() < 0.2


def test_a_mean_is_of_what_was_held():
    samples = Samples("u", np.array([0.0, 0.03, 0.08]), np.array([1.0, -1.0, 2.0]))
    assert mean_held(samples, np.array([0.0, 0.05, 0.1])) == pytest.approx([0.2, (-0.03 + 0.04) / 0.05])


def changed(**changes):
    t = DT * np.arange(10) * 1.0001
    given = {"t": t, "states": np.zeros((10, 2)), "commands": np.zeros((9, 1)), **changes}
    return log_at(given["t"], given["states"], given["commands"])


def gap(first, last):
    states = np.zeros((10, 2))
    states[first:last, 1] = np.nan
    return states


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"t": DT * np.r_[0:5, 4:9]}, "increasing times"),
        ({"t": np.r_[DT * np.arange(9), np.nan]}, "increasing times"),
        ({"t": DT * np.r_[0:5, 8:13]}, "periods"),
        ({"commands": np.full((9, 1), np.nan)}, "a command in each row"),
        ({"states": gap(3, 5)}, "samples of rate"),
        ({"states": gap(0, 1)}, "readings of rate from its first row"),
        ({"states": gap(0, 10)}, "readings of rate"),
    ],
)
def test_what_nobody_knows_is_refused(changes, said):
    with pytest.raises(tl.InvalidInput, match=said):
        evenly(changed(**changes))


def test_a_reading_that_is_missing_alone_is_between_its_neighbours():
    assert evenly(changed(states=gap(3, 4))).states[3, 1] == 0.0


def test_a_part_has_its_rows_its_lines_and_the_commands_between_them():
    t = 7.0 + DT * np.arange(10)
    log = log_at(t, np.arange(20.0).reshape(10, 2), np.arange(9.0)[:, np.newaxis], lines=list(range(2, 12)))
    part = part_of(log, Window(0.1, 0.3))
    assert part.t.tolist() == t[2:7].tolist() and part.states[:, 0].tolist() == [4.0, 6.0, 8.0, 10.0, 12.0]
    assert part.commands[:, 0].tolist() == [2.0, 3.0, 4.0, 5.0] and part.lines == [4, 5, 6, 7, 8]
    assert part_of(log, Window()) is log
    assert part_of(log, Window(start=0.1)).commands[:, 0].tolist() == list(range(2, 9))
    for window in (Window(0.3, 0.1), Window(0.0, 0.05), Window(9.0)):
        with pytest.raises(tl.InvalidInput, match="at least three rows"):
            part_of(log, window)
