"""What was exported, as a function that runs it: the checks compare this with the twin or the controller."""

from __future__ import annotations

import ctypes
import tempfile
import warnings
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import NotAvailable
from twinloop.law.exports.compiling import compiled
from twinloop.law.exports.sensor_source import reach
from twinloop.law.law import Law

MOST_REMEMBERED = 10_000
"""Numbers that a controller remembers at most."""
Commanding = Callable[[Floats, Floats], Floats]
"""Commands (n, n_u) on states (n, n_x), one period after the other, for a target (n_x,) or one a state (n, n_x)."""
Simulation = Callable[[Floats, Floats], Floats]
"""The states (n + 1, n_x) of a free run from a state (n_x,) under commands (n, n_u); where a sensor is late, beside
them what all sensors read of it (n + 1, 2 n_x)."""


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
    needed("casadi", "casadi")
    return python_simulation(source)


def control_simulation(source: str) -> Simulation:
    """What python-control simulates with an exported system.

    Args:
        source: of the module, written by us.

    Raises:
        NotAvailable: python-control is missing.
    """
    control = needed("control", "control")
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
    needed("gymnasium", "gymnasium")
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


def needed(module: str, extra: str) -> Any:
    """A module of an extra."""
    try:
        return import_module(module)
    except ImportError as missing:
        raise NotAvailable(
            f"Export: expected the package {module!r} to check it with, found none; pip install 'twinloop[{extra}]', or"
            " pass --force (force=True in Python)."
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
