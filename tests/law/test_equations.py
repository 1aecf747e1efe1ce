"""The printed equations, read again by a small parser and by SymPy, give what the engine computes."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import sympy
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import twinloop as tl
from law_twins import TWINS, twin_of
from oracles import EXACT, evaluate, registers_of, same_bits
from strategies import exact_programs, program_text, programs, rows
from twinloop import _core
from twinloop.identification.terms.pool import Pool
from twinloop.law.equations import Equations
from twinloop.law.forms import FORMS
from twinloop.law.law import Law

SIGNALS = tl.Signals(
    states=[tl.State("x", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="x")],
    commands=[tl.Command("u", "V", (-2.0, 2.0)), tl.Command("t1", "V", (-1.0, 1.0))],
    dt=0.1,
)
NAMES = ["x", "v", "u_scaled", "t1"]


def equations(*law, **as_said):
    return str(Equations(*law, **as_said))


def law_of(program, form="absolute", **actuation):
    return Law.of(_core.Model(program, form, SIGNALS.engine, **actuation), SIGNALS)


def parsed(inputs, outputs, registers, *pages):
    return _core.Program.parse(program_text(inputs, outputs, registers, list(pages)))


def written(text):
    """Left and right side of each equation, lines that go on joined and notes taken away."""
    found = []
    for line in text.splitlines():
        bare = line.split("#")[0].rstrip()
        if not bare:
            continue
        if " = " in bare or bare.endswith(" ="):
            found.append([side.strip() for side in bare.split(" =", 1)])
        else:
            sign = bare.lstrip()[0] in "+-"
            assert sign or not found[-1][1], "a line that goes on begins with a sign"
            found[-1][1] += " " + bare.lstrip()
    return found


def read(text, inputs):
    """Values of the equations' right sides in order; inputs (rows, 4), commands scaled."""
    values = dict(zip(NAMES, np.asarray(inputs, dtype=float).T, strict=True))
    found = []
    for left, right in written(text):
        value = np.broadcast_to(evaluate(right, values), len(inputs))
        if left.isidentifier():
            assert left not in values, f"{left} is defined twice"
            values[left] = value
        else:
            found.append(value)
    return np.array(found).T


def read_by_sympy(text, inputs):
    """The same, each line read by SymPy."""
    symbols = {name: sympy.Symbol(name, real=True) for name in NAMES}
    parts, found = {}, []
    for left, right in written(text):
        whole = sympy.sympify(right, locals=symbols | parts)
        if left.isidentifier():
            parts[left] = whole
            continue
        compute = sympy.lambdify([symbols[name] for name in NAMES], whole, "numpy")
        with np.errstate(all="ignore"):
            found.append(np.broadcast_to(compute(*np.asarray(inputs, dtype=float).T), len(inputs)))
    return np.array(found, dtype=float).T


def each_line_is_read_by_sympy(text):
    for line in text.splitlines():
        bare = line.split("#")[0].strip()
        if bare:
            sympy.sympify(bare.split(" = ", 1)[-1])


def test_names_that_sympy_has_meanings_for_are_read_with_locals_as_the_docs_say():
    states = (tl.State("I", "A", 1.0), tl.State("beta", "rad", 1.0))
    signals = replace(SIGNALS, states=states, commands=(tl.Command("N", "V", (-1.0, 1.0)),))
    pool = Pool(3)
    program = pool.program_of_sums([{pool.product(0, 1): 2.0, 2: 1.0}, {pool.product(0, 1): 3.0, 2: 1.0}])
    law = Law.of(_core.Model(program, "absolute", signals.engine), signals)
    symbols = {name: sympy.Symbol(name) for name in ("I", "beta", "N")}
    for _, right in written(equations(law)):
        assert sympy.sympify(right, locals=symbols).free_symbols == set(symbols.values())
        with pytest.raises(TypeError):
            sympy.sympify(right)
    assert "`locals`" in tl.Twin.equations.__doc__


