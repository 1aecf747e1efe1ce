"""Simulates with the binary of an FMU, as another simulator would: what it is checked by when it is made."""

from __future__ import annotations

import ctypes
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_uint32, c_void_p
from pathlib import Path

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import NotAvailable
from twinloop.law.exports.fmu.description import late_states
from twinloop.law.exports.simulations import Simulation
from twinloop.law.law import Law


def fmu_simulation(version: int, library: Path, token: str, law: Law) -> Simulation:
    """What an FMU simulates.

    Args:
        version: of FMI, 2 or 3.
        library: its binary.
        token: by which that knows its model description.
        law: of the twin.
    """
    loaded = ctypes.CDLL(str(library))
    n_x, n_u, dt = law.signals.n_x, law.signals.n_u, law.signals.dt
    states = (c_uint32 * n_x)(*range(1, n_x + 1))
    late = late_states(law)
    read = (c_uint32 * len(late))(*range(1 + law.inputs, 1 + law.inputs + len(late)))
    commands = (c_uint32 * n_u)(*range(n_x + 1, n_x + n_u + 1))

    def call(name: str, *arguments: object) -> None:
        status = loaded[f"fmi{version}{name}"](*arguments)
        if status != 0:
            raise NotAvailable(f"Export, FMU: expected that it runs, found status {status} of {name}.")

    def counted(values: ctypes.Array[c_double]) -> list[object]:
        """An array of values, in FMI 3.0 with its length."""
        return [values, c_size_t(len(values))] if version == 3 else [values]

    kind = "Float64" if version == 3 else "Real"

    def simulate(state: Floats, driven: Floats) -> Floats:
        instance = c_void_p(_instance(loaded, version, token))
        if not instance:
            raise NotAvailable("Export, FMU: expected an instance of its binary, found none.")
        try:
            return run(instance, state, driven)
        finally:
            loaded[f"fmi{version}FreeInstance"](instance)

    def run(instance: c_void_p, state: Floats, driven: Floats) -> Floats:
        start = (c_bool(False), c_double(0.0), c_double(0.0), c_bool(False), c_double(0.0))
        if version == 3:
            call("EnterInitializationMode", instance, *start)
        else:
            call("SetupExperiment", instance, c_int(0), *start[1:3], c_int(0), start[4])
            call("EnterInitializationMode", instance)
        given = (c_double * n_x)(*state.tolist())
        call(f"Set{kind}", instance, states, c_size_t(n_x), *counted(given))
        call("ExitInitializationMode", instance)

        def seen() -> list[float]:
            """The states, and beside them what is read where a sensor is late."""
            call(f"Get{kind}", instance, states, c_size_t(n_x), *counted(given))
            if not late:
                return list(given)
            readings, of = list(given), (c_double * len(late))()
            call(f"Get{kind}", instance, read, c_size_t(len(late)), *counted(of))
            for place, value in zip(late, of, strict=True):
                readings[place] = value
            return [*given, *readings]

        found = [seen()]
        for k, command in enumerate(driven.tolist()):
            call(f"Set{kind}", instance, commands, c_size_t(n_u), *counted((c_double * n_u)(*command)))
            step = (c_double(k * dt), c_double(dt))
            if version == 3:
                flags = [byref(c_bool()) for _ in range(3)]
                call("DoStep", instance, *step, c_bool(True), *flags, byref(c_double()))
            else:
                call("DoStep", instance, *step, c_int(1))
            found.append(seen())
        call("Terminate", instance)
        return np.array(found)

    return simulate


def _instance(loaded: ctypes.CDLL, version: int, token: str) -> int | None:
    name, known, nothing = b"check", token.encode(), None
    if version == 3:
        create = loaded.fmi3InstantiateCoSimulation
        create.restype = c_void_p
        off = c_bool(False)
        found: int | None = create(
            name, known, nothing, off, off, off, off, nothing, c_size_t(0), nothing, nothing, nothing
        )
        return found
    create = loaded.fmi2Instantiate
    create.restype = c_void_p
    found = create(name, c_int(1), known, nothing, nothing, c_int(0), c_int(0))
    return found
