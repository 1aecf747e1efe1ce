"""Models: the forms of dynamics, one step at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oracles import EXACT, model_step, same_bits
from strategies import exact_programs, program_text, rows
from twinloop import InvalidInput, _core

SCALES, DERIVATIVES = [1.0, 4.0], [None, 0]


def test_the_shape_of_a_program_follows_from_the_form_and_the_signals(rig):
    assert _core.Model.shape("absolute", rig) == (4, 2)
    assert _core.Model.shape("increment", rig) == (4, 2)
    for form in ("acceleration", "explicit-euler", "semi-implicit-euler"):
        assert _core.Model.shape(form, rig) == (4, 1)


@given(st.data(), st.sampled_from(["absolute", "increment", "explicit-euler", "semi-implicit-euler"]))
def test_a_step_is_what_the_program_says_to_the_last_bit(rig, data, form):
    program = data.draw(exact_programs(inputs=4, outputs=1 if form.endswith("euler") else 2))
    x, u = np.hsplit(data.draw(rows(4)), 2)
    expected = [model_step(program, form, a, b, SCALES, DERIVATIVES, 0.1) for a, b in zip(x, u, strict=True)]
    for width in _core.vector_widths():
        found = _core.Model(program, form, rig).step(x, u, _core.Workers(width=width))
        assert same_bits(found, expected)


@given(st.integers(0, 2**32 - 1))
def test_accelerations_are_integrated_by_runge_and_kutta(rig, seed):
    program = _core.Grammar(4, 1, operations=["+", "-", "*", "sin", "tanh"]).random(seed)[0]
    stream = np.random.default_rng(seed)
    x, u = stream.uniform(-1.0, 1.0, (9, 2)), stream.uniform(-1.0, 1.0, (9, 2))
    expected = np.array([
        model_step(program, "acceleration", a, b, SCALES, DERIVATIVES, 0.1)
        for a, b in zip(x, u, strict=True)
    ])  # fmt: skip
    found = _core.Model(program, "acceleration", rig).step(x, u)
    tame = np.isfinite(expected).all(axis=1) & (np.abs(expected) < 1e3).all(axis=1)
    np.testing.assert_allclose(found[tame], expected[tame], rtol=1e-9, atol=1e-9)


def test_a_constant_acceleration_gives_the_parabola(rig):
    program = _core.Program.parse(program_text(4, 1, 5, [["r4 = r4 + 3.0"]]))
    found = _core.Model(program, "acceleration", rig).step([[0.5, 2.0]], [[0.0, 0.0]])
    np.testing.assert_allclose(found, [[0.5 + 0.2 + 0.5 * 3.0 * 0.01, 2.3]], rtol=1e-14)


CHAIN = _core.Signals(0.1, [1.0] * 4, [(-1.0, 1.0)], [1.0], [1, None, 0, None])
"""Velocity, position, acceleration and something else."""


@pytest.mark.parametrize("form", ["explicit-euler", "semi-implicit-euler"])
def test_every_state_of_a_chain_goes_on_by_the_one_before_it(form):
    program = _core.Program.parse(
        program_text(5, 2, 9, [["r5 = sin(r1)", "r6 = r3 * r4", "r5 = r5 - r2", "r6 = r6 - r0"]])
    )
    x, u = np.random.default_rng(5).normal(size=(7, 4)), np.full((7, 1), 0.5)
    for width in _core.vector_widths():
        found = _core.Model(program, form, CHAIN).step(x, u, _core.Workers(width=width))
        expected = [
            model_step(program, form, a, b, [1.0], [1, None, 0, None], 0.1) for a, b in zip(x, u, strict=True)
        ]
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("form", ["explicit-euler", "semi-implicit-euler"])
def test_a_body_is_turned_by_its_rates_at_one_end_of_the_period(form):
    body = _core.Signals(0.05, [1.0] * 6, [(-1.0, 1.0)], [1.0], [None] * 6, kinematics=((0, 1, 2), (3, 4, 5)))
    program = _core.Program.parse(
        program_text(7, 3, 10, [["r7 = r6 * 2.0", "r8 = r3 * r5", "r9 = r9 + 1.5"]])
    )
    x, u = np.random.default_rng(2).uniform(-1.2, 1.2, (9, 6)), np.full((9, 1), 0.3)
    found = _core.Model(program, form, body).step(x, u)
    p, q, r = x[:, 3:].T
    after = x[:, 3:] + 0.05 * np.stack([np.full(9, 0.6), p * r, np.full(9, 1.5)], axis=1)
    np.testing.assert_allclose(found[:, 3:], after, rtol=1e-14)
    p, q, r = (after if form == "semi-implicit-euler" else x[:, 3:]).T
    roll, pitch = x[:, 0], x[:, 1]
    across = q * np.sin(roll) + r * np.cos(roll)
    turning = [p + np.tan(pitch) * across, q * np.cos(roll) - r * np.sin(roll), across / np.cos(pitch)]
    np.testing.assert_allclose(found[:, :3], x[:, :3] + 0.05 * np.transpose(turning), rtol=1e-13, atol=1e-15)


def test_a_program_sees_commands_in_units_of_their_scale(rig):
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r2 + 0.0", "r5 = r3 + 0.0"]]))
    assert _core.Model(program, "absolute", rig).step([[0.0, 0.0]], [[0.5, 2.0]]).tolist() == [[0.5, 0.5]]


def test_a_program_of_another_shape_is_no_model(rig):
    program = _core.Grammar(4, 2, operations=EXACT).random(0)[0]
    with pytest.raises(ValueError, match="expected a program of 4 inputs and 1 outputs"):
        _core.Model(program, "acceleration", rig)
    with pytest.raises(ValueError, match='found "jump"'):
        _core.Model(program, "jump", rig)


@pytest.mark.parametrize(
    "wrong",
    [
        ([], True, None, 0.3, [], False, 0.0, 0.0, 0.0),
        ([0], True, 0.0, 0.3, [0], False, 0.0, 0.0, 0.0),
        ([0], True, None, 0.3, [], True, 0.0, 0.0, 0.0),
        ([0], True, None, 0.3, [], False, 0.1, 0.0, 0.0),
        ([], True, None, 0.3, [0], False, 0.0, 0.0, 0.0),
        ([], True, 0.0, 0.3, [0], False, -0.1, 0.0, 0.0),
        ([], True, 0.0, 0.3, [9], False, 0.0, 0.0, 0.0),
        ([], True, 0.0, 0.0, [0], False, 0.0, 0.0, 0.0),
    ],
)
def test_commands_or_states_fill_a_hidden_state_and_only_states_settle_or_turn_it(rig, wrong):
    program = _core.Program.parse(program_text(5, 2, 7, [["r5 = r4 + 0.0"]]))
    for right in (
        ([0], True, None, 0.3, [], False, 0.0, 0.0, 0.0),
        ([], False, 0.5, 0.3, [1], True, 0.0, 0.0, 0.0),
    ):
        assert _core.Model(program, "absolute", rig, [(0.0, 0, None, 0.0)] * 2, [right]).hidden == [right]
    with pytest.raises(InvalidInput, match="hidden state: expected"):
        _core.Model(program, "absolute", rig, [(0.0, 0, None, 0.0)] * 2, [wrong])


def test_rows_of_another_width_are_refused(rig):
    model = _core.Model(_core.Grammar(4, 2).random(0)[0], "absolute", rig)
    with pytest.raises(ValueError, match="expected 2 columns"):
        model.step([[1.0, 2.0, 3.0]], [[1.0, 2.0]])
    with pytest.raises(ValueError, match="expected"):
        model.step([[1.0, 2.0]], [[1.0, 2.0], [3.0, 4.0]])


@pytest.mark.parametrize(
    "wrong",
    [
        (0.0, [1.0], [(-1.0, 1.0)], [1.0], [None]),
        (0.1, [0.0], [(-1.0, 1.0)], [1.0], [None]),
        (0.1, [1.0], [(1.0, -1.0)], [1.0], [None]),
        (0.1, [1.0], [(-1.0, 1.0)], [-1.0], [None]),
        (0.1, [1.0], [(-1.0, 1.0)], [1.0, 2.0], [None]),
        (0.1, [1.0], [(-1.0, 1.0)], [1.0], [0]),
        (0.1, [1.0], [(-1.0, 1.0)], [1.0], [7]),
        (0.1, [], [(-1.0, 1.0)], [1.0], []),
        (float("nan"), [1.0], [(-1.0, 1.0)], [1.0], [None]),
    ],
)
def test_signals_that_no_loop_can_be_closed_with_are_refused(wrong):
    with pytest.raises(ValueError, match="expected"):
        _core.Signals(*wrong)