def tame(program, inputs, size=1e3):
    """Whether no register is large, and no divisor so small that a division is protected, or nearly."""
    effective = program.effective()
    banks = list(registers_of(effective, inputs))
    with np.errstate(all="ignore"):
        if not all((np.abs(bank) < size).all() for bank in banks):
            return False
        for bank, (name, _, _, second) in zip(banks, effective.instructions, strict=False):
            divisor = bank[second] if isinstance(second, int) else second
            if name == "/" and (np.abs(divisor) < 1e-2).any():
                return False
    return True


@given(st.data())
def test_the_exact_equations_give_what_the_program_computes(data):
    program = data.draw(exact_programs(inputs=4, outputs=2))
    inputs = data.draw(rows(4, size=50.0))
    assume(all(np.isfinite(bank).all() for bank in registers_of(program.effective(), inputs)))
    text = equations(law_of(program), digits=17)
    np.testing.assert_array_equal(read(text, inputs), program.run(inputs))
    assert all(len(line) <= 100 for line in text.splitlines())


@given(st.integers(0, 2**32 - 1))
def test_equations_of_whole_random_programs_give_what_they_compute(seed):
    program = _core.Grammar(4, 2, operations=[*EXACT]).random(seed)[0]
    inputs = np.random.default_rng(seed).normal(size=(12, 4))
    assume(all(np.isfinite(bank).all() for bank in registers_of(program.effective(), inputs)))
    text = equations(law_of(program), digits=17)
    np.testing.assert_array_equal(read(text, inputs), program.run(inputs))


@given(programs(inputs=4, outputs=2))
def test_functions_are_written_by_their_names(program):
    inputs = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 4))
    banks = [*registers_of(program.effective(), inputs)]
    assume(all((np.abs(bank) < 1e3).all() for bank in banks))
    text = equations(law_of(program), digits=17)
    np.testing.assert_allclose(read(text, inputs), program.run(inputs), rtol=1e-6, atol=1e-6)


@settings(deadline=None)
@given(programs(inputs=4, outputs=2), st.sampled_from([16, 17]))
def test_sympy_reads_the_equations_and_computes_what_the_program_does(program, digits):
    inputs = np.random.default_rng(0).uniform(-1.5, 1.5, (8, 4))
    assume(tame(program, inputs))
    text = equations(law_of(program), digits=digits)
    each_line_is_read_by_sympy(text)
    np.testing.assert_allclose(read_by_sympy(text, inputs), program.run(inputs), rtol=1e-9, atol=1e-9)
    assert all(len(line) <= 100 for line in text.splitlines())


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_equations_of_a_long_program_fit_their_lines(seed, digits):
    program = _core.Grammar(4, 2, page_length=30, pages=6).random(seed)[0]
    for asked in (digits, 17):
        text = equations(law_of(program), digits=asked)
        assert all(len(line) <= 100 for line in text.splitlines())
        written(text)


def test_products_of_sums_are_multiplied_out_and_like_terms_collected():
    lines = ["r6 = r0 - r1", "r7 = r0 + r1", "r4 = r6 * r7", "r5 = r4 - r6", "r6 = r0 * r0", "r4 = r4 - r6"]
    text = equations(law_of(parsed(4, 2, 8, lines)))
    assert written(text) == [["x[k+1]", "-v**2"], ["v[k+1]", "x**2 - x - v**2 + v"]]
    lines = ["r6 = r2 * 3.0", "r6 = r6 + 0.5", "r4 = r6 * r6", "r5 = r0 / 0.25", "r5 = r5 - 1.0"]
    text = equations(law_of(parsed(4, 2, 8, lines)))
    assert written(text) == [["x[k+1]", "9*u_scaled**2 + 3*u_scaled + 0.25"], ["v[k+1]", "4*x - 1"]]


def test_quotients_are_not_cancelled_for_they_are_protected():
    text = equations(law_of(parsed(4, 2, 6, ["r4 = r0 / r0", "r5 = r0 * r1", "r5 = r5 / r1"])))
    assert written(text) == [["x[k+1]", "x/x"], ["v[k+1]", "x*v/v"]]
    assert "# a/b is protected: a / b where |b| > 1e-06, otherwise a" in text


