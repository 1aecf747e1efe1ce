"""Models: the three forms of dynamics, one step at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oracles import EXACT, model_step, same_bits
from strategies import exact_programs, program_text, rows
from twinloop import _core

SCALES, DERIVATIVES = [1.0, 4.0], [None, 0]


def test_the_shape_of_a_program_follows_from_the_form_and_the_signals(rig):
    assert _core.Model.shape("absolute", rig) == (4, 2)
    assert _core.Model.shape("increment", rig) == (4, 2)
    assert _core.Model.shape("acceleration", rig) == (4, 1)


@given(st.data(), st.sampled_from(["absolute", "increment"]))
def test_a_step_is_what_the_program_says_to_the_last_bit(rig, data, form):
    program = data.draw(exact_programs(inputs=4, outputs=2))
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


def test_a_program_sees_commands_in_units_of_their_scale(rig):
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r2 + 0.0", "r5 = r3 + 0.0"]]))
    assert _core.Model(program, "absolute", rig).step([[0.0, 0.0]], [[0.5, 2.0]]).tolist() == [[0.5, 0.5]]


def test_a_program_of_another_shape_is_no_model(rig):
    program = _core.Grammar(4, 2, operations=EXACT).random(0)[0]
    with pytest.raises(ValueError, match="expected a program of 4 inputs and 1 outputs"):
        _core.Model(program, "acceleration", rig)
    with pytest.raises(ValueError, match='found "jump"'):
        _core.Model(program, "jump", rig)


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
