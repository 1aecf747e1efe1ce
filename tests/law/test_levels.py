"""Commands that are sent in levels: beside a loop that is written out, and what keeps a model's levels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop.law.actuation import delayed
from twinloop.law.law import Law
from twinloop.law.levels import nearest
from twinloop.records.native import model_record, read_model

DT, STEPS = 0.1, 80
SIGNALS = tl.Signals(
    [tl.State("level", "m", 1.0)],
    [tl.Command("pump", "1", (-1.0, 1.0)), tl.Command("valve", "1", (0.0, 1.0))],
    DT,
)
HOLDS = tl.controllers.StateFeedback(
    None, gains={"level->pump": (-9.0, 9.0), "level->valve": (-9.0, 9.0)}
).bind(SIGNALS)
LEVELS = [[-1.0, 0.0, 1.0], []]


def model():
    """level[k+1] = level + 0.2 pump - 0.1 valve."""
    lines = ["r4 = r1 * 0.2", "r5 = r2 * 0.1", "r4 = r4 - r5", "r3 = r0 + r4"]
    return _core.Model(_core.Program.parse(program_text(3, 1, 6, [lines])), "absolute", SIGNALS.engine)


def test_a_twin_sends_the_nearest_level():
    controller = HOLDS.controller(HOLDS.genes({"level->pump": 1.7, "level->valve": -0.8}))
    test = tl.Test(HOLDS, controller.genes, [1.0], [0.3], STEPS)
    run = tl.Twin(model().with_levels(LEVELS), SIGNALS).simulate(test)
    controller.reset()
    state = np.array([1.0])
    for k in range(STEPS):
        sent = controller.command(state, test.target(k)).copy()
        sent[0] = min(LEVELS[0], key=lambda level: (abs(level - sent[0]), level))
        assert run.commands[k].tolist() == sent.tolist()
        state = np.array([state[0] + (0.2 * sent[0] - 0.1 * sent[1])])
        assert run.states[k + 1].tolist() == pytest.approx(state.tolist(), rel=1e-12)
    assert len(np.unique(run.commands[:, 0])) > 1 and len(np.unique(run.commands[:, 1])) > 5


def test_a_record_of_commands_was_sent_already():
    commands = np.linspace(-0.4, 0.4, 2 * STEPS).reshape(STEPS, 2)
    in_levels, plain = tl.Twin(model().with_levels(LEVELS), SIGNALS), tl.Twin(model(), SIGNALS)
    flown = [twin.simulate_commands([0.0], commands).states for twin in (in_levels, plain)]
    assert np.array_equal(*flown)


@given(
    st.lists(st.floats(-9, 9), min_size=2, max_size=6, unique=True), st.lists(st.floats(-20, 20), min_size=1)
)
def test_the_nearest_level_is_no_farther_than_any_other(values, commands):
    values = sorted(values)
    found = nearest(values, np.array(commands))
    off = np.abs(np.subtract.outer(commands, values)).min(axis=1)
    assert np.abs(found - commands) == pytest.approx(off, abs=1e-12)


def test_levels_are_kept_in_all_that_is_made_of_a_model():
    sent = model().with_levels(LEVELS)
    assert model().levels == [] and sent.levels == LEVELS
    assert sent.with_levels([[], []]).levels == []
    law = Law.of(sent, SIGNALS)
    assert law.levels == ((-1.0, 0.0, 1.0), ())
    again = read_model(model_record(sent), "model", (SIGNALS,))
    for kept in (law.model(), again, delayed(sent, SIGNALS), sent.with_constants(sent.constants, None)):
        assert kept.levels == LEVELS
    assert "# pump is sent as -1, 0 or 1, whichever is nearest" in tl.Twin(sent, SIGNALS).equations()


def test_a_record_with_levels_that_are_none_is_refused():
    record = model_record(model())
    for levels in ([[0.0], []], [[1.0, 0.0], []], [[0.0, 1.0]], [[0.0, float("nan")], []], "often"):
        with pytest.raises(tl.InvalidInput):
            read_model({**record, "levels": levels}, "model", (SIGNALS,))