def test_exact_sums_are_written_without_brackets_where_the_order_may_be_turned():
    lines = ["r6 = r0 - r1", "r6 = r2 + r6", "r4 = r6 - r3", "r7 = r0 + r1", "r8 = r2 + r3", "r5 = r7 + r8"]
    text = equations(law_of(parsed(4, 2, 9, lines)), digits=17)
    assert "x[k+1] = x - v + u_scaled - t1" in text
    assert "v[k+1] = x + v + (u_scaled + t1)" in text  # which rounds otherwise than from left to right


def test_an_increment_is_written_as_the_state_and_what_is_added():
    law = law_of(parsed(4, 2, 6, ["r4 = r0 * 0.5", "r5 = r1 / r2"]), "increment")
    inputs = np.array([[1.0, 2.0, 0.5, 0.1], [3.0, -2.0, 0.0, 0.1]])
    found = read(equations(law, digits=17), inputs)
    scales = np.array([2.0, 1.0])
    assert same_bits(found, law.model().step(inputs[:, :2], inputs[:, 2:] * scales))
    assert "x[k+1] = x + 0.5*x" in equations(law)


def test_an_acceleration_is_written_as_derivatives():
    text = equations(law_of(parsed(4, 1, 5, ["r4 = r0 * -0.5", "r4 = r4 + r2"]), "acceleration"))
    assert "d x / dt = v" in text
    assert "d v / dt = -0.5*x + u_scaled" in text
    assert same_bits(read(text, [[2.0, 7.0, 0.25, 0.0]]), [[7.0, -0.75]])


def stepped(law, state, command):
    """A step of Euler by a law's text alone; its head says of which states derivatives are taken later."""
    text = equations(law, digits=17)
    head = " ".join(line.removeprefix("#").strip() for line in text.split("\n\n")[0].splitlines())
    (dt,) = re.findall(r"x\[k\+1\] = x \+ (\S+) \* d x / dt, of the states as they are", head)
    late = re.search(r", but (.*) of (.*) as (?:it has|they have) become;", head)
    moved, by = ([], []) if late is None else (part.split(", ") for part in late.groups())
    scales = [one.size for one in law.signals.commands]
    names = law.signals.state_names
    values = dict(zip(law.symbols, [*state, *(command / scales)], strict=True))
    slopes = dict(written(text))
    after = dict(values)
    for name in sorted(names, key=lambda name: f"d {name} / dt" in moved):
        seen = values | ({each: after[each] for each in by} if f"d {name} / dt" in moved else {})
        after[name] = values[name] + float(dt) * evaluate(slopes[f"d {name} / dt"], seen)
    return np.array([after[name] for name in names])


@pytest.mark.parametrize(
    "which",
    [
        "explicit Euler",
        "semi-implicit Euler",
        "kinematics, explicit Euler",
        "kinematics, semi-implicit Euler",
    ],
)
def test_a_step_of_euler_is_written_as_derivatives_and_the_step_in_words(which):
    law = Law.of(TWINS[which]().model, TWINS[which]().signals)
    at_once = replace(law, actuation=law.actuation.direct(law.signals))
    text = equations(law)
    assert ("become" in text) == ("semi-implicit" in which)
    random = np.random.default_rng(4)
    for _ in range(5):
        state = random.uniform(-1.2, 1.2, law.signals.n_x)
        command = np.array([random.uniform(*one.bounds) for one in law.signals.commands])
        (expected,) = at_once.model().step([state], [command])
        np.testing.assert_allclose(stepped(law, state, command), expected, rtol=1e-12, atol=1e-14)


def test_states_that_others_move_by_turns_are_each_named_in_the_step():
    states = [tl.State("x", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="x"),
              tl.State("a", "m/s2", 1.0, derivative_of="v")]  # fmt: skip
    signals = tl.Signals(states=states, commands=[tl.Command("u", "V", (-1.0, 1.0))], dt=0.1)
    program = parsed(4, 1, 6, ["r4 = r3 * 2.0", "r5 = r0 * 0.5", "r4 = r4 - r5"])
    law = Law.of(_core.Model(program, "semi-implicit-euler", signals.engine), signals)
    assert "but d x / dt, d v / dt of v, a as they have become" in " ".join(equations(law).split())


