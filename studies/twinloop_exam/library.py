"""Monomials of a model's inputs, and a program out of their coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.errors import unknown
from twinloop.signals import Signals

Term = tuple[int, ...]
"""A monomial: inputs of the model that are multiplied; () is 1."""
VARIABLES = ("rates", "all")


@dataclass(frozen=True)
class Library:
    """Monomials of the inputs of a model, which are the states, then the commands over their scales.

    Args:
        terms: the monomials.
    """

    terms: tuple[Term, ...]

    def values(self, inputs: Floats) -> Floats:
        """Every monomial.

        Args:
            inputs: of the model (rows, n_x + n_u), as `model_inputs`.

        Returns:
            (rows, terms).
        """
        columns = [inputs[:, list(term)].prod(axis=1) for term in self.terms]
        return np.stack(columns, axis=1)

    def model(self, coefficients: Floats, signals: Signals) -> _core.Model:
        """Dynamics with linear combinations of the monomials as accelerations.

        Args:
            coefficients: (terms, outputs).
            signals: of the system.

        Returns:
            A model in the form "acceleration".

        Raises:
            InvalidInput: another number of outputs than the signals have unknown derivatives.
        """
        program = _core.Program.parse(self._text(coefficients, signals))
        return _core.Model(program, "acceleration", signals.engine)

    def _text(self, coefficients: Floats, signals: Signals) -> str:
        n_inputs = signals.n_x + signals.n_u
        n_outputs = coefficients.shape[1]
        product, share = n_inputs + n_outputs, n_inputs + n_outputs + 1
        lines = [f"program inputs={n_inputs} outputs={n_outputs} registers={share + 1}", "page 1"]
        for term, row in zip(self.terms, coefficients.tolist(), strict=True):
            if not any(row):
                continue
            register = term[0] if len(term) == 1 else product
            for i, factor in enumerate(term[1:]):
                lines.append(f"r{product} = r{term[0] if i == 0 else product} * r{factor}")
            for output, coefficient in enumerate(row, start=n_inputs):
                if coefficient == 0.0:
                    continue
                if term:
                    lines.append(f"r{share} = r{register} * {coefficient!r}")
                    lines.append(f"r{output} = r{output} + r{share}")
                else:
                    lines.append(f"r{output} = r{output} + {coefficient!r}")
        if len(lines) == 2:  # a page holds at least one instruction; adding 0 to 0 changes nothing
            lines.append(f"r{n_inputs} = r{n_inputs} + 0.0")
        return "\n".join(lines)


def monomials(variables: Sequence[int], degree: int = 2) -> Library:
    """All monomials up to a degree.

    Args:
        variables: inputs of the model that may appear.
        degree: the highest.

    Returns:
        The library, 1 first, then by degree.
    """
    terms = [
        term
        for total in range(degree + 1)
        for term in combinations_with_replacement(sorted(variables), total)
    ]
    return Library(tuple(terms))


def variables_of(kind: str, signals: Signals) -> list[int]:
    """Inputs of the model that a library is made of.

    Args:
        kind: "rates": the states whose derivative is unknown, and the commands; "all": every input. On the
            quadrotor 7 and 10, which makes 36 and 66 monomials to degree 2.
        signals: of the system.

    Returns:
        Their indices.

    Raises:
        InvalidInput: another kind.
    """
    if kind not in VARIABLES:
        raise unknown("variables of a library", kind, VARIABLES)
    states = signals.driven if kind == "rates" else range(signals.n_x)
    return [*states, *range(signals.n_x, signals.n_x + signals.n_u)]


def model_inputs(states: Floats, commands: Floats, signals: Signals) -> Floats:
    """What a program sees.

    Args:
        states: (rows, n_x), SI units, radians.
        commands: (rows, n_u), in their units.
        signals: of the system.

    Returns:
        (rows, n_x + n_u): states as they are, commands over their scales.
    """
    return np.hstack([states, commands / np.array([command.size for command in signals.commands])])
