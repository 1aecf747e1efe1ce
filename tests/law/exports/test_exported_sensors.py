"""What late and early sensors read is taken away with the twin: each export reads what the twin's own sensors read."""

import shutil

import numpy as np
import pytest
import sympy

import twinloop as tl
from late_sensors import BODY, DT, PENDULUM
from law_twins import BODY as TURNING_BODY
from law_twins import SWINGING, twin_of
from strategies import program_text
from twinloop import _core
from twinloop.law.exports import python_source as written
from twinloop.law.exports.c_source import c_source
from twinloop.law.exports.simulations import (
    c_simulation,
    casadi_simulation,
    control_simulation,
    gymnasium_simulation,
    python_simulation,
)

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
TUMBLING = [
    "r9 = r6 * 3.0", "r9 = r9 - r3", "r10 = r7 * 2.0", "r10 = r10 - r4", "r11 = r8 * 2.0", "r11 = r11 - r5",
    "r12 = r3 * r4", "r12 = r12 * 0.5", "r11 = r11 + r12",
]  # fmt: skip
THROWN = tl.Signals(
    [
        tl.State("height", "m", 5.0),
        tl.State("speed", "m/s", 5.0, derivative_of="height"),
        tl.State("lift", "m/s2", 9.0, derivative_of="speed"),
    ],
    [tl.Command("thrust", "N", (-2.0, 2.0), scale=1.0)],
    DT,
)
CASES = {
    "pendulum": (PENDULUM, SWINGING, "acceleration"),
    "body": (BODY, TUMBLING, "acceleration"),
    "body, step by step": (
        BODY, ["r9 = r3 * 0.04", "r10 = r4 * 0.04", "r11 = r5 * 0.04", "r12 = r6 * 0.1"], "increment",
    ),
    "a chain of three": (THROWN, ["r4 = r3 * 4.0", "r5 = r2 * 0.5", "r4 = r4 - r5"], "acceleration"),
}  # fmt: skip
PERIODS = (0.3, 1.0, 1.6, 2.5, -0.2)
EVERY = pytest.mark.parametrize("periods", PERIODS)
KINDS = ("python", "casadi", "control", "gymnasium", "c", "fmu3", "fmu2")
SIMULATIONS = {
    "python": python_simulation,
    "casadi": casadi_simulation,
    "control": control_simulation,
    "gymnasium": gymnasium_simulation,
}


def late_twin(case, periods):
    """A twin whose sensors of states that others give are late; the second of them by half as much."""
    signals, lines, form = CASES[case]
    inputs = signals.n_x + signals.n_u
    outputs = len(signals.driven) if form == "acceleration" else signals.n_x
    program = _core.Program.parse(program_text(inputs, outputs, inputs + outputs + 2, [lines]))
    given = [place for place in range(signals.n_x) if place not in signals.driven]
    offsets = [0.0] * signals.n_x
    for k, place in enumerate(given):
        offsets[place] = periods * DT * (0.5 if k == 1 else 1.0)
    model = _core.Model(program, form, signals.engine, offsets=offsets)
    return tl.Twin(model, signals, limits=tl.Limits(signals, 100.0))


def flown(twin, seed=0):
    rng = np.random.default_rng(seed)
    commands = np.repeat(rng.uniform(-1.5, 1.5, (10, twin.signals.n_u)), 5, axis=0)
    return twin.simulate_commands(rng.uniform(-0.5, 0.5, twin.signals.n_x), commands)


def both(run):
    return np.hstack([run.true_states, run.states])


@pytest.mark.parametrize("case", CASES)
@EVERY
@pytest.mark.parametrize("kind", SIMULATIONS)
def test_a_module_of_python_reads_what_the_twin_reads(case, periods, kind):
    pytest.importorskip({"python": "math"}.get(kind, kind))
    twin = late_twin(case, periods)
    run = flown(twin)
    assert np.abs(run.states - run.true_states).max() > 1e-3
    found = SIMULATIONS[kind](twin.export(kind, force=True))(run.true_states[0], run.commands)
    np.testing.assert_allclose(found, both(run), rtol=1e-9, atol=1e-9)


@needs_cc
@pytest.mark.parametrize("case", CASES)
@EVERY
@pytest.mark.parametrize(("precision", "close"), [("double", 1e-9), ("float", 1e-3)])
def test_c_reads_what_the_twin_reads(case, periods, precision, close):
    twin = late_twin(case, periods)
    run = flown(twin)
    simulate = c_simulation(*c_source(twin.law, "rig", precision), "rig", twin.law, precision)
    found = simulate(run.true_states[0], run.commands)
    np.testing.assert_allclose(found, both(run), rtol=close, atol=close)


