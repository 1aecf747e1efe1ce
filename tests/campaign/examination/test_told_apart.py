"""Commands that a log cannot tell apart, from one another or from the states, are named; others are not."""

import numpy as np
import pytest

import twinloop as tl
from lives import by_hand

N = 120
SIGNALS = tl.Signals(
    [tl.State("x", "m", 2.0), tl.State("v", "m/s", 2.0)],
    [tl.Command(name, "N", (-20.0, 20.0)) for name in ("left", "right", "rear")],
    0.05,
)


def said(commands, states=None):
    """Notes on a log with these commands; states wander by themselves unless they are given."""
    if states is None:
        states = np.cumsum(0.1 * np.random.default_rng(4).standard_normal((N + 1, 2)), axis=0)
    found = tl.check_log(SIGNALS.dt * np.arange(N + 1), states, commands, SIGNALS)
    assert found.fit, found.remarks
    return {r.code: r.sentence for r in found.remarks if r.code in ("alike-commands", "fed-back")}


@pytest.fixture
def own():
    return np.random.default_rng(7).standard_normal((N, 3))


def test_commands_with_signals_of_their_own_are_told_apart(own):
    assert said(own) == {}
    assert said(own @ [[1.0, 0.95, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 1.0]]) == {}


def test_commands_that_are_proportional_or_add_up_are_named(own):
    left, _, rear = own.T
    proportional = said(np.stack([left, -0.5 * left + 3.0, rear], axis=1))
    assert proportional["alike-commands"].startswith("left and right move together")
    together = said(np.stack([left, 4.0 - left - rear, rear], axis=1))
    assert together["alike-commands"].startswith("left, right and rear move together")
    assert set(proportional) == set(together) == {"alike-commands"}


def test_a_command_that_never_moves_is_like_no_other(own):
    left, right, _ = own.T
    assert said(np.stack([left, right, np.full(N, 5.0)], axis=1)) == {}


def test_a_feedback_alone_is_named_and_with_an_excitation_it_is_not(own):
    states = np.cumsum(0.1 * np.random.default_rng(5).standard_normal((N + 1, 2)), axis=0)
    feedback = own.copy()
    feedback[:, 1] = 0.3 - states[:-1] @ [2.0, 0.7]
    assert said(feedback, states)["fed-back"].startswith("right follows from the states to 1 %")
    excited = feedback + [0.0, 0.1, 0.0] * np.random.default_rng(6).standard_normal((N, 3))
    assert said(excited, states) == {}


def test_a_log_of_few_rows_says_nothing_of_it(own):
    few = tl.check_log(
        SIGNALS.dt * np.arange(31), np.random.default_rng(1).standard_normal((31, 2)).cumsum(0),
        np.tile(own[:30, :1], 3), SIGNALS,
    )  # fmt: skip
    assert "alike-commands" not in {remark.code for remark in few.remarks}


def test_what_a_pilot_did_is_no_feedback():
    run = by_hand(120, seed=2)
    signals = tl.Signals(SIGNALS.states, SIGNALS.commands[:1], 0.05)
    codes = {r.code for r in tl.check_log(run.t, run.states, run.commands, signals).remarks}
    assert not codes & {"fed-back", "alike-commands"}
