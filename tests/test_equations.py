"""The printed equations, read again by a small parser, give what the engine computes."""

import re

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import twinloop as tl
from oracles import EXACT, evaluate, registers_of, same_bits
from strategies import exact_programs, program_text, programs, rows
from twinloop import _core
from twinloop.equations import equations

SIGNALS = tl.Signals(
    states=[tl.State("x", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="x")],
    commands=[tl.Command("u", "V", (-2.0, 2.0)), tl.Command("t1", "V", (-1.0, 1.0))],
    dt=0.1,
)


def read(text, inputs):
    """Values of the equations' right sides in order, and the lines; inputs (rows, 4), commands scaled."""
    names = ["x", "v", "u_scaled", "t1"]
    values = dict(zip(names, np.asarray(inputs, dtype=float).T, strict=True))
    found = []
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        left, right = line.split(" = ", 1)
        value = np.broadcast_to(evaluate(right, values), len(inputs))
        if left.isidentifier():
            assert left not in values, f"{left} is defined twice"
            values[left] = value
        else:
            found.append(value)
    return np.array(found).T


@given(st.data())
def test_the_exact_equations_give_what_the_program_computes(data):
    program = data.draw(exact_programs(inputs=4, outputs=2))
    inputs = data.draw(rows(4, size=50.0))
    effective = program.effective()
    assume(all(np.isfinite(bank).all() for bank in registers_of(effective, inputs)))
    text = equations(_core.Model(program, "absolute", SIGNALS.engine), SIGNALS, digits=17)
    np.testing.assert_array_equal(read(text, inputs), program.run(inputs))


@given(st.integers(0, 2**32 - 1))
def test_equations_of_whole_random_programs_give_what_they_compute(seed):
    program = _core.Grammar(4, 2, operations=[*EXACT]).random(seed)[0]
    inputs = np.random.default_rng(seed).normal(size=(12, 4))
    assume(all(np.isfinite(bank).all() for bank in registers_of(program.effective(), inputs)))
    text = equations(_core.Model(program, "absolute", SIGNALS.engine), SIGNALS, digits=17)
    np.testing.assert_array_equal(read(text, inputs), program.run(inputs))


@given(programs(inputs=4, outputs=2))
def test_functions_are_written_by_their_names(program):
    inputs = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 4))
    banks = [*registers_of(program.effective(), inputs)]
    assume(all((np.abs(bank) < 1e3).all() for bank in banks))
    text = equations(_core.Model(program, "absolute", SIGNALS.engine), SIGNALS, digits=17)
    np.testing.assert_allclose(read(text, inputs), program.run(inputs), rtol=1e-6, atol=1e-6)


def test_sums_are_written_without_brackets_where_the_order_may_be_turned():
    lines = ["r6 = r0 - r1", "r6 = r2 + r6", "r4 = r6 - r3", "r7 = r0 + r1", "r8 = r2 + r3", "r5 = r7 + r8"]
    program = _core.Program.parse(program_text(4, 2, 9, [lines]))
    text = equations(_core.Model(program, "absolute", SIGNALS.engine), SIGNALS)
    assert "x[k+1] = x - v + u_scaled - t1" in text
    assert "v[k+1] = x + v + (u_scaled + t1)" in text  # which rounds otherwise than from left to right


def test_an_increment_is_written_as_the_state_and_what_is_added():
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r0 * 0.5", "r5 = r1 / r2"]]))
    model = _core.Model(program, "increment", SIGNALS.engine)
    inputs = np.array([[1.0, 2.0, 0.5, 0.1], [3.0, -2.0, 0.0, 0.1]])
    found = read(equations(model, SIGNALS, digits=17), inputs)
    scales = np.array([2.0, 1.0])
    assert same_bits(found, model.step(inputs[:, :2], inputs[:, 2:] * scales))


def test_an_acceleration_is_written_as_derivatives():
    program = _core.Program.parse(program_text(4, 1, 5, [["r4 = r0 * -0.5", "r4 = r4 + r2"]]))
    text = equations(_core.Model(program, "acceleration", SIGNALS.engine), SIGNALS)
    assert "d x / dt = v" in text
    assert "d v / dt = x * (-0.5) + u_scaled" in text
    assert same_bits(read(text, [[2.0, 7.0, 0.25, 0.0]]), [[7.0, -0.75]])


def test_the_legend_says_what_the_symbols_mean():
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r2 / r3", "r5 = sqrt(r0)"]]))
    text = equations(_core.Model(program, "absolute", SIGNALS.engine), SIGNALS)
    assert "# u_scaled = u / 2, u in V" in text
    assert "# a ÷ b = a / b where |b| > 1e-06, otherwise a" in text
    assert "# sqrt(a) = √|a|" in text
    assert "0.1 s later" in text and "x in m" in text


def test_what_is_used_twice_gets_one_name_that_no_signal_has():
    page = ["r4 = r0 * r1", "r5 = sqrt(r4)", "r4 = r4 + r5"]
    program = _core.Program.parse(program_text(4, 2, 6, [page]))
    text = equations(_core.Model(program, "absolute", SIGNALS.engine), SIGNALS)
    names = [line.split(" = ")[0] for line in text.splitlines() if re.match(r"t_+\d+ = ", line)]
    assert len(names) == len(set(names)) > 0
    assert text.count("x * v") == 1


def test_introns_are_not_written():
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r1 * 99.0", "r4 = r0 + 1.0"]]))
    assert "99" not in equations(_core.Model(program, "absolute", SIGNALS.engine), SIGNALS)


@pytest.mark.parametrize("digits", [1, 3, 6])
def test_digits_round_the_constants(digits):
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r0 * 0.123456789"]]))
    text = equations(_core.Model(program, "absolute", SIGNALS.engine), SIGNALS, digits)
    assert f"x[k+1] = x * {0.123456789:.{digits}g}" in text