@needs_cc
@pytest.mark.parametrize("kind", ["fmu3", "fmu2"])
@pytest.mark.parametrize("case", ["pendulum", "body"])
def test_an_fmu_gives_readings_as_outputs_of_their_own(kind, case, tmp_path):
    fmpy = pytest.importorskip("fmpy")
    validation = pytest.importorskip("fmpy.validation")
    twin = late_twin(case, 1.6)
    run = flown(twin)
    (path,) = twin.export(tmp_path / "late.fmu", kind=kind)
    assert validation.validate_fmu(path) == []
    names = twin.signals.state_names
    late = [f"{names[place]}_read" for place, offset in enumerate(twin.law.offsets) if offset]
    rows = np.zeros(
        len(run.commands) + 1, dtype=[("time", float), *((n, float) for n in twin.signals.command_names)]
    )
    rows["time"] = DT * np.arange(len(rows))
    for i, name in enumerate(twin.signals.command_names):
        rows[name] = np.append(run.commands[:, i], run.commands[-1, i])
    done = fmpy.simulate_fmu(
        path, stop_time=DT * len(run.commands), step_size=DT, output_interval=DT, input=rows,
        start_values=dict(zip(names, run.true_states[0].tolist(), strict=True)), output=[*names, *late],
    )  # fmt: skip
    np.testing.assert_allclose(
        np.column_stack([done[n] for n in names]), run.true_states, rtol=1e-9, atol=1e-9
    )
    read = run.states[:, [place for place, offset in enumerate(twin.law.offsets) if offset]]
    np.testing.assert_allclose(np.column_stack([done[n] for n in late]), read, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("case", ["pendulum", "body"])
@EVERY
def test_an_environment_of_the_package_shows_readings(case, periods):
    pytest.importorskip("gymnasium")
    twin = late_twin(case, periods)
    run = flown(twin)
    zeros = np.zeros(twin.signals.n_x)
    env = twin.env(zeros, zeros, len(run.commands))
    for _ in range(2):
        first, known = env.reset(options={"initial_state": run.true_states[0]})
        seen, states = [first], [known["state"]]
        for command in run.commands:
            read, _, _, _, known = env.step(command)
            seen.append(read)
            states.append(known["state"])
        np.testing.assert_allclose(np.hstack([states, seen]), both(run), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kind", ["python", pytest.param("c", marks=needs_cc)])
def test_an_export_that_reads_something_else_is_refused(kind, monkeypatch, tmp_path):
    twin = late_twin("pendulum", 0.6)
    flight = flown(twin)
    learnt = tl.Twin(twin.model, twin.signals, limits=twin.limits, flights=[flight])
    assert learnt.export(tmp_path / "twin.py")
    for module in ("python_source", "sensor_source", "c_sensors"):
        found = __import__(f"twinloop.law.exports.{module}", fromlist=["groups"])
        if hasattr(found, "groups"):
            monkeypatch.setattr(found, "groups", lambda law: [(0.3, (0,))])
    with pytest.raises(tl.NotAvailable, match="difference"):
        learnt.export(kind)


def test_sensors_in_time_read_every_state_as_it_is():
    names = {}
    exec(twin_of(["r4 = r2 * 11.0"]).export("python"), names)
    assert names["readings"]([[0.1, 0.2], [0.3, 0.4]]) == [[0.1, 0.2], [0.3, 0.4]]
    assert "_read" not in twin_of(["r4 = r2 * 11.0"]).export("c", force=True)
    assert written.layout(twin_of(["r7 = r6 * 2.0"], signals=TURNING_BODY, inputs=7).law, False)


@pytest.mark.parametrize("periods", [1.6, -0.2])
def test_sympy_and_latex_write_what_a_late_sensor_reads_as_an_equation(periods):
    twin = late_twin("a chain of three", periods)
    names = {}
    exec(twin.export("sympy", force=True), names)
    t, read = names["t"], names["READ"]
    latex = twin.export("latex", force=True)
    late = [(i, offset) for i, offset in enumerate(twin.law.offsets) if offset]
    assert len(read) == len(late) > 0
    for i, offset in late:
        name = twin.signals.state_names[i]
        moment = sympy.Symbol("moment")
        # A sensor that is late by some time gives at any moment what was that long before.
        (given,) = [value for state, value in read.items() if str(state) == name]
        assert float(moment - given.subs(t, moment).args[0]) == pytest.approx(offset, rel=1e-15)
        assert (
            rf"\mathit{{{name}}}_{{\mathrm{{read}}}}(t) &= \mathit{{{name}}}(t {'-' if offset > 0 else '+'} "
            in latex
        )
    assert latex.count("{") == latex.count("}")
