"""Whether what was exported gives the numbers of the twin, on the flights that it was learnt from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.controllers import Family
from twinloop.errors import NotAvailable
from twinloop.law.exports.python_source import equation_roots
from twinloop.law.exports.simulations import Commanding, Simulation
from twinloop.law.law import Law
from twinloop.trajectory import Trajectory

CLOSE = {"double": 1e-9, "float": 1e-3}
"""Largest difference, as a share of a state's scale, or of the state where that is larger."""


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
                    " is protected there, which SymPy's is not. Pass --force (force=True in Python) to export it"
                    " anyway."
                )


def _numbers(values: list[float]) -> SimpleNamespace:
    """Stands for SymPy where symbols are numbers, taken in their order."""
    remaining = iter(values)

    def symbols(names: str, real: bool) -> list[float]:
        return [next(remaining) for _ in names.split()]

    return SimpleNamespace(
        # What late sensors read has a time, and no number here.
        Symbol=lambda name, real: 0.0,
        Function=lambda name, real: float,
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
        if target.ndim == 2:  # an attached flight may be longer
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
                f" flight {number}{reason}. Pass --force (force=True in Python) to export it anyway."
            )
