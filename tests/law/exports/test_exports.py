"""What is taken away gives the twin's numbers: run by Python, compiled by a C compiler, read by SymPy."""

import json
import re
import shutil
import subprocess
import sys
import types
import warnings

import numpy as np
import pytest
import sympy
from hypothesis import assume, given, settings

import twinloop as tl
from law_twins import ALL, PENDULUM, SIGNALS, TWINS, flown, twin_of
from oracles import registers_of
from strategies import programs
from twinloop import _core
from twinloop.errors import NotAvailable
from twinloop.law.accuracy import TestErrors
from twinloop.law.exports.c_source import c_source
from twinloop.law.exports.controller_source import controller_c, controller_python
from twinloop.law.exports.python_source import python_source
from twinloop.law.exports.simulations import (
    c_controller,
    c_simulation,
    casadi_simulation,
    control_simulation,
    python_controller,
    python_simulation,
)
from twinloop.law.exports.taking import compared
from twinloop.law.forms import DERIVATIVES
from twinloop.law.noise import CorrelatedDisturbance, Noise
from twinloop.records.reading import LARGEST
from twinloop.remarks import Remark

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
needs_both = pytest.mark.skipif(
    None in map(shutil.which, ("cc", "c++")), reason="needs compilers of C and C++"
)


@ALL
def test_the_python_module_simulates_what_the_twin_does_in_another_process(which, tmp_path):
    twin = TWINS[which]()
    (path,) = twin.export(tmp_path / "taken.py")
    flight = flown(twin, seed=7)
    given = json.dumps([flight.states[0].tolist(), (2.0 * flight.commands).tolist()])
    program = "import json, sys, taken; print(json.dumps(taken.simulate(*json.loads(sys.stdin.read()))))"
    done = subprocess.run(
        [sys.executable, "-I", "-c", f"import sys; sys.path.insert(0, '.')\n{program}"],
        cwd=path.parent, input=given, capture_output=True, text=True, check=True,
    )  # fmt: skip
    expected = twin.simulate_commands(flight.states[0], 2.0 * flight.commands).true_states
    found = np.array(json.loads(done.stdout))[: len(expected)]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@ALL
@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("taken.simulate({x}[1:], [{u}])", "simulate: initial_state: expected"),
        ("taken.simulate({x}, [{u}, {u} + [0.0]])", "simulate: row 1 of commands: expected"),
        ("taken.Twin().step({x} + [0.0], {u})", "step: x: expected"),
        ("taken.Twin().step({x}, {u}[1:])", "step: u: expected"),
    ],
)
def test_the_python_module_refuses_other_than_one_number_a_signal(which, call, said):
    twin = TWINS[which]()
    taken = types.SimpleNamespace()
    exec(compile(str(twin.export("python")), "taken", "exec"), taken.__dict__)
    flight = flown(twin, seed=7)
    x, u = repr(flight.states[0].tolist()), repr(flight.commands[0].tolist())
    with pytest.raises(ValueError, match=re.escape(said)):
        eval(call.format(x=x, u=u), {"taken": taken})


