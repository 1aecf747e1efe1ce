"""Whether what was exported gives the numbers of the twin, on the flights that it was learnt from."""

from __future__ import annotations

import ctypes
import math
import tempfile
import warnings
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from twinloop.arrays import Floats
from twinloop.controllers import Family
from twinloop.errors import NotAvailable
from twinloop.law.exports.compiling import compiled
from twinloop.law.exports.python_source import equation_roots
from twinloop.law.exports.sensor_source import reach
from twinloop.law.law import Law
from twinloop.trajectory import Trajectory

CLOSE = {"double": 1e-9, "float": 1e-3}
"""Largest difference, as a share of a state's scale, or of the state where that is larger."""
MOST_REMEMBERED = 10_000
"""Numbers that a controller remembers at most."""
Commanding = Callable[[Floats, Floats], Floats]
"""Commands (n, n_u) on states (n, n_x), one period after the other, for a target (n_x,) or one a state (n, n_x)."""
Simulation = Callable[[Floats, Floats], Floats]
"""The states (n + 1, n_x) of a free run from a state (n_x,) under commands (n, n_u); where a sensor is late, beside
them what all sensors read of it (n + 1, 2 n_x)."""


def check_simulation(
    what: str, found: Simulation, twin: Simulation, law: Law, flights: Sequence[Trajectory], precision: str
) -> None:
    """Compares free runs under the commands of all flights, as long as the twin's own last.

    Args:
        what: was exported.
        found: what it simulates.
        twin: what the twin simulates.
        law: of the twin.
        flights: to compare on.
        precision: "double" or "float".

    Raises:
        NotAvailable: they differ.
    """
    scales = np.array([state.scale for state in law.signals.states])

    def difference(flight: Trajectory) -> Floats:
        expected = twin(flight.states[0], flight.commands)
        given = found(flight.states[0], flight.commands[: len(expected) - 1])
        sizes = np.maximum(np.tile(scales, expected.shape[1] // len(scales)), np.abs(expected))
        off: Floats = np.abs(given - expected) / sizes
        return off

    _check(
        f"Export, {what}: expected the twin's own numbers",
        "a state's scale",
        map(difference, flights),
        precision,
        "; the twin multiplies rounding there",
    )


def python_simulation(source: str) -> Simulation:
    """What an exported Python module simulates.

    Args:
        source: of the module, written by us.
    """
    names = _module(source)

    def simulate(state: Floats, commands: Floats) -> Floats:
        states = names["simulate"](state.tolist(), commands.tolist())
        return np.hstack([states, names["readings"](states)]) if "OFFSETS" in names else np.array(states)

    return simulate


def _module(source: str) -> dict[str, Any]:
    """What a module defines that was written by us."""
    names: dict[str, Any] = {}
    exec(compile(source, "exported module", "exec"), names)
    return names


def casadi_simulation(source: str) -> Simulation:
    """What an exported module of CasADi functions simulates.

    Args:
        source: of the module, written by us.

    Raises:
        NotAvailable: CasADi is missing.
    """
    _needed("casadi", "casadi")
    return python_simulation(source)


def control_simulation(source: str) -> Simulation:
    """What python-control simulates with an exported system.

    Args:
        source: of the module, written by us.

    Raises:
        NotAvailable: python-control is missing.
    """
    control = _needed("control", "control")
    names = _module(source)
    system = names["system"]

    def simulate(state: Floats, commands: Floats) -> Floats:
        start = np.concatenate([state, np.zeros(system.nstates - len(state))])
        times = names["DT"] * np.arange(len(commands) + 1)
        held = np.concatenate([commands, commands[-1:]])
        run = control.input_output_response(system, times, held.T, start)
        found = np.asarray(run.outputs, dtype=np.float64).reshape(system.noutputs, -1).T
        states = found[:, : len(state)]
        if "OFFSETS" not in names:
            return states
        read = states.copy()
        read[:, list(names["_LATE"])] = found[:, len(state) :]
        return np.hstack([states, read])

    return simulate


def gymnasium_simulation(source: str) -> Simulation:
    """How an exported environment moves, after Gymnasium's own checker has found no fault in it.

    Args:
        source: of the module, written by us.

    Raises:
        NotAvailable: Gymnasium is missing, or finds a fault.
    """
    _needed("gymnasium", "gymnasium")
    checker = import_module("gymnasium.utils.env_checker")
    names = _module(source)
    with warnings.catch_warnings():
        # Its advice is for those who train: commands in their own units, angles without an end.
        warnings.simplefilter("ignore")
        try:
            checker.check_env(names["TwinEnv"](), skip_render_check=True)
        except Exception as fault:
            raise NotAvailable(
                f"Export, Gymnasium: expected an environment without fault, found: {fault}."
            ) from fault

    def simulate(state: Floats, commands: Floats) -> Floats:
        env = names["TwinEnv"](steps=max(1, len(commands)))
        read, known = env.reset(options={"initial_state": state.tolist()})
        states, readings = [known["state"]], [read]
        for command in commands:
            read, _, _, _, known = env.step(command)
            states.append(known["state"])
            readings.append(read)
        return np.hstack([states, readings]) if "OFFSETS" in names else np.array(readings)

    return simulate


def _needed(module: str, extra: str) -> Any:
    try:
        return import_module(module)
    except ImportError as missing:
        raise NotAvailable(
            f"Export: expected the package {module!r} to check it with, found none; pip install 'twinloop[{extra}]', or"
            " pass force=True."
        ) from missing


def c_simulation(header: str, source: str, name: str, law: Law, precision: str) -> Simulation:
    """What exported C simulates, compiled by the C compiler of this machine.

    Args:
        header: of it.
        source: of it.
        name: what its functions begin with.
        law: of the twin.
        precision: "double" or "float".

    Raises:
        NotAvailable: no C compiler, or it refuses.
    """
    library = _compiled(header, source, name)
    real = ctypes.c_double if precision == "double" else ctypes.c_float
    dtype = np.float64 if precision == "double" else np.float32
    n_x = law.signals.n_x
    # The struct's own size is the compiler's business: nothing of it is larger than these.
    held = 16 + 8 * (law.signals.n_u + sum(a.delay for a in law.actuation.actuators) + 2 * law.inputs + 4)
    late = any(law.offsets)
    past = 16 + 8 * n_x * (2 + reach(law))

    def simulate(state: Floats, commands: Floats) -> Floats:
        memory = ctypes.create_string_buffer(held)
        pointer = ctypes.POINTER(real)
        getattr(library, f"{name}_reset")(memory)
        states = np.zeros((len(commands) + 1, n_x), dtype=dtype)
        states[0] = state
        for k, command in enumerate(np.array(commands, dtype=dtype)):
            getattr(library, f"{name}_clip")(command.ctypes.data_as(pointer))
            getattr(library, f"{name}_step")(
                memory,
                states[k].ctypes.data_as(pointer),
                command.ctypes.data_as(pointer),
                states[k + 1].ctypes.data_as(pointer),
            )
        if not late:
            return states.astype(np.float64)
        sensors, readings = ctypes.create_string_buffer(past), np.zeros_like(states)
        getattr(library, f"{name}_begin")(sensors)
        for state, reading in zip(states, readings, strict=True):
            getattr(library, f"{name}_read")(
                sensors, state.ctypes.data_as(pointer), reading.ctypes.data_as(pointer)
            )
        return np.hstack([states, readings]).astype(np.float64)

    return simulate


def check_sympy(source: str, law: Law, flights: Sequence[Trajectory]) -> None:
    """Compares a SymPy script, run on numbers in place of symbols, with the equations of the law.

    Args:
        source: of the script, written by us.
        law: of the twin.
        flights: whose states and commands it is evaluated at.

    Raises:
        NotAvailable: they differ.
    """
    code = compile(source.replace("import sympy as sp\n", ""), "exported twin", "exec")
    program = law.expressions.program(law.outputs, law.inputs)
    roots = [equation_roots(law).index(output) for output in law.outputs]
    sizes = np.array([command.size for command in law.signals.commands])
    for flight in flights:
        rows = np.hstack([
            flight.states[: flight.steps],
            flight.commands / sizes,
            np.full((flight.steps, len(law.actuation.hidden)), 0.1),
        ])  # fmt: skip
        expected = program.run(rows)
        for row, outputs in zip(rows, expected, strict=True):
            names: dict[str, Any] = {"sp": _numbers(row.tolist())}
            try:
                exec(code, names)
                found = np.array(names["EQUATIONS"])[roots]
            except ArithmeticError:
                found = np.full(len(roots), np.nan)
            off = np.abs(found - outputs) / (1.0 + np.abs(outputs))
            if not (off <= CLOSE["double"]).all():
                raise NotAvailable(
                    f"Export, SymPy: expected the twin's own numbers to 1e-9, found {found} for {outputs}: a division"
                    " is protected there, which SymPy's is not. Pass force=True to have it all the same."
                )


def _numbers(values: list[float]) -> SimpleNamespace:
    """Stands for SymPy where symbols are numbers, taken in their order."""
    remaining = iter(values)

    def symbols(names: str, real: bool) -> list[float]:
        return [next(remaining) for _ in names.split()]

    return SimpleNamespace(
        symbols=symbols,
        Matrix=list,
        Abs=abs,
        sqrt=math.sqrt,
        sin=math.sin,
        cos=math.cos,
        tanh=math.tanh,
        exp=math.exp,
        Min=min,
        Max=max,
    )


def check_controller(
    what: str,
    found: Commanding,
    own: Commanding,
    family: Family,
    flights: Sequence[Trajectory],
    target: Floats,
    precision: str,
) -> None:
    """Compares commands on the states of all flights.

    Args:
        what: was exported.
        found: what it commands, period after period, on states (n, n_x): (n, n_u).
        own: what the controller itself commands.
        family: of the controller.
        flights: to compare on.
        target: state that it leads to (n_x,), or a reference, a row for each state of a run.
        precision: "double" or "float".

    Raises:
        NotAvailable: they differ.
    """
    sizes = np.array([command.size for command in family.signals.commands])

    def difference(flight: Trajectory) -> Floats:
        states = flight.states[: flight.steps]
        goals = target
        if target.ndim == 2:  # a flight that nobody asked for may be longer
            goals = target[np.minimum(np.arange(len(states)), len(target) - 1)]
        off: Floats = np.abs(found(states, goals) - own(states, goals)) / sizes
        return off

    _check(
        f"Export, {what}: expected the controller's own commands",
        "a command's scale",
        map(difference, flights),
        precision,
    )


def _check(expected: str, unit: str, differences: Iterable[Floats], precision: str, reason: str = "") -> None:
    """Refuses an export whose numbers differ on any flight, in shares of their unit; NaN differs."""
    for number, off in enumerate(differences):
        if not (off <= CLOSE[precision]).all():
            raise NotAvailable(
                f"{expected} to {CLOSE[precision]:g}, found a difference of {float(np.max(off)):.3g} of {unit} on"
                f" flight {number}{reason}. Pass force=True to have it all the same."
            )


def python_controller(source: str) -> Commanding:
    """What an exported Python controller commands.

    Args:
        source: of the module, written by us.
    """
    names = _module(source)

    def commands(states: Floats, target: Floats) -> Floats:
        controller, goals = names["Controller"](), np.broadcast_to(target, states.shape)
        pairs = zip(states.tolist(), goals.tolist(), strict=True)
        return np.array([controller.command(state, goal) for state, goal in pairs])

    return commands


def c_controller(header: str, source: str, name: str, n_u: int, precision: str) -> Commanding:
    """What an exported C controller commands, compiled by the C compiler of this machine.

    Args:
        header: of it.
        source: of it.
        name: what its functions begin with.
        n_u: number of its commands.
        precision: "double" or "float".

    Raises:
        NotAvailable: no C compiler, or it refuses.
    """
    library = _compiled(header, source, name)
    real, dtype = (ctypes.c_double, np.float64) if precision == "double" else (ctypes.c_float, np.float32)
    pointer = ctypes.POINTER(real)

    def commands(states: Floats, target: Floats) -> Floats:
        memory = ctypes.create_string_buffer(8 * MOST_REMEMBERED)
        getattr(library, f"{name}_reset")(memory)
        given, goals = (
            np.array(part, dtype, order="C") for part in (states, np.broadcast_to(target, states.shape))
        )
        found = np.zeros((len(states), n_u), dtype=dtype)
        for state, goal, command in zip(given, goals, found, strict=True):
            getattr(library, f"{name}_command")(
                memory, *(part.ctypes.data_as(pointer) for part in (state, goal, command))
            )
        return found.astype(np.float64)

    return commands


def _compiled(header: str, source: str, name: str) -> ctypes.CDLL:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / f"{name}.h").write_text(header, encoding="utf-8")
        (Path(folder) / f"{name}.c").write_text(source, encoding="utf-8")
        return ctypes.CDLL(str(compiled("C", Path(folder), [f"{name}.c"], "twin.so")))