def perturbed(law, share):
    """The law with each constant, lag, time and offset a little larger."""
    program = str(law.model().program)
    program = re.sub(r"-?\d+\.\d+(?:e-?\d+)?", lambda m: repr(float(m[0]) * (1.0 + share)), program)
    actuators = [
        (each.lag * (1.0 + share), each.delay, each.rest, each.ramp) for each in law.actuation.actuators
    ]
    hidden = [each._replace(time=each.time * (1.0 + share)) for each in law.actuation.hidden]
    offsets = [offset * (1.0 + share) for offset in law.offsets]
    signals = law.signals
    found = _core.Model(
        _core.Program.parse(program),
        law.form,
        signals.engine,
        actuators,
        hidden,
        offsets if any(offsets) else (),
    )
    return Law.of(found, signals)


LONG = ["r4 = sin(r0)", "r4 = r4 * -9.0", "r5 = cos(r0)", "r6 = tanh(r1)", "r5 = r5 * r6", "r5 = r5 * r1",
        "r5 = r5 * r2", "r6 = sin(r1)", "r5 = r5 * r6", "r6 = r3 * 0.25", "r6 = cos(r6)", "r5 = r5 * r6",
        "r5 = r5 * 0.125", "r4 = r4 + r5", "r5 = r4 * r1", "r4 = r4 + r5"]  # fmt: skip
"""Terms of more than half a line."""
FAR = tl.Signals(
    states=[tl.State(f"{axis}_of_the_hull", "rad", 3.0) for axis in ("roll", "pitch", "yaw")]
    + [tl.State(f"{axis}_rate_of_the_hull", "rad/s", 5.0) for axis in ("roll", "pitch", "yaw")],
    commands=[tl.Command("thrust", "N", (-2.0, 2.0))],
    dt=0.05,
    kinematics=tl.RigidBody(
        tuple(f"{axis}_of_the_hull" for axis in ("roll", "pitch", "yaw")),
        tuple(f"{axis}_rate_of_the_hull" for axis in ("roll", "pitch", "yaw")),
    ),
)
TURNED = ["r7 = r6 * 2.0", "r8 = r3 * r5", "r8 = r8 * -0.3", "r9 = sin(r0)"]
LAWS = {
    **TWINS,
    **{f"long terms, {form}": partial(twin_of, LONG, form) for form in FORMS},
    **{f"long names, {form}": partial(twin_of, TURNED, form, FAR, 7) for form in FORMS[2:]},
}


@pytest.mark.parametrize("digits", [6, 17])
@pytest.mark.parametrize("which", LAWS)
def test_each_line_of_every_form_is_read_by_sympy_and_has_its_deviation(which, digits):
    twin = LAWS[which]()
    law = Law.of(twin.model, twin.signals)
    members = [law, *(perturbed(law, share) for share in (0.01, -0.02))]
    text = equations(law, members, digits)
    each_line_is_read_by_sympy(text)
    assert all(len(line) <= 100 for line in text.splitlines())
    assert len(written(text)) >= law.signals.n_x + len(law.actuation.hidden)
    if digits == 17:
        return
    head, body = text.split("\n\n")
    slow = {each for each in law.actuation.actuators}
    numbers = sum((each.lag > 0.0) + (each.ramp > 0.0) for each in slow)
    assert head.count("±") == 1 + numbers + np.count_nonzero(law.offsets)
    for left, right, said in blocks(body):
        part = re.fullmatch(r"t_*\d+", left)  # whose constants have theirs where it is used
        constants = re.findall(r"(?<![\w*])\d", right)
        assert part or not constants or "±" in said, f"{left} = {right}"


ENDLESS = "n" * 72


