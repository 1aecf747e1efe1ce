"""A functional mock-up unit (FMU) as a system: co-simulation, FMI 2.0 or 3.0, one communication step a period."""

from __future__ import annotations

import importlib
import shutil
import tempfile
import weakref
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats, floats, number
from twinloop._ground.values import Value
from twinloop.errors import InvalidInput, NotAvailable, SystemFailure, unknown
from twinloop.signals import Signals
from twinloop.systems.stepped import Deviations, Episode, Stepped
from twinloop.test import Test
from twinloop.trajectory import Trajectory

MOST_BYTES = 2_000_000_000
"""Of an FMU, unpacked."""
REAL = ("Real", "Float64")
"""Types of the variables that can be read and set: FMI 2.0, FMI 3.0."""
FATAL = 4
"""Status after which an FMU may not even be freed."""


class FMU(Stepped):
    """Runs tests on an FMU for co-simulation, with FMPy; a new instance for each run.

    **An FMU contains a program for this machine, and running it runs that program with all your rights.** Use an FMU
    only if you would run a program of its author. If it crashes, the process crashes too; a campaign in a store can
    continue.

    Args:
        path: of the file.
        signals: states, commands and the period, which is the communication step.
        commands: name of the FMU's input for each command, by the command's name; by default the same name.
        states: name of the FMU's variable for each state, by the state's name; by default the same name.
        start: name of the variable or parameter that sets the initial value of a state before initialisation, by the
            state's name; None: the state's own variable, if it may be set. A state that cannot be set begins at the
            FMU's own value, and is recorded and learnt from there.
        parameters: values of other variables that are set before initialisation, by name.
        noise: standard deviations of added sensor noise, as in `Simulated`.
        seed: of the noise.
        default_gains: a safe first controller, by name.

    Raises:
        InvalidInput: no FMU for co-simulation in FMI 2.0 or 3.0, or a variable that it does not have.
        NotAvailable: FMPy is not installed.
    """

    def __init__(
        self,
        path: str | Path,
        signals: Signals,
        *,
        commands: Mapping[str, str] | None = None,
        states: Mapping[str, str] | None = None,
        start: Mapping[str, str] | None = None,
        parameters: Mapping[str, float] | None = None,
        noise: Deviations = 0.0,
        seed: int = 0,
        default_gains: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(signals, noise=noise, seed=seed, default_gains=default_gains)
        self.path = Path(path)
        self._description = _described(_library(), self.path)
        known = {variable.name: variable for variable in self._description.modelVariables}
        self._inputs = _references(known, "commands", signals.command_names, commands, ("input",))
        self._outputs = _references(known, "states", signals.state_names, states)
        self._starts = _starts(known, signals, dict(states or {}), start)
        given = {} if parameters is None else dict(parameters)
        named = _references(known, "parameters", tuple(given), None)
        self._parameters = [
            (reference, number(f"FMU, parameters: {name}", value))
            for reference, (name, value) in zip(named, given.items(), strict=True)
        ]
        self._unpacked = _Unpacked(self.path)

    def _begin(self, test: Test) -> Episode:
        return _Run(self, test)


class _Run:
    """One instance."""

    def __init__(self, system: FMU, test: Test) -> None:
        self.system, self.k, self.instance = system, 0, None  # type: tuple[FMU, int, Any]
        self.second = system._description.fmiVersion.startswith("2.")
        before = [
            *system._parameters,
            *((place, float(test.initial_state[i])) for i, place in system._starts),
        ]
        try:
            simulation = importlib.import_module("fmpy.simulation")
            self.instance = simulation.instantiate_fmu(
                system._unpacked.folder, system._description, fmi_type="CoSimulation", require_functions=False
            )
            if self.second:
                self.instance.setupExperiment(startTime=0.0)
            self.write([place for place, _ in before], [value for _, value in before])
            self.instance.enterInitializationMode()
            self.instance.exitInitializationMode()
            self.start = floats("FMU, states at the start", self.read(), (system.signals.n_x,))
        except Exception as cause:
            self.close(cause)
            raise SystemFailure(
                f"The FMU {system.path} refused to begin: {cause}; look at its parameters and its start."
            ) from cause

    def __call__(self, state: Floats, command: Floats) -> ArrayLike:
        """The state one period later."""
        dt = self.system.signals.dt
        try:
            self.write(self.system._inputs, command.tolist())
            answer = self.instance.doStep(self.k * dt, dt)
            following = np.array(self.read())
        except Exception as cause:
            self.close(cause)
            raise SystemFailure(
                f"The FMU {self.system.path} failed in step {self.k}, {self.k * dt:.4g} s after the start: {cause};"
                " tell the test as failed, or correct the FMU."
            ) from cause
        self.k += 1
        # FMI 3.0: (event, terminate, early return, time).
        return np.full_like(following, np.nan) if answer and (answer[1] or answer[2]) else following

    def finished(self, flown: Trajectory) -> Trajectory:
        """As it was flown."""
        return flown

    def close(self, failure: Exception | None = None) -> None:
        """Frees the instance."""
        instance, self.instance = self.instance, None
        if instance is None or getattr(failure, "status", None) == FATAL:
            return
        with suppress(Exception):
            if failure is None:
                instance.terminate()
        with suppress(Exception):
            instance.freeInstance()

    def read(self) -> list[float]:
        get = self.instance.getReal if self.second else self.instance.getFloat64
        return list(get(self.system._outputs))

    def write(self, places: Sequence[int], values: Sequence[float]) -> None:
        if places:
            (self.instance.setReal if self.second else self.instance.setFloat64)(places, values)


def _library() -> Any:
    try:
        return importlib.import_module("fmpy")
    except ImportError as missing:
        raise NotAvailable(
            "systems.FMU: expected the package FMPy, found none; pip install 'twinloop[fmu]'."
        ) from missing


def _described(library: Any, path: Path) -> Any:
    try:
        with zipfile.ZipFile(path) as packed:
            _check_members(path, packed.infolist())
        found = library.read_model_description(str(path))
    except InvalidInput:
        raise
    except OSError as reason:
        raise InvalidInput(
            f"FMU {path}: expected a file, found {reason.strerror}; check its name."
        ) from reason
    except Exception as reason:
        raise InvalidInput(f"FMU {path}: expected an FMU, found something else: {reason}.") from reason
    if found.coSimulation is None or not found.fmiVersion.startswith(("2.", "3.")):
        kind = "model exchange" if found.coSimulation is None else "co-simulation"
        raise InvalidInput(
            f"FMU {path}: expected co-simulation in FMI 2.0 or 3.0, found {kind} in FMI {found.fmiVersion}; export it"
            " again for co-simulation."
        )
    return found


def _check_members(path: Path, members: Iterable[zipfile.ZipInfo]) -> None:
    """Refuses what would be written elsewhere than into its folder, or fill the disk."""
    total = 0
    for member in members:
        total += member.file_size
        parts = member.filename.replace("\\", "/").split("/")
        if ".." in parts or member.filename.startswith(("/", "\\")) or ":" in parts[0]:
            raise InvalidInput(
                f"FMU {path}: expected names of files inside of it, found {member.filename!r}; do not use it."
            )
    if total > MOST_BYTES:
        raise InvalidInput(
            f"FMU {path}: expected at most {MOST_BYTES} bytes unpacked, found {total}; make it smaller."
        )


class _Unpacked(Value):
    """The files of an FMU in a folder that is there as long as a system, or a copy of it, is."""

    def __init__(self, path: Path) -> None:
        self.folder = tempfile.mkdtemp(prefix="twinloop-fmu-")
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
        with zipfile.ZipFile(path) as packed:
            packed.extractall(self.folder)


def _references(
    known: Mapping[str, Any],
    what: str,
    names: Sequence[str],
    mapping: Mapping[str, str] | None,
    causalities: tuple[str, ...] = (),
) -> list[int]:
    """References of the variables that stand for names."""
    mapping = {} if mapping is None else mapping
    for name in mapping:
        if name not in names:
            raise unknown(f"name in {what} of the FMU", name, names)
    found = []
    for name in names:
        wanted = mapping.get(name, name)
        fit = [key for key, one in known.items() if not causalities or one.causality in causalities]
        if wanted not in fit:
            raise unknown(f"variable of the FMU for {what}:", wanted, fit)
        if known[wanted].type not in REAL:
            raise InvalidInput(
                f"FMU, {what}: expected a real number for {wanted!r}, found {known[wanted].type};"
                " choose another variable."
            )
        found.append(int(known[wanted].valueReference))
    return found


def _starts(
    known: Mapping[str, Any], signals: Signals, states: dict[str, str], start: Mapping[str, str] | None
) -> list[tuple[int, int]]:
    """Numbers of the states whose start can be set, with the references that it is set at."""
    names = signals.state_names
    if start is not None:
        places = _references(known, "start", names, {**states, **start})
        return [
            (i, place) for i, (name, place) in enumerate(zip(names, places, strict=True)) if name in start
        ]
    variables = [known[states.get(name, name)] for name in names]
    return [
        (i, int(one.valueReference)) for i, one in enumerate(variables) if one.initial in ("exact", "approx")
    ]
