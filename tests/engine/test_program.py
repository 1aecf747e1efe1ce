"""Programs: what they compute, which of their instructions matter, their text, and how they vary."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from oracles import EXACT, UNARY, needed, run_program, same_bits
from strategies import exact_programs, program_text, programs, rows, seeds
from twinloop import InvalidInput, _core

GRAMMAR = _core.Grammar(
    3, 2, operations=["+", "-", "*", "/", "min", "max", "sin", "cos", "tanh", "exp", "sqrt", "abs"]
)


def single(instruction, inputs=2):
    return _core.Program.parse(program_text(inputs, 1, inputs + 1, [[instruction]]))


@given(st.data())
def test_a_program_computes_what_its_instructions_say_to_the_last_bit(data):
    program = data.draw(exact_programs())
    inputs = data.draw(rows(program.inputs))
    assert same_bits(program.run(inputs), run_program(program, inputs))


@given(seeds, st.integers(1, 70))
def test_a_random_program_computes_the_same_in_every_vector_width(seed, count):
    program = _core.Grammar(4, 3, operations=EXACT).random(seed)[0]
    inputs = np.random.default_rng(seed % 2**32).normal(size=(count, 4)) * 10.0
    expected = run_program(program, inputs)
    for width in _core.vector_widths():
        assert same_bits(program.run(inputs, _core.Workers(width=width)), expected)


@pytest.mark.parametrize("name", ["sin", "cos", "tanh", "exp"])
def test_a_transcendental_function_is_close_to_numpys(name):
    x = np.concatenate([np.linspace(-30.0, 30.0, 4001), [0.0, 1e-300, -1e-12, 5e-324, 700.0]])[:, None]
    found = single(f"r1 = {name}(r0)", inputs=1).run(x)
    with np.errstate(over="ignore"):
        np.testing.assert_allclose(found, getattr(np, name)(x), rtol=1e-12, atol=1e-300)


def test_composed_functions_pass_their_values_on():
    text = program_text(1, 1, 4, [["r2 = sin(r0)", "r3 = tanh(r2)"], ["r2 = cos(r3)", "r1 = r2 * r3"]])
    x = np.linspace(-2.0, 2.0, 101)[:, None]
    expected = np.cos(np.tanh(np.sin(x))) * np.tanh(np.sin(x))
    np.testing.assert_allclose(_core.Program.parse(text).run(x), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (3.0, 2.0, 1.5),
        (3.0, 0.0, 3.0),
        (3.0, 1e-6, 3.0),
        (3.0, -1e-6, 3.0),
        (3.0, 1.0000001e-6, 3.0 / 1.0000001e-6),
        (-3.0, -2e-6, 1.5e6),
        (3.0, float("nan"), 3.0),
        (3.0, float("inf"), 0.0),
    ],
)
def test_division_leaves_the_dividend_where_the_divisor_is_small(a, b, expected):
    assert single("r2 = r0 / r1").run([[a, b]])[0, 0] == expected


def test_the_square_root_is_of_the_magnitude():
    assert single("r2 = sqrt(r0)").run([[-9.0, 0.0]])[0, 0] == 3.0


def test_outputs_and_spare_registers_are_zero_at_the_start():
    program = _core.Program.parse(program_text(1, 2, 4, [["r1 = r3 + r2"]]))
    assert program.run([[7.0]]).tolist() == [[0.0, 0.0]]


# Introns


@given(st.data())
def test_a_program_without_its_introns_gives_the_same_outputs(data):
    program = data.draw(exact_programs())
    inputs = data.draw(rows(program.inputs))
    assert same_bits(program.effective().run(inputs), run_program(program, inputs))


@given(programs())
def test_what_is_kept_is_what_has_a_path_to_an_output(program):
    paths = needed(program)
    kept = [i for i, path in zip(program.instructions, paths, strict=True) if path]
    assert program.effective().instructions == kept
    expected = 1.0 - sum(paths) / len(paths) if paths else 0.0
    assert program.intron_share == pytest.approx(expected, abs=1e-15)


@given(programs())
def test_taking_introns_out_twice_is_taking_them_out_once(program):
    effective = program.effective()
    assert effective.effective() == effective
    assert effective.intron_share == 0.0
    assert len(effective.page_lengths) == len(program.page_lengths)


@given(seeds)
def test_random_programs_of_the_paper_are_mostly_introns_and_none_too_many(seed):
    program = _core.Grammar(10, 6).random(seed)[0]
    assert program.effective().instructions == [
        i for i, path in zip(program.instructions, needed(program), strict=True) if path
    ]


def test_an_overwritten_result_is_an_intron():
    program = _core.Program.parse(program_text(1, 1, 2, [["r1 = r0 * 5.0", "r1 = r0 + 1.0"]]))
    assert program.effective().instructions == [("+", 1, 0, 1.0)]
    assert program.intron_share == 0.5


# Text


@given(programs())
def test_a_program_survives_being_written_and_read(program):
    again = _core.Program.parse(str(program))
    assert again == program
    assert again.instructions == program.instructions
    assert again.page_lengths == program.page_lengths


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_constant_survives_to_the_last_bit(constant):
    program = single(f"r2 = r0 + {constant!r}")
    found = _core.Program.parse(str(program)).instructions[0][3]
    assert same_bits(found, constant)


@pytest.mark.parametrize("line", ["r2 = min(r0, r1)", "r2 = max(r0, -0.5)", "r2 = tanh(r1)", "r2 = r0 - 3.0"])
def test_every_shape_of_instruction_reads_back_as_it_was_written(line):
    assert line in str(single(line))


HEADER = "program inputs=2 outputs=1 registers=4\n"


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("", 1, "header"),
        ("programme inputs=2 outputs=1 registers=4", 1, "header"),
        ("program inputs=2 outputs=1", 1, "header"),
        ("program inputs=2 outputs=1 registers=2", 1, "registers"),
        ("program inputs=0 outputs=1 registers=4", 1, "input"),
        ("\n\nprogram inputs=x outputs=1 registers=4", 3, "header"),
        (HEADER + "r2 = r0 + r1", 2, "page 1"),
        (HEADER + "page 2", 2, "page 1"),
        (HEADER + "page 1\n  r2 = r0 + r1\n  r2 = r0 % r1", 4, "operation"),
        (HEADER + "page 1\n  r2 = r0 +", 3, "instruction"),
        (HEADER + "page 1\n  r9 = r0 + r1", 3, "r9"),
        (HEADER + "page 1\n  r2 = r0 + r4", 3, "r4"),
        (HEADER + "page 1\n  r2 = r0 + inf", 3, "finite"),
        (HEADER + "page 1\n  r2 = r0 + nan", 3, "finite"),
        (HEADER + "page 1\n  r2 = sin(r0, r1)", 3, "one operand"),
        (HEADER + "page 1\n  r2 = min(r0)", 3, "two operands"),
        (HEADER + "page 1\n  r2 = sin(r0", 3, "instruction"),
        (HEADER + "page 1\n  r2 = 0.5 * r0", 3, "register"),
        (HEADER + "page 1\n  r99999999 = r0 + r1", 3, "register"),
    ],
)
def test_a_bad_text_names_its_line(text, line, word):
    with pytest.raises(InvalidInput, match=rf"line {line}\b") as refusal:
        _core.Program.parse(text)
    assert word in str(refusal.value)
    assert "expected" in str(refusal.value)


@pytest.mark.parametrize(
    "header",
    [
        "program inputs=2 outputs=1 registers=1000000000000",
        "program inputs=9999999999999999999 outputs=9999999999999999999 registers=3",
        "program inputs=18446744073709551615 outputs=1 registers=18446744073709551615",
    ],
)
def test_a_text_that_asks_for_endless_memory_is_refused(header):
    with pytest.raises(InvalidInput, match="line 1"):
        _core.Program.parse(header)


def test_a_text_of_endless_instructions_is_refused():
    with pytest.raises(InvalidInput, match="at most 32768 instructions"):
        _core.Program.parse(HEADER + "page 1\n" + "r2 = r0 + r1\n" * 32769)


@pytest.mark.parametrize(
    "hostile",
    [
        {"pages": 2**40, "page_length": 2**40},
        {"pages": 0},
        {"page_length": 0},
        {"spare_registers": 2**40},
        {"operations": []},
        {"operations": ["+", "pow"]},
        {"constant_share": 1.5},
        {"constant_share": float("nan")},
        {"constant_low": 0.0},
        {"constant_low": 10.0, "constant_high": 1.0},
        {"constant_high": float("inf")},
        {"constant_step": -1.0},
        {"mutation_rate": -0.1},
        {"aligned_pages": 2.0},
    ],
)
def test_a_grammar_that_no_program_can_have_is_refused(hostile):
    with pytest.raises(InvalidInput, match="expected"):
        _core.Grammar(2, 1, **hostile)


def test_inputs_of_another_width_are_refused():
    with pytest.raises(InvalidInput, match="expected 2 columns"):
        single("r2 = r0 + r1").run([[1.0, 2.0, 3.0]])


# Random programs and variation


@given(seeds)
def test_a_random_program_has_the_shape_of_its_grammar(seed):
    grammar = _core.Grammar(3, 2, spare_registers=1, pages=4, page_length=7, operations=["*", "abs"])
    program = grammar.random(seed)[0]
    assert (program.inputs, program.outputs, program.registers) == (3, 2, 6)
    assert program.page_lengths == [7, 7, 7, 7]
    for name, destination, first, second in program.instructions:
        assert name in ("*", "abs") and 0 <= destination < 6 and 0 <= first < 6
        assert (second is None) == (name in UNARY)
        if isinstance(second, float):
            assert 1e-3 <= abs(second) <= 10.0


@given(seeds)
def test_inputs_are_never_written_where_that_is_forbidden(seed):
    grammar = _core.Grammar(3, 2, writable_inputs=False, mutation_rate=1.0)
    program = grammar.random(seed)[0]
    for candidate in (program, grammar.mutate(program, seed)):
        assert all(destination >= 3 for _, destination, _, _ in candidate.instructions)


@pytest.mark.parametrize(("share", "kind"), [(1.0, float), (0.0, int)])
def test_the_share_of_constants_is_kept_at_its_ends(share, kind):
    programs = _core.Grammar(3, 2, constant_share=share).random(1, 20)
    assert {type(second) for p in programs for *_, second in p.instructions} == {kind}


def test_constants_are_log_uniform_with_random_signs():
    found = [s for p in _core.Grammar(3, 2, constant_share=1.0).random(3, 100) for *_, s in p.instructions]
    decades = np.log10(np.abs(found))
    shares, _ = np.histogram(decades, bins=[-3, -2, -1, 0, 1])
    assert (abs(shares / len(found) - 0.25) < 0.03).all()
    assert abs(np.mean(np.array(found) > 0.0) - 0.5) < 0.03


def test_the_same_seed_draws_the_same_programs_and_another_draws_others():
    assert GRAMMAR.random(5, 3) == GRAMMAR.random(5, 3)
    assert GRAMMAR.random(5, 3) != GRAMMAR.random(6, 3)
    assert GRAMMAR.random(5, 3)[0] != GRAMMAR.random(5, 3)[1]


def differing(a, b):
    return [i for i, (x, y) in enumerate(zip(a.instructions, b.instructions, strict=True)) if x != y]


@given(seeds, seeds)
def test_a_mutation_without_a_rate_moves_one_field_of_one_instruction_at_most(seed, other):
    grammar = _core.Grammar(3, 2, mutation_rate=0.0)
    parent = grammar.random(seed)[0]
    child = grammar.mutate(parent, other)
    assert child.page_lengths == parent.page_lengths
    changed = differing(parent, child)
    assert len(changed) <= 1
    for i in changed:
        fields = zip(parent.instructions[i], child.instructions[i], strict=True)
        assert sum(x != y for x, y in fields) == 1


def test_a_mutation_changes_an_instruction_unless_it_draws_the_same_field_again():
    grammar = _core.Grammar(10, 6, mutation_rate=0.0)
    parent = grammar.random(0)[0]
    changed = [len(differing(parent, grammar.mutate(parent, seed))) for seed in range(400)]
    assert np.mean(changed) > 0.85
    touched = {i for seed in range(400) for i in differing(parent, grammar.mutate(parent, seed))}
    assert len(touched) > 45  # of fifty: every place has its chance


def test_the_mutation_rate_is_that_of_the_instructions():
    grammar = _core.Grammar(10, 6, mutation_rate=0.4)
    parent = grammar.random(0)[0]
    changed = [len(differing(parent, grammar.mutate(parent, seed))) for seed in range(200)]
    assert 0.3 * 50 < np.mean(changed) < 0.4 * 50  # a field may be drawn as it was


@given(seeds, seeds, st.sampled_from([0.0, 1.0]))
def test_crossover_exchanges_one_page_and_loses_nothing(seed, other, aligned):
    grammar = _core.Grammar(3, 2, pages=4, page_length=5, aligned_pages=aligned)
    first, second = grammar.random(seed, 2)
    one, two = grammar.crossover(first, second, other)

    def pages(program):
        return [tuple(program.instructions[i : i + 5]) for i in range(0, 20, 5)]

    assert Counter(pages(one) + pages(two)) == Counter(pages(first) + pages(second))
    moved_one = [i for i in range(4) if pages(one)[i] != pages(first)[i]]
    moved_two = [i for i in range(4) if pages(two)[i] != pages(second)[i]]
    assert len(moved_one) == len(moved_two) == 1
    assert pages(one)[moved_one[0]] == pages(second)[moved_two[0]]
    if aligned:
        assert moved_one == moved_two


@given(programs(inputs=2, outputs=1), programs(inputs=2, outputs=1), seeds)
def test_crossover_of_pages_of_any_length_keeps_the_lengths_of_both_together(first, second, seed):
    assume(first.registers == second.registers)
    grammar = _core.Grammar(2, 1, spare_registers=first.registers - 3)
    one, two = grammar.crossover(first, second, seed)
    lengths = Counter(first.page_lengths + second.page_lengths)
    assert Counter(one.page_lengths + two.page_lengths) == lengths
    assert len(one) + len(two) == len(first) + len(second)


def test_half_of_the_crossovers_keep_the_place_of_the_page():
    grammar = _core.Grammar(3, 2, pages=5, page_length=4)
    first, second = grammar.random(1, 2)
    kept = 0
    for seed in range(400):
        one, two = grammar.crossover(first, second, seed)
        kept += differing(first, one)[0] // 4 == differing(second, two)[0] // 4
    assert 0.5 < kept / 400 < 0.7  # half of them, and one in five of the others by chance


def test_a_program_of_another_shape_is_refused():
    program = _core.Grammar(2, 1).random(0)[0]
    with pytest.raises(InvalidInput, match="expected registers"):
        GRAMMAR.mutate(program, 0)
    with pytest.raises(InvalidInput, match="expected registers"):
        GRAMMAR.crossover(GRAMMAR.random(0)[0], program, 0)
