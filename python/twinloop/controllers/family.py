"""A family of controllers over given signals: named, bounded gains and the engine's law behind them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop.arrays import Floats, floats, number
from twinloop.errors import InvalidInput, engine_input, unknown
from twinloop.signals import Signals


@dataclass(frozen=True)
class Gain:
    """One parameter of a family.

    Args:
        name: such as "roll.kp".
        unit: such as "N m/rad".
        low: smallest value, in its unit.
        high: largest value, in its unit.
        logarithmic: whether decades matter more than differences.
    """

    name: str
    unit: str
    low: float
    high: float
    logarithmic: bool = False


@runtime_checkable
class UnboundFamily(Protocol):
    """A description of controllers that becomes a `Family` once the signals are known."""

    def bind(self, signals: Signals) -> Family:
        """The family over these signals; raises InvalidInput where the two do not fit."""
        ...


@dataclass(frozen=True, eq=False)
class Family:
    """Controllers that differ by their gains alone.

    Args:
        signals: what they read and command.
        gains: the parameters, in the order of the genes.
        engine: the same family in the native engine.

    Raises:
        InvalidInput: the engine counts other gains than are named.
    """

    signals: Signals
    gains: Sequence[Gain]
    engine: _core.Family

    def __post_init__(self) -> None:
        object.__setattr__(self, "gains", tuple(self.gains))
        if self.engine.size != len(self.gains):
            raise InvalidInput(
                f"Family: expected {self.engine.size} named gains, found {len(self.gains)}; name every gain"
                " once."
            )

    @property
    def size(self) -> int:
        """Number of gains."""
        return len(self.gains)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the gains, in the order of the genes."""
        return tuple(gain.name for gain in self.gains)

    def genes(self, parameters: Mapping[str, float] | ArrayLike) -> Floats:
        """Gains as a vector.

        Args:
            parameters: all gains by name, or (size,) in order; each in its unit and bounds.

        Returns:
            Genes (size,), in the units of the gains.

        Raises:
            InvalidInput: a gain that is unknown, missing, not finite or out of bounds.
        """
        if isinstance(parameters, Mapping):
            for name in parameters:
                if name not in self.names:
                    raise unknown("gain", name, self.names)
            missing = [name for name in self.names if name not in parameters]
            if missing:
                raise InvalidInput(
                    f"Gains: expected all {self.size}, found none for {', '.join(missing)}; add them."
                )
            values = np.array([number(f"Gain {name!r}", parameters[name]) for name in self.names])
        else:
            values = floats("Gains", parameters, (self.size,))
        for gain, value in zip(self.gains, values, strict=True):
            if not gain.low <= value <= gain.high:
                raise InvalidInput(
                    f"Gain {gain.name!r}: expected {gain.low:g} to {gain.high:g} {gain.unit}, found"
                    f" {value:g}; change it, or widen the bounds of the family."
                )
        values.flags.writeable = False
        return values

    def parameters(self, genes: ArrayLike) -> dict[str, float]:
        """Gains by name.

        Args:
            genes: (size,), in the units of the gains.

        Returns:
            A value for each name, in the order of the genes.

        Raises:
            InvalidInput: another number of genes, or one that is not finite.
        """
        return dict(zip(self.names, floats("Genes", genes, (self.size,)).tolist(), strict=True))

    def controller(self, genes: ArrayLike, excitation: ArrayLike | None = None) -> Controller:
        """One controller of the family, reset.

        Args:
            genes: (size,), in the units of the gains.
            excitation: what is added to its commands, a row a period (n, n_u), in the units of the commands;
                nothing after the last row. None: nothing.

        Returns:
            A controller with a memory of its own.

        Raises:
            InvalidInput: another number of genes or columns, or a number that is not finite.
        """
        if excitation is not None:
            excitation = floats("Excitation (periods, commands)", excitation, (None, self.signals.n_u))
        return Controller(self, floats("Genes", genes, (self.size,)), excitation)


class Controller:
    """One controller with its memory, for a real loop: call `command` once a period.

    Args:
        family: what it is one of.
        genes: its gains (size,), in their units.
        excitation: what is added to its commands, a row a period (n, n_u); None: nothing.
    """

    def __init__(self, family: Family, genes: Floats, excitation: Floats | None = None) -> None:
        self.family = family
        self.genes = genes
        self.excitation = excitation
        with engine_input():
            self._law = family.engine.controller(genes, excitation)
        self.reset()

    @property
    def parameters(self) -> dict[str, float]:
        """Gains by name, in their units."""
        return self.family.parameters(self.genes)

    def reset(self) -> None:
        """Forgets the run so far, and starts the excitation again; call it at the start of every run."""
        self._law.reset()

    def command(self, state: ArrayLike, target: ArrayLike) -> Floats:
        """What to send for the coming period.

        Args:
            state: measured state (n_x,), SI units, radians.
            target: state to lead to (n_x,), the same units.

        Returns:
            Command (n_u,), the excitation of this period in it, within its bounds, in its units.

        Raises:
            InvalidInput: another shape, or a number that is not finite; the memory is unchanged.
        """
        n_x = self.family.signals.n_x
        return self._law.command(floats("State", state, (n_x,)), floats("Target", target, (n_x,)))

    def __repr__(self) -> str:
        gains = ", ".join(f"{name}={value:.6g}" for name, value in self.parameters.items())
        return f"Controller({gains})"