@ALL
@pytest.mark.parametrize("kind", ["casadi", "control"])
def test_modules_for_other_packages_simulate_what_the_twin_does(which, kind, tmp_path):
    pytest.importorskip(kind)
    twin = TWINS[which]()
    (path,) = twin.export(tmp_path / "taken.py", kind=kind)
    flight = flown(twin, seed=7)
    expected = compared(twin.law, twin.simulate_commands(flight.states[0], 2.0 * flight.commands))
    simulate = {"casadi": casadi_simulation, "control": control_simulation}[kind](path.read_text())
    found = simulate(flight.states[0], 2.0 * flight.commands)[: len(expected)]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "which", ["acceleration", "actuators and hidden states", "kinematics", "kinematics, semi-implicit Euler"]
)
def test_casadi_differentiates_a_step_as_the_twin_does(which):
    pytest.importorskip("casadi")
    twin, names = TWINS[which](), {}
    exec(twin.export("casadi"), names)
    step = names["step"]
    state, command = np.full(twin.signals.n_x, 0.3), np.full(twin.signals.n_u, 0.7)
    memory = names["start"](command)
    slopes = step.jacobian()(state, command, memory, 0.0, 0.0)[0].full()
    for i in range(len(state)):
        ahead, behind = (
            twin.predict(state + sign * 1e-6 * np.eye(len(state))[i], command) for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(slopes[:, i], (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-8)


def test_a_missing_package_is_named_and_force_needs_none(monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    twin = TWINS["acceleration"]()
    with pytest.raises(NotAvailable, match=r"twinloop\[casadi\]"):
        twin.export("casadi")
    assert "import casadi as ca" in twin.export("casadi", force=True)


@needs_cc
@ALL
def test_c_compiles_without_a_warning_and_gives_the_same(which, tmp_path):
    twin = TWINS[which]()
    files = twin.export(tmp_path / "my-rig.c")
    assert {file.name for file in files} == {"my-rig.c", "my-rig.h"}
    flight = flown(twin, seed=7)
    n_x, n_u = twin.signals.n_x, twin.signals.n_u
    (tmp_path / "main.c").write_text(
        f"""
#include <stdio.h>
#include "my-rig.h"
int main(void)
{{
    my_rig_memory memory;
    double x[{n_x}], u[{n_u}];
    my_rig_reset(&memory);
    for (int i = 0; i < {n_x}; ++i) if (scanf("%lf", &x[i]) != 1) return 1;
    for (;;) {{
        for (int i = 0; i < {n_x}; ++i) printf("%.17g ", x[i]);
        for (int i = 0; i < {n_u}; ++i) if (scanf("%lf", &u[i]) != 1) return 0;
        my_rig_clip(u);
        my_rig_step(&memory, x, u, x);
    }}
}}
"""
    )
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wshadow", "-O2"]
    subprocess.run(["cc", *strict, "-o", "rig", "main.c", "my-rig.c", "-lm"], cwd=tmp_path, check=True)
    numbers = " ".join(
        repr(v) for v in [*flight.states[0].tolist(), *(2.0 * flight.commands).ravel().tolist()]
    )
    done = subprocess.run([tmp_path / "rig"], input=numbers, capture_output=True, text=True, check=True)
    found = np.array(done.stdout.split(), dtype=float).reshape(-1, n_x)
    expected = twin.simulate_commands(flight.states[0], 2.0 * flight.commands).true_states
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=1e-9, atol=1e-9)
    assert "malloc" not in files[0].read_text()


@needs_cc
def test_c_in_single_precision_is_near():
    text = TWINS["acceleration"]().export("c", precision="float")
    assert "double" not in text and "sinf(" in text and "typedef float twin_real;" in text


@settings(deadline=None, max_examples=40)
@given(programs(inputs=4, outputs=2))
def test_any_program_is_taken_away_in_python(program):
    inputs = np.random.default_rng(0).uniform(-2.0, 2.0, (6, 4))
    banks = [*registers_of(program.effective(), inputs)]
    assume(all((np.abs(bank) < 1e6).all() for bank in banks))
    model = _core.Model(program, "absolute", SIGNALS.engine)
    twin = tl.Twin(model, SIGNALS)
    simulate = python_simulation(python_source(twin.law))
    for row in inputs:
        command = np.clip(row[2:] * [2.0, 5.0], [-2.0, 0.0], [2.0, 5.0])
        expected = model.step(row[np.newaxis, :2], command[np.newaxis])[0]
        np.testing.assert_allclose(simulate(row[:2], command[np.newaxis])[1], expected, rtol=1e-9, atol=1e-9)


@needs_cc
@settings(deadline=None, max_examples=12)
@given(programs(inputs=4, outputs=2))
def test_any_program_is_taken_away_in_c(program):
    inputs = np.random.default_rng(0).uniform(-2.0, 2.0, (6, 4))
    assume(all((np.abs(bank) < 1e6).all() for bank in registers_of(program.effective(), inputs)))
    model = _core.Model(program, "absolute", SIGNALS.engine)
    law = tl.Twin(model, SIGNALS).law
    simulate = c_simulation(*c_source(law, "rig"), "rig", law, "double")
    for row in inputs:
        command = np.clip(row[2:] * [2.0, 5.0], [-2.0, 0.0], [2.0, 5.0])
        expected = model.step(row[np.newaxis, :2], command[np.newaxis])[0]
        np.testing.assert_allclose(simulate(row[:2], command[np.newaxis])[1], expected, rtol=1e-9, atol=1e-9)


@ALL
def test_sympy_has_the_equations_with_all_digits(which, tmp_path):
    twin = TWINS[which]()
    (path,) = twin.export(tmp_path / "law.py", kind="sympy")
    names = {}
    exec(path.read_text(), names)
    symbols = [*names["STATES"], *names["COMMANDS"], *names.get("HIDDEN", ())]
    compute = sympy.lambdify(symbols, names["EQUATIONS"], "numpy")
    law = twin.law
    rng = np.random.default_rng(3)
    for row in rng.uniform(0.2, 1.0, (5, len(symbols))):
        found = np.asarray(compute(*row), dtype=float).ravel()
        n_x = twin.signals.n_x
        scales = np.array([command.size for command in twin.signals.commands])
        if law.actuation.hidden or (law.form == "acceleration" and law.actuation.actuators[0].delay):
            program = law.expressions.program(law.outputs, law.inputs)
            np.testing.assert_allclose(
                found[list(twin.signals.driven)], program.run(row[np.newaxis])[0], rtol=1e-12
            )
            continue
        state, command = row[:n_x], row[n_x:] * scales
        if law.form in DERIVATIVES:
            tiny = tl.Signals(twin.signals.states, twin.signals.commands, 1e-5, twin.signals.kinematics)
            after = _core.Model(twin.model.program, law.form, tiny.engine).step(state[None], command[None])[0]
            np.testing.assert_allclose(found, (after - state) / 1e-5, rtol=1e-3, atol=1e-4)
        else:
            after = twin.predict(state, command) - (state if law.form == "increment" else 0.0)
            np.testing.assert_allclose(found, after, rtol=1e-12)


def test_latex_of_a_step_of_euler_says_which_of_the_states_goes_on_by_which():
    text = twin_of(PENDULUM, "semi-implicit-euler").export("latex")
    assert r"\mathit{angle}_{k+1} &= \mathit{angle} + 0.05 \left(\mathit{rate}_{k+1}\right) \\" in text
    assert r"\mathit{rate}_{k+1} &= \mathit{rate} + 0.05 \left(" in text and "mathrm{d}" not in text
    assert r"+ 0.05 \left(\mathit{rate}\right)" in twin_of(PENDULUM, "explicit-euler").export("latex")
    body = TWINS["kinematics, semi-implicit Euler"]().export("latex")
    assert r"\mathit{q}_{k+1} \, \cos\left(\mathit{roll}\right)" in body and "t_" not in body


@pytest.mark.parametrize("form", ["acceleration", "explicit-euler"])
def test_a_long_sum_is_broken_over_lines_that_a_page_holds(form):
    pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    lines = [
        line
        for i, j in pairs
        for line in (f"r5 = r{i} * r{j}", f"r5 = r5 * {0.123456 + i + j}", "r4 = r4 + r5")
    ]
    text = twin_of(lines, form).export("latex")
    rows = text[text.index("{align*}") + 9 : text.index("\\end")].split("\\\\")
    of_rate = rows[1:]
    assert len(rows) > 3 and all(row.lstrip().startswith(r"&\quad + ") for row in of_rate[1:])
    for row in rows:
        assert row.count("&") == 1 and row.count(r"\left") == row.count(r"\right")
        right = re.sub(r"\\[a-zA-Z]+|[\\{}, ]", "", row.split("&")[1])
        assert len(right) <= 70
    assert all(f"{0.123456 + i + j:.6g} " in text for i, j in pairs)
    assert text.count(r"\Bigl(") == text.count(r"\Bigr)") == (form == "explicit-euler")


def test_latex_says_what_the_equations_say():
    text = twin_of(PENDULUM).export("latex")
    assert text.startswith("% Form 'acceleration'") and text.rstrip().endswith(r"\end{align*}")
    assert r"\frac{\mathrm{d} \mathit{angle}}{\mathrm{d} t} &= \mathit{rate} \\" in text
    assert r"\mathit{fan\_scaled}^{2}" in text and r"- 9 \, \sin\left(\mathit{angle}\right)" in text
    assert text.count("{") == text.count("}")


def test_a_twin_comes_back_in_another_process_with_the_same_numbers(tmp_path):
    errors = [TestErrors(0, 1e-5, 2e-5, 0.01, None, 2e-5)]
    lone = TWINS["actuators and hidden states"]()
    noise = Noise(
        np.array([1e-3, 5e-3]),
        np.array([0.0, 1e-3]),
        (CorrelatedDisturbance((1, 0), "acceleration", 0.1, 0.3),),
        0.05,
    )
    twin = tl.Twin(
        lone.model, SIGNALS, errors, members=[lone.model], noise=noise, seed=3, inflation=1.5,
        flights=lone.flights,
    )  # fmt: skip
    (path,) = twin.export(tmp_path / "twin.json")
    again = tl.load_twin(path)
    assert again.equations(17) == twin.equations(17) and again.errors == twin.errors
    assert (again.seed, again.inflation, again.model.offsets) == (3, 1.5, [0.003, 0.0])
    assert again.export("json") == path.read_text()
    flight = flown(twin, seed=5)
    program = (
        "import json, sys, twinloop as tl; x, u = json.loads(sys.stdin.read());"
        "print(json.dumps(tl.load_twin(sys.argv[1]).simulate_commands(x, u).true_states.tolist()))"
    )
    given = json.dumps([flight.true_states[0].tolist(), flight.commands.tolist()])
    done = subprocess.run(
        [sys.executable, "-c", program, path], input=given, capture_output=True, text=True, check=True
    )
    assert np.array(json.loads(done.stdout)).tobytes() == flight.true_states.tobytes()


# Refusals


def test_a_twin_that_does_not_follow_its_flights_is_exported_only_by_force(tmp_path):
    bad = [TestErrors(i, 1.0, 2.0, 0.9, None, 2.0) for i in range(2)]
    twin = twin_of(PENDULUM, errors=bad)
    assert not twin.follows
    with pytest.raises(tl.NotTrusted, match=r"pass --force \(force=True in Python\)"):
        twin.export(tmp_path / "twin.py")
    assert not (tmp_path / "twin.py").exists()
    assert twin.export(tmp_path / "twin.py", force=True) == (tmp_path / "twin.py",)
    # Whoever is handed a file can see that.
    assert (tmp_path / "twin.py").read_text("utf-8").startswith("# Exported by force: its checks")
    for kind in ("c", "sympy", "casadi", "latex"):
        assert "Exported by force" in twin.export(kind, force=True)
    lost = [TestErrors(0, np.inf, np.inf, np.inf, None, np.inf)]
    assert not twin_of(PENDULUM, errors=lost).follows
    assert twin_of(PENDULUM, errors=[TestErrors(0, 1e-5, 2e-5, 0.01, None, 2e-5)]).follows


def test_what_sympy_cannot_say_is_refused():
    twin = twin_of(["r4 = r1 / r0", "r5 = r0 * 1.0"], "absolute")
    still = tl.Trajectory(0.05 * np.arange(3), np.tile([0.0, 1.0], (3, 1)), np.zeros((2, 2)))
    protected = tl.Twin(twin.model, SIGNALS, flights=[still])
    with pytest.raises(NotAvailable, match="SymPy"):
        protected.export("sympy")
    assert "sp.Matrix" in protected.export("sympy", force=True)


@pytest.mark.parametrize(
    ("to", "options", "said"),
    [
        ("rust", {}, "kind of export"),
        ("twin.xyz", {}, "kind of export"),
        ("twin.py", {"kind": "c"}, "ends in .c"),
        ("nowhere/twin.py", {}, "existing folder"),
        ("c", {"precision": "half"}, "precision"),
    ],
)
def test_what_cannot_be_made_is_refused(to, options, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(tl.InvalidInput, match=said):
        twin_of(PENDULUM).export(to, **options)


def test_a_file_that_holds_no_twin_is_refused(tmp_path):
    path = tmp_path / "twin.json"
    with pytest.raises(tl.InvalidInput, match="can be read"):
        tl.load_twin(path)
    path.write_text("{}")
    with pytest.raises(tl.InvalidInput, match="kind 'twin'"):
        tl.load_twin(path)
    with path.open("r+b") as file:
        file.truncate(LARGEST + 1)  # takes no room on a disk: it is not read
    with pytest.raises(tl.InvalidInput, match=f"expected at most {LARGEST} bytes, found {LARGEST + 1}"):
        tl.load_twin(path)
    path.write_text("{}")
    record = twin_of(PENDULUM).to_record()
    # What the first version wrote.
    earlier = {key: value for key, value in record.items() if key != "follows"}
    path.write_text(json.dumps({**earlier, "version": 1, "offsets": [0.003, 0.0]}))
    assert tl.load_twin(path).law.offsets == (0.003, 0.0)
    # What told from the errors whether it follows.
    bad = twin_of(PENDULUM, errors=[TestErrors(0, 1.0, 2.0, 0.9, None, 2.0)]).to_record()
    for errors, follows in ((record["errors"], True), (bad["errors"], False)):
        path.write_text(json.dumps({**earlier, "version": 5, "errors": errors}))
        assert tl.load_twin(path).follows is follows
    for offsets, words in (([0.1], "one for each of 2 states"), ([0.0, 0.1], "no other states give")):
        path.write_text(json.dumps({**record, "model": {**record["model"], "offsets": offsets}}))
        with pytest.raises(tl.InvalidInput, match=words):
            tl.load_twin(path)


# Controllers

THREE = tl.Signals(
    states=[
        tl.State("angle", "rad", 3.0, periodic=True),
        tl.State("rate", "rad/s", 8.0, derivative_of="angle"),
        tl.State("level", "m", 1.0),
    ],
    commands=[tl.Command("torque", "N m", (-2.0, 2.0)), tl.Command("fan", "V", (0.0, 5.0))],
    dt=0.05,
)
MIX = tl.controllers.Mixer([[1.0, 0.2], [-0.5, 0.7]], offset=[0.1, 2.0], power=0.5)
BOX = (-9.0, 9.0)


def gains_of(*names):
    return dict.fromkeys(names, BOX)


CONTROLLERS = {
    "pid": tl.controllers.PID(
        axes=[("angle", "rate"), ("level", None)],
        gains=gains_of(*(f"{axis}.{term}" for axis in ("angle", "level") for term in ("kp", "ki", "kd"))),
    ),
    "pid with all options": tl.controllers.PID(
        axes=[("angle", None), ("level", None)],
        gains=gains_of(*(f"{axis}.{term}" for axis in ("angle", "level") for term in ("kp", "ki", "kd"))),
        output=MIX, anti_windup="clamping", derivative_filter=0.2,
    ),
    "cascade": tl.controllers.Cascade(
        axes=[("angle", "rate")],
        gains=gains_of("angle.kp", "rate.kp", "rate.ki", "rate.kd"),
        output=tl.controllers.Mixer([[1.0], [-2.0]], offset=[0.0, 1.0]),
        rate_limits={"rate": 1.5}, anti_windup="clamping", derivative_filter=0.1,
    ),
    "state feedback": tl.controllers.StateFeedback(None, BOX, output=MIX, integral=("angle",)),
    "state feedback without a mixer": tl.controllers.StateFeedback(("angle", "rate"), BOX),
}  # fmt: skip


def led(described, seed):
    """A family, gains, and states and a target that bring commands to their bounds and an angle round."""
    rng = np.random.default_rng(seed)
    family = described.bind(THREE)
    genes = rng.uniform(-3.0, 3.0, family.size)
    states = np.cumsum(0.6 * rng.normal(size=(60, 3)), axis=0)
    target = rng.normal(size=3)
    controller = family.controller(genes)
    return family, genes, states, target, np.array([controller.command(x, target) for x in states])


@pytest.mark.parametrize("which", CONTROLLERS)
@pytest.mark.parametrize("seed", range(4))
def test_a_controller_in_python_commands_the_same(which, seed):
    family, genes, states, target, expected = led(CONTROLLERS[which], seed)
    found = python_controller(controller_python(CONTROLLERS[which], family, genes))(states, target)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    bounds = np.array([command.bounds for command in THREE.commands])
    assert (expected == bounds[:, 0]).any() or (expected == bounds[:, 1]).any()


@pytest.mark.parametrize("given", [("state", 2, 3), ("target", 3, 4)])
def test_a_controller_in_python_refuses_other_than_one_number_a_state(given):
    what, states, targets = given
    described = CONTROLLERS["state feedback"]
    family = described.bind(THREE)
    taken: dict = {}
    exec(compile(controller_python(described, family, np.zeros(family.size)), "taken", "exec"), taken)
    with pytest.raises(
        ValueError, match=rf"command: {what}: expected 3 numbers \(angle, rate, level\), found"
    ):
        taken["Controller"]().command([0.0] * states, [0.0] * targets)


@needs_cc
@pytest.mark.parametrize("which", CONTROLLERS)
def test_a_controller_in_c_commands_the_same(which):
    family, genes, states, target, expected = led(CONTROLLERS[which], 1)
    source = controller_c(CONTROLLERS[which], family, genes, "loop")
    found = c_controller(*source, "loop", 2, "double")(states, target)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    single = controller_c(CONTROLLERS[which], family, genes, "loop", "float")
    assert "double" not in single[1]
    c_controller(*single, "loop", 2, "float")(states, target)


def in_python(described, family, genes):
    return python_controller(controller_python(described, family, genes))


def in_c(described, family, genes):
    return c_controller(*controller_c(described, family, genes, "loop"), "loop", 2, "double")


EXPORTED = pytest.mark.parametrize("exported", [in_python, pytest.param(in_c, marks=needs_cc)])
BOUNDS = np.array([command.bounds for command in THREE.commands])


OWN_RATES = {
    "pid": ["level.kd"], "pid with all options": ["angle.kd", "level.kd"], "cascade": ["rate.kd"],
}  # fmt: skip
"""Gains on rates that a controller makes of readings itself."""


@EXPORTED
@pytest.mark.parametrize("which", CONTROLLERS)
@pytest.mark.parametrize("missing", [np.nan, np.inf, -np.inf])
def test_an_exported_controller_repeats_its_last_command_where_a_reading_is_missing_and_forgets_the_call(
    exported, which, missing
):
    described = CONTROLLERS[which]
    family, genes, states, target, _ = led(described, 3)
    command = exported(described, family, genes)

    def alone(periods):
        """As if nobody had called; a rate that it makes itself is over so many periods."""
        slower = genes / np.where(np.isin(family.names, OWN_RATES.get(which, [])), periods, 1.0)
        return exported(described, family, slower)(states, target)

    def assert_alike(found, periods):
        expected = np.repeat(alone(periods), periods, axis=0)
        if which in OWN_RATES:
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
        else:
            np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(found, np.repeat(found[::periods], periods, axis=0))

    # After each reading some are missing.
    broken = np.repeat(states, 3, axis=0)
    broken[1::3, 0] = missing
    broken[2::3, :2] = missing
    assert_alike(command(broken, target), 3)
    targets = np.repeat(np.tile(target, (len(states), 1)), 2, axis=0)
    targets[1::2, 0] = missing
    assert_alike(command(np.repeat(states, 2, axis=0), targets), 2)


@EXPORTED
def test_after_a_drop_out_an_exported_controller_finds_the_rate_of_what_has_moved_meanwhile(exported):
    described = tl.controllers.PID(
        axes=[("angle", None), ("level", None)],
        gains={f"{axis}.{term}": BOX for axis in ("angle", "level") for term in ("kp", "ki", "kd")},
    )
    family = described.bind(THREE)
    genes = family.genes(
        {"angle.kp": 0.0, "angle.ki": 0.0, "angle.kd": 1.0, "level.kp": 0.0, "level.ki": 0.0, "level.kd": 0.0}
    )
    ramp = np.zeros((20, 3))
    ramp[:, 0] = 0.02 * np.arange(20)
    ramp[5:15, 0] = np.nan
    found = exported(described, family, genes)(ramp, np.zeros(3))[:, 0]
    np.testing.assert_allclose(found[1:], -0.02 / THREE.dt, rtol=1e-9)


@EXPORTED
@pytest.mark.parametrize("power", [1.0, 2.0])
def test_what_overflows_is_no_command_though_its_bound_would_hide_it_and_is_forgotten(exported, power):
    described = tl.controllers.PID(
        axes=[("angle", "rate"), ("level", None)], output=tl.controllers.Mixer(np.eye(2), power=power),
        gains={f"{axis}.{term}": BOX for axis in ("angle", "level") for term in ("kp", "ki", "kd")},
    )  # fmt: skip
    family = described.bind(THREE)
    genes = family.genes(np.full(family.size, 2.5))
    states = np.tile([0.1, 0.0, 0.1], (8, 1))
    plain = exported(described, family, genes)(states[:7], np.zeros(3))
    states[3] = [0.0, -1.7e308, 0.0]
    found = exported(described, family, genes)(states, np.zeros(3))
    np.testing.assert_array_equal(found[3], found[2])
    np.testing.assert_allclose(np.delete(found, 3, axis=0), plain, rtol=1e-9, atol=1e-12)


@EXPORTED
@pytest.mark.parametrize("which", CONTROLLERS)
def test_before_its_first_reading_an_exported_controller_sends_what_it_does_without_any_error(
    exported, which
):
    described = CONTROLLERS[which]
    family, genes, states, target, _ = led(described, 3)
    rest = family.controller(genes).command(np.zeros(3), np.zeros(3))
    command = exported(described, family, genes)
    found = command(np.concatenate([np.full((2, 3), np.nan), states]), target)
    np.testing.assert_allclose(found[:2], [rest, rest], rtol=1e-15)
    np.testing.assert_array_equal(found[2:], command(states, target))


@EXPORTED
@pytest.mark.parametrize("which", CONTROLLERS)
@pytest.mark.parametrize("huge", [1e154, 1.7e308])
def test_an_exported_controller_sends_a_command_within_its_bounds_whatever_it_reads(exported, which, huge):
    described = CONTROLLERS[which]
    family, genes, states, target, _ = led(described, 3)
    wild = np.repeat(states, 2, axis=0)
    wild[1::2] = huge * np.where(np.arange(len(states))[:, np.newaxis] % 3, 1.0, -1.0)
    found = exported(described, family, genes)(wild, target)
    assert np.isfinite(found).all()
    assert (found >= BOUNDS[:, 0]).all() and (found <= BOUNDS[:, 1]).all()
    # What an integral made of a number that large nobody can take back, but where it overflows it is not taken.
    assert np.isfinite(exported(described, family, genes)(np.concatenate([wild, states]), target)).all()


@EXPORTED
def test_a_reading_that_the_law_does_not_need_may_be_missing(exported):
    described = CONTROLLERS["cascade"]
    family, genes, states, target, expected = led(described, 3)
    without = np.where([True, True, False], states, np.nan)
    found = exported(described, family, genes)(without, target)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@needs_cc
def test_a_controller_in_c_is_plain_c99_and_refuses_to_be_compiled_without_missing_readings(tmp_path):
    for which, described in CONTROLLERS.items():
        family, genes, *_ = led(described, 1)
        for precision in ("double", "float"):
            for suffix, text in zip(
                "hc", controller_c(described, family, genes, "loop", precision), strict=True
            ):
                (tmp_path / f"loop.{suffix}").write_text(text)
            strict = ["-Wall", "-Wextra", "-Werror", "-pedantic"]
            for standard in ("-std=c99", "-std=gnu11"):
                command = ["cc", standard, *strict, "-c", "loop.c"]
                assert subprocess.run(command, cwd=tmp_path, check=False).returncode == 0, which
    fast = subprocess.run(
        ["cc", "-ffast-math", "-c", "loop.c"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert fast.returncode != 0 and "without -ffast-math" in fast.stderr


@needs_both
def test_a_program_in_cpp_calls_a_twin_and_its_controller_in_c(tmp_path):
    twin = twin_of(PENDULUM, offsets=(0.08, 0.0))  # late, so that functions of its sensors are declared, too
    twin.export(tmp_path / "rig.c")
    family, genes, *_ = led(CONTROLLERS["state feedback"], 1)
    for suffix, text in zip(
        "hc", controller_c(CONTROLLERS["state feedback"], family, genes, "loop"), strict=True
    ):
        (tmp_path / f"loop.{suffix}").write_text(text)
    (tmp_path / "main.cpp").write_text(
        """
#include "loop.h"
#include "rig.h"
int main()
{
    rig_memory memory;
    rig_sensors sensors;
    double x[2] = {0.1, 0.0}, u[2] = {0.5, 1.0}, reading[2];
    rig_reset(&memory);
    rig_clip(u);
    rig_step(&memory, x, u, x);
    rig_begin(&sensors);
    rig_read(&sensors, x, reading);
    loop_memory loop;
    double state[3] = {0.1, 0.0, 0.0}, target[3] = {0.0, 0.0, 0.0};
    loop_reset(&loop);
    loop_command(&loop, state, target, u);
    return x[0] == 0.1;
}
"""
    )
    subprocess.run(["cc", "-std=c99", "-c", "rig.c", "loop.c"], cwd=tmp_path, check=True)
    strict = ["-Wall", "-Wextra", "-Werror"]
    subprocess.run(
        ["c++", *strict, "-o", "both", "main.cpp", "rig.o", "loop.o", "-lm"], cwd=tmp_path, check=True
    )
    subprocess.run([tmp_path / "both"], check=True)


def test_a_periodic_state_is_taken_away_as_the_model_sees_it():
    lines = ["r5 = r0 * 0.7", "r5 = r5 * r0", "r6 = r3 + r1", "r5 = r5 - r6", "r6 = r2 * -0.1"]
    twin = twin_of(lines, signals=THREE, inputs=5)
    start, commands = np.array([3.0, 4.0, 0.0]), np.zeros((20, 2))
    expected = twin.simulate_commands(start, commands).true_states
    assert expected[-1, 0] > 4.0  # it went round
    found = python_simulation(python_source(twin.law))(start, commands)
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=1e-9)
    assert "angle wraps: the equations see it from -3.14159 to 3.14159 rad" in twin.equations()
    point = twin.linearise([5.0, 0.3, 0.0], [0.1, 0.2], discrete=True)
    nudged = [twin.predict([5.0 + sign * 1e-6, 0.3, 0.0], [0.1, 0.2]) for sign in (1.0, -1.0)]
    np.testing.assert_allclose(point.A[:, 0], (nudged[0] - nudged[1]) / 2e-6, rtol=1e-6, atol=1e-9)
    if shutil.which("cc"):
        found = c_simulation(*c_source(twin.law, "rig"), "rig", twin.law, "double")(start, commands)
        np.testing.assert_allclose(found[: len(expected)], expected, rtol=1e-9)


def test_the_controller_of_a_campaign_is_taken_away(tmp_path, new_campaign, pendulum):
    campaign = new_campaign()
    campaign.run(pendulum, experiments=2)
    (path,) = campaign.export_controller(tmp_path / "loop.py")
    names = {}
    exec(path.read_text(), names)
    gains = campaign.best_test.parameters
    assert names["GAINS"] == gains
    with pytest.raises(tl.InvalidInput, match="controller"):
        campaign.export_controller("latex")
    with pytest.raises(tl.InvalidInput, match="precision"):
        campaign.export_controller("c", precision="half")


def test_a_controller_of_ones_own_is_not_taken_away():
    class Nothing:
        def __init__(self, gain):
            self.gain = gain

        def reset(self):
            pass

        def command(self, state, target):
            return [0.0, 0.0]

    described = tl.controllers.Custom(Nothing, {"gain": (0.0, 1.0)})
    with pytest.raises(NotAvailable, match="by hand"):
        controller_python(described, described.bind(THREE), np.array([0.5]))


# The command line


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "twinloop", "export", *map(str, arguments)], capture_output=True, text=True
    )


SAID = (
    Remark("free-run", "serious", "It misses its flights."),
    Remark("form", "note", "The form was searched."),
)


def spoken_against():
    """A twin with a serious remark, and one that is not."""
    twin = TWINS["acceleration"]()
    return tl.Twin(twin.model, twin.signals, twin.errors, flights=twin.flights, remarks=SAID)


def test_what_speaks_against_a_twin_goes_with_its_file_and_keeps_it_there(tmp_path):
    told = spoken_against()
    (path,) = told.export(tmp_path / "twin.json")
    assert tl.load_twin(path).remarks == SAID
    refused = run(path, "--to", "python")
    assert refused.returncode == 1 and "found: It misses its flights. Learn" in refused.stderr
    assert "def simulate(" in run(path, "--to", "python", "--force").stdout
    # An earlier version wrote none.
    record = {key: value for key, value in told.to_record().items() if key != "remarks"}
    assert tl.Twin.from_record({**record, "version": 7}).remarks == ()


def test_what_speaks_against_a_twin_is_a_warning_where_it_is_taken_away_in_python(tmp_path):
    told = spoken_against()
    for to in ("latex", tmp_path / "twin.json"):
        with pytest.warns(tl.RemarkWarning) as warned:
            told.export(to)
        assert [str(each.message) for each in warned] == ["It misses its flights. (free-run)"]
        assert warned[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = tl.load_twin(tmp_path / "twin.json")
        plain = TWINS["acceleration"]()
        forced, text = again.export("latex", force=True).split("\n", 1)
        # Forced, or nothing to be said.
        assert text == plain.export("latex") and forced.startswith("% Exported by force")
    with pytest.warns(tl.RemarkWarning, match="It misses"):
        again.export("python")


def test_a_stored_campaign_is_taken_away_from_the_command_line(tmp_path, new_campaign, pendulum):
    pytest.importorskip("sqlalchemy")
    store = tmp_path / "rig.db"
    campaign = new_campaign(store=store)
    campaign.run(pendulum, experiments=2)
    done = run(store, "controller", "--output", tmp_path / "loop.py")
    assert done.returncode == 0 and done.stdout.startswith("Wrote ")
    assert "class Controller:" in (tmp_path / "loop.py").read_text()
    done = run(store, "twin", "--to", "python", "--force")
    assert done.returncode == 0 and "def simulate(" in done.stdout
    twin = TWINS["acceleration"]()
    (path,) = twin.export(tmp_path / "twin.json")
    done = run(path, "--to", "latex")
    assert done.returncode == 0 and done.stdout == twin.export("latex")


def test_a_campaign_whose_twin_fails_a_check_exports_it_only_by_force(new_campaign, pendulum):
    campaign = new_campaign()
    campaign.run(pendulum, experiments=1)
    assert not campaign.checks().twin_passed
    with pytest.raises(tl.NotTrusted, match=r"holds its checks, found: .*Fly one more"):
        campaign.export_twin("python")
    assert "def simulate(" in campaign.export_twin("python", force=True)


def test_an_unknown_kind_is_refused_before_the_twin_is_judged(new_campaign, pendulum, monkeypatch):
    campaign = new_campaign()
    campaign.run(pendulum, experiments=1)
    monkeypatch.setattr(campaign, "checks", lambda: pytest.fail("judged"))
    with pytest.raises(tl.InvalidInput, match="kind of export 'fnord'"):
        campaign.export_twin("fnord")


def test_a_twin_that_fails_its_checks_is_a_failure_and_an_unknown_kind_is_misuse(
    tmp_path, new_campaign, pendulum
):
    pytest.importorskip("sqlalchemy")
    store = tmp_path / "rig.db"
    new_campaign(store=store).run(pendulum, experiments=1)
    failed = run(store, "twin", "--to", "python")
    assert failed.returncode == 1 and "holds its checks" in failed.stderr
    misused = run(store, "twin", "--to", "fnord")
    assert misused.returncode == 2 and "kind of export 'fnord'" in misused.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere.db", "twin", "--to", "c"], "no file"),
        (["twin.json", "twin"], "--output FILE"),
        (["twin.json", "gearbox", "--to", "c"], "thing to export"),
        (["twin.json", "controller", "--to", "c"], "JSON"),
        (["twin.json", "twin", "--to", "rust"], "kind of export"),
    ],
)
def test_what_cannot_be_taken_away_is_refused_with_one_sentence(arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    TWINS["acceleration"]().export("twin.json")
    done = run(*arguments)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1