@pytest.mark.parametrize("committee", [False, True])
@pytest.mark.parametrize("form", FORMS[:3])
def test_a_line_breaks_behind_the_equals_sign_of_a_name_that_fills_it(form, committee):
    signals = tl.Signals(
        [tl.State(ENDLESS, "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of=ENDLESS)],
        [tl.Command("u", "V", (-1.0, 1.0))],
        dt=0.1,
    )
    twin = twin_of(["r3 = r0 * -0.125", "r4 = r0 * r1", "r3 = r3 + r4", "r4 = r0 * 0.5"], form, signals, 3)
    law = Law.of(twin.model, signals)
    members = [law, perturbed(law, 0.01)] if committee else []
    text = equations(law, members)
    assert all(len(line) <= 100 for line in text.splitlines())
    if form != "acceleration":
        assert f"{ENDLESS}[k+1] =\n    " in text
    assert all(right for _, right in written(text))


def blocks(body):
    """Left side, right side and notes of each equation."""
    found = []
    for line in body.splitlines():
        bare, _, note = line.partition("#")
        if " = " in bare or bare.endswith(" ="):
            found.append([*bare.split(" =", 1), ""])
        else:
            found[-1][1] += bare
        found[-1][2] += note
    return found


def test_the_legend_says_what_the_symbols_mean():
    text = equations(law_of(parsed(4, 2, 6, ["r4 = r2 / r3", "r5 = sqrt(r0)"])))
    assert "# u_scaled = u / 2, u in V" in text
    assert "# a/b is protected: a / b where |b| > 1e-06, otherwise a" in text
    assert "sqrt(abs(x))" in text
    assert "0.1 s later" in text and "x in m" in text


def test_what_is_used_twice_gets_one_name_that_no_signal_has():
    law = law_of(parsed(4, 2, 6, ["r4 = r0 * r1", "r5 = sqrt(r4)", "r4 = r4 + r5"]))
    text = equations(law, digits=17)
    names = [line.split(" = ")[0] for line in text.splitlines() if re.match(r"t_+\d+ = ", line)]
    assert len(names) == len(set(names)) > 0
    assert text.count("x*v") == 1
    lines = [
        "r6 = r0 * 0.125",
        "r6 = r6 + r1",
        "r7 = r2 * 0.25",
        "r6 = r6 + r7",
        "r4 = tanh(r6)",
        "r5 = r4 * r0",
    ]
    long = equations(law_of(parsed(4, 2, 8, lines)))
    assert written(long)[0] == ["t_1", "tanh(0.125*x + v + 0.25*u_scaled)"]


def test_introns_are_not_written():
    assert "99" not in equations(law_of(parsed(4, 2, 6, ["r4 = r1 * 99.0", "r4 = r0 + 1.0"])))


@pytest.mark.parametrize("digits", [1, 3, 6])
def test_digits_round_the_constants(digits):
    text = equations(law_of(parsed(4, 2, 6, ["r4 = r0 * 0.123456789"])), digits=digits)
    assert f"x[k+1] = {0.123456789:.{digits}g}*x" in text


# The committee's ±


def member(drag, lag=0.0, inside=None, extra=()):
    lines = [f"r4 = r1 * {drag}", *extra]
    if inside is not None:
        lines += [f"r5 = r0 * {inside}", "r5 = sin(r5)", "r5 = r5 * -3.0", "r4 = r4 + r5"]
    actuators = [(lag, 0, None, 0.0), (0.0, 0, None, 0.0)] if lag else None
    return law_of(parsed(4, 1, 6, lines), "acceleration", actuators=actuators)


def test_each_constant_has_the_standard_deviation_of_its_term_over_the_committee():
    drags = [-0.5, -0.52, -0.47]
    extra = ["r5 = r0 * 0.25", "r4 = r4 + r5"]
    members = [member(drag, extra=extra if i < 2 else ()) for i, drag in enumerate(drags)]
    text = equations(members[0], members)
    (line,) = (line for line in text.splitlines() if "0.5*v" in line)
    assert line.endswith(f"# ± {np.std(drags, ddof=1):.2g}")
    (line,) = (line for line in text.splitlines() if "0.25*x" in line)
    assert line.endswith("# ± 0 (2 of 3)")
    assert "3 models of the committee" in text
    each_line_is_read_by_sympy(text)
    alone = equations(members[0], [members[0], members[2], members[2]])
    assert any("0.25*x" in line and line.endswith("# (1 of 3)") for line in alone.splitlines())


def test_a_committee_of_copies_says_nothing_of_how_far_constants_are_off():
    members = [member(-0.5, lag=0.05, inside=2.0) for _ in range(8)]
    text = equations(members[0], members)
    assert "±" not in text and "committee" not in text
    assert text == equations(members[0])


def test_constants_inside_functions_and_lags_have_theirs():
    insides, lags = [2.0, 2.1, 1.9, 2.05], [0.05, 0.06, 0.055, 0.05]
    members = [member(-0.5, lag, inside) for lag, inside in zip(lags, insides, strict=True)]
    text = equations(members[0], members)
    (line,) = (line for line in text.splitlines() if "sin(2*x)" in line)
    assert f"± 0, inside ± {np.std(insides, ddof=1):.2g}" in line
    assert f"a lag of 0.05 ± {np.std(lags, ddof=1):.2g} s" in text


def test_a_limited_rate_is_told_in_the_unit_of_its_command():
    lines = ["r4 = r1 * -0.5"]
    laws = [
        law_of(parsed(4, 1, 6, lines), "acceleration", actuators=[(0.0, 0, None, ramp), (0.0, 0, None, 0.0)])
        for ramp in (0.5, 0.4)
    ]
    text = " ".join(equations(laws[0], laws).replace("#", "").split())
    size, unit = laws[0].signals.commands[0].size, laws[0].signals.commands[0].unit or "1"
    name, rates = laws[0].signals.command_names[0], [size / 0.5, size / 0.4]
    assert (
        f"{name}: act with a rate of at most {rates[0]:g} ± {np.std(rates, ddof=1):.2g} {unit}/s, from"
        in text
    )


def test_a_constant_that_all_members_have_alike_does_not_differ_by_the_rounding_of_a_mean():
    # The mean of six numbers 0.1 is not 0.1.
    assert np.std([0.1] * 6, ddof=1) > 0.0
    members = [member(drag, inside=0.1) for drag in (-0.5, -0.52, -0.47, -0.51, -0.49, -0.48)]
    text = equations(members[0], members)
    (line,) = (line for line in text.splitlines() if "sin(0.1*x)" in line)
    assert line.endswith("# ± 0")


def test_terms_that_share_a_constant_share_a_line_and_its_deviation():
    def pair(weight):
        lines = ["r5 = r2 * r2", "r6 = r3 * r3", "r5 = r5 - r6", f"r4 = r5 * {weight}"]
        return law_of(parsed(4, 1, 7, lines), "acceleration")

    text = equations(pair(3.5), [pair(3.5), pair(3.7)])
    assert f"d v / dt = 3.5*u_scaled**2 - 3.5*t1**2  # ± {np.std([3.5, 3.7], ddof=1):.2g}" in text


def test_a_hidden_state_has_an_equation_that_sympy_reads():
    program = parsed(5, 1, 6, ["r5 = r4 * 2.0"])
    hidden = [((0, 1), True, 0.25, 3.0, (), False, 0.0, 0.0, 0.0)]
    model = _core.Model(
        program, "acceleration", SIGNALS.engine, [(0.0, 0, None, 0.0)] * 2, hidden, (0.004, 0.0)
    )
    text = equations(Law.of(model, SIGNALS))
    assert "d hidden / dt = u_scaled**2/2 + t1**2/2 - 0.25 - hidden/3" in text
    assert "# x is read 0.004 s later" in text and "as sent" not in text
    each_line_is_read_by_sympy(text)


@pytest.mark.parametrize(
    ("late", "words"),
    [((0,), "hidden: knows u as sent, not as it acts"), ((0, 1), "u, t1 as sent, not as they act")],
)
def test_a_hidden_state_that_commands_fill_by_themselves_is_said_to_know_them_as_sent(late, words):
    program = parsed(5, 1, 6, ["r5 = r4 * 2.0"])
    hidden = [((0, 1), True, 0.25, 3.0, (), False, 0.0, 0.0, 0.0)]
    actuators = [(0.2, 3, None, 0.0) if place in late else (0.0, 0, None, 0.0) for place in range(2)]
    model = _core.Model(program, "acceleration", SIGNALS.engine, actuators, hidden, (0.0, 0.0))
    text = " ".join(equations(Law.of(model, SIGNALS)).replace("#", " ").split())
    assert words in text
