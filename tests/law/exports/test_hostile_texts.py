"""Whatever a unit, a name or a file is called, an export holds it as text and never as code."""

import ast
import shutil

import numpy as np
import pytest

import twinloop as tl
from law_twins import twin_of
from twinloop.law.exports.simulations import python_simulation

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
EVIL = [
    '"""\nimport evil\nevil()\n"""',
    "*/ evil(); /*",
    "/* // \\",
    "rad\r\nevil()",
    "\u2028evil()\u2029\x85evil()\x0c",
    "'); evil(); ('",
    "{evil}%s\\input{evil}",
    "\x00\x1b[2Jevil",
    "??/\nevil()",
]
HOSTILE = pytest.mark.parametrize("unit", EVIL)


def hostile(unit):
    signals = tl.Signals(
        states=[
            tl.State("angle", unit, 3.0, periodic=6.0),
            tl.State("rate", "rad/s", 8.0, derivative_of="angle"),
        ],
        commands=[tl.Command("torque", unit, (-2.0, 2.0)), tl.Command("fan", "V", (0.0, 5.0))],
        dt=0.05,
    )
    return twin_of(
        ["r4 = sin(r0)", "r5 = r2 * 11.0", "r4 = r5 - r4"], signals=signals, offsets=(0.003, 0.0),
        actuators=[(0.08, 2, None, 0.0), (0.0, 1, 2.0, 0.0)],
    )  # fmt: skip


@HOSTILE
@pytest.mark.parametrize("kind", ["python", "casadi", "control", "gymnasium", "sympy"])
def test_in_python_it_is_a_literal_or_a_comment(unit, kind):
    text = hostile(unit).export(kind, force=True)
    names = {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}
    imported = {
        alias.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import)
        for alias in node.names
    }
    assert "evil" not in names | imported
    if kind == "python":
        twin = hostile(unit)
        run = twin.flights[0]
        found = python_simulation(text)(run.true_states[0], run.commands)
        expected = np.hstack([run.true_states, run.states])
        np.testing.assert_allclose(found[: len(run.states)], expected, rtol=1e-9, atol=1e-9)


@needs_cc
@HOSTILE
def test_in_c_it_is_a_comment_and_compiles_without_a_warning(unit):
    text = hostile(unit).export("c")  # compiled, and compared
    outside = text
    while "/*" in outside:
        before, _, after = outside.partition("/*")
        comment, end, after = after.partition("*/")
        assert end and "/*" not in comment
        outside = before + after
    assert "evil" not in outside


@HOSTILE
def test_in_latex_it_is_a_comment(unit):
    lines = hostile(unit).export("latex").split("\n")
    assert not any("evil" in line for line in lines if not line.startswith("%"))
    assert not any("\r" in line for line in lines)


@HOSTILE
def test_json_gives_it_back(unit, tmp_path):
    (path,) = hostile(unit).export(tmp_path / "twin.json")
    assert tl.load_twin(path).signals.states[0].unit == unit


@pytest.mark.parametrize("name", ['a".c', "a\nb.c", "a\\b.c", "<a>.c", "a\x00.c"])
def test_a_file_whose_name_would_break_an_include_is_refused(name, tmp_path):
    with pytest.raises(tl.InvalidInput, match="file name"):
        hostile("rad").export(tmp_path / name)
    assert not list(tmp_path.iterdir())


@needs_cc
@pytest.mark.parametrize("name", ["été 2.c", "-rm -rf.c", "$(evil).c", "a;b.c", "double.c", "1.c", "_.c"])
def test_other_file_names_make_c_that_compiles(name, tmp_path):
    import subprocess

    source, _ = hostile("rad").export(tmp_path / name)
    subprocess.run(
        ["cc", "-std=c99", "-Wall", "-Werror", "-fsyntax-only", f"./{source.name}"], cwd=tmp_path, check=True
    )


NAMES = [
    ("u", "w"),
    ("x", "u"),
    ("abs", "abs_"),
    ("out", "SEEN"),
    ("NAN", "INFINITY"),
    ("_state", "_seen"),
    ("min", "max"),
]


@needs_cc
@pytest.mark.parametrize("names", NAMES, ids="-".join)
@pytest.mark.parametrize("kind", ["python", "c", "sympy"])
def test_states_may_be_called_as_an_export_calls_its_own(names, kind):
    signals = tl.Signals(
        states=[tl.State(names[0], "m/s", 3.0), tl.State(names[1], "m/s", 8.0)],
        commands=[tl.Command("thrust", "N", (-2.0, 2.0))],
        dt=0.05,
    )
    lines = [
        "r3 = abs(r0)", "r4 = max(r1, r2)", "r3 = r3 * -0.5", "r3 = r3 + r4", "r4 = abs(r1)", "r5 = min(r0, r2)",
        "r4 = r5 - r4",
    ]  # fmt: skip
    assert twin_of(lines, signals=signals, inputs=3).export(kind)  # run, and compared
