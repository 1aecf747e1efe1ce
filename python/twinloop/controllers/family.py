"""A family of controllers over given signals: named, bounded gains and the engine's law behind them."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._experiment.hold_back import HoldBack
from twinloop._ground.arrays import Floats, floats, number
from twinloop._ground.texts import in_unit
from twinloop._ground.values import Value
from twinloop.controllers.gains import FixedGain, Gain
from twinloop.errors import InvalidInput, unknown
from twinloop.signals import Signals
from twinloop.unmeasured import Differences, columns_of, completed_state

AT_A_BOUND = 0.01
"""Share of its range within which a gain counts as at a bound."""


@runtime_checkable
class UnboundFamily(Protocol):
    """A description of controllers; with signals it becomes a `Family`."""

    def bind(self, signals: Signals) -> Family:
        """The family over these signals; raises InvalidInput if the two do not fit."""
        ...


@dataclass(frozen=True, eq=False)
class Family(Value):
    """Controllers that differ in their gains only.

    Args:
        signals: states and commands of the controllers.
        law_gains: all gains of the law, in its order: those with bounds, and those that are fixed.
        engine: the same family in the native engine.

    Raises:
        InvalidInput: the engine has another number of gains, or no gain has bounds.
    """

    signals: Signals
    law_gains: Sequence[Gain | FixedGain]
    engine: _core.Family

    def __post_init__(self) -> None:
        object.__setattr__(self, "law_gains", tuple(self.law_gains))
        if self.engine.size != len(self.gains):
            raise InvalidInput(
                f"Family: expected {self.engine.size} named gains, found {len(self.gains)}; name every gain"
                " once."
            )

    @cached_property
    def gains(self) -> tuple[Gain, ...]:
        """The parameters: gains with bounds, in the order of the genes."""
        return tuple(gain for gain in self.law_gains if isinstance(gain, Gain))

    @cached_property
    def fixed(self) -> dict[str, float]:
        """Values of the fixed gains, by name, in their units."""
        return {gain.name: gain.value for gain in self.law_gains if isinstance(gain, FixedGain)}

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.gains)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the genes."""
        return tuple(gain.name for gain in self.gains)

    def genes(self, parameters: Mapping[str, float] | ArrayLike) -> Floats:
        """Gains as a vector.

        Args:
            parameters: gains by name, or (size,) in order; each in its unit and bounds. Names of fixed gains may be
                left out.

        Returns:
            Genes (size,), in the units of the gains.

        Raises:
            InvalidInput: a gain that is unknown, missing, not finite or out of bounds, or fixed at another number.
        """
        if isinstance(parameters, Mapping):
            for name, value in parameters.items():
                if name in self.fixed:
                    self._check_fixed(name, value)
                elif name not in self.names:
                    raise unknown("gain", name, (*self.names, *self.fixed))
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
                    f"Gain {gain.name!r}: expected {in_unit(f'{gain.low:g} to {gain.high:g}', gain.unit)},"
                    f" found {value:g}; change it, or widen the bounds of the family."
                )
        values.flags.writeable = False
        return values

    def parameters(self, genes: ArrayLike) -> dict[str, float]:
        """Gains by name.

        Args:
            genes: (size,), in the units of the gains.

        Returns:
            A value for each gain of the law, in its order, including fixed gains.

        Raises:
            InvalidInput: another number of genes, or one that is not finite.
        """
        free = dict(zip(self.names, floats("Genes", genes, (self.size,)).tolist(), strict=True))
        return {gain.name: {**free, **self.fixed}[gain.name] for gain in self.law_gains}

    def _check_fixed(self, name: str, value: object) -> None:
        if number(f"Gain {name!r}", value) != self.fixed[name]:
            raise InvalidInput(
                f"Gain {name!r}: expected {self.fixed[name]:g}, which it is fixed at, found {value:g}; leave it out, or"
                " give it bounds in the family."
            )

    def to_unit(self, genes: ArrayLike) -> Floats:
        """Genes as places in the box, 0 to 1, on a logarithmic scale for logarithmic gains.

        Args:
            genes: (…, size), in the units of the gains.

        Returns:
            Places (…, size).

        Raises:
            InvalidInput: another number of genes.
        """
        return self._in_the_box(self.engine.places, genes)

    def at_bounds(self, genes: ArrayLike) -> dict[str, str]:
        """The bound that each gain has reached, within 1 % of its range: there the box decides, not the quality.

        Args:
            genes: (size,), in the units of the gains.

        Returns:
            "lower", "upper" or "", by the gains' names; the range of a logarithmic gain is in decades.

        Raises:
            InvalidInput: another number of genes.
        """
        places = self.to_unit(genes).tolist()
        return {
            gain.name: "lower" if place <= AT_A_BOUND else "upper" if place >= 1.0 - AT_A_BOUND else ""
            for gain, place in zip(self.gains, places, strict=True)
        }

    def from_unit(self, places: ArrayLike) -> Floats:
        """The genes at places in the box; the inverse of `to_unit`, clipped to the bounds.

        Args:
            places: (…, size), 0 to 1.

        Returns:
            Genes (…, size), in the units of the gains.

        Raises:
            InvalidInput: another number of places.
        """
        return self._in_the_box(self.engine.at, places)

    def _in_the_box(self, mapped: Callable[[Floats], Floats], values: ArrayLike) -> Floats:
        values = np.asarray(values, dtype=np.float64)
        if values.shape[-1:] != (self.size,):
            raise InvalidInput(
                f"Family: expected rows of {self.size} numbers, one a gain, found shape {values.shape}."
            )
        return mapped(values.reshape(-1, self.size)).reshape(values.shape)

    def controller(
        self, genes: ArrayLike, excitation: ArrayLike | None = None, hold_back: HoldBack | None = None
    ) -> Controller:
        """One controller of the family, reset.

        Args:
            genes: (size,), in the units of the gains.
            excitation: signal that is added to its commands, a row per period (n, n_u), in the units of the commands;
                zero after the last row. None: no excitation.
            hold_back: holds the excitation back during the flight; None: it is not held back.

        Returns:
            A controller with its own memory.

        Raises:
            InvalidInput: another number of genes or columns, or a number that is not finite.
        """
        if excitation is not None:
            excitation = floats("Excitation (periods, commands)", excitation, (None, self.signals.n_u))
        return Controller(self, floats("Genes", genes, (self.size,)), excitation, hold_back)


class Controller:
    """One controller with its memory, for a real loop: call `command` once per period.

    A copy is in the midst of the same run, with a memory of its own.

    Args:
        family: of the controller.
        genes: its gains (size,), in their units.
        excitation: signal that is added to its commands, a row per period (n, n_u); None: no excitation.
        hold_back: holds the excitation back; None: it is not held back.
    """

    def __init__(
        self,
        family: Family,
        genes: Floats,
        excitation: Floats | None = None,
        hold_back: HoldBack | None = None,
    ) -> None:
        self.family = family
        self.genes = genes
        self.excitation = excitation
        held = None if hold_back is None else hold_back.engine
        self._law = family.engine.controller(genes, excitation, held)
        self._differences = Differences(family.signals)
        self.reset()

    @property
    def parameters(self) -> dict[str, float]:
        """Gains by name, in their units."""
        return self.family.parameters(self.genes)

    def reset(self) -> None:
        """Clears the memory and restarts the excitation; call it at the start of every run."""
        self._law.reset()
        self._differences.reset()

    def command(self, state: ArrayLike, target: ArrayLike) -> Floats:
        """The command for the coming period.

        Args:
            state: measured state (n_x,), SI units, radians; or of those states alone that are measured.
            target: target state (n_x,), the same units.

        Returns:
            Command (n_u,) with the excitation of this period, within its bounds, in its units.

        Raises:
            InvalidInput: another shape, or a number that is not finite; the memory is unchanged.
        """
        signals = self.family.signals
        reading = floats("State", state, (columns_of(state, signals),))
        goal = completed_state("Target", target, signals)
        return self._law.command(self._differences.completed(reading), goal)

    def commands(self, states: Floats, targets: Floats) -> Floats:
        """The commands of a whole run, from rest.

        Args:
            states: measured states (n, n_x), SI units, radians.
            targets: target states (n, n_x), the same units.

        Returns:
            Commands (n, n_u), as `command` gives them one after another.

        Raises:
            InvalidInput: other shapes, or numbers that are not finite.
        """
        n_x = self.family.signals.n_x
        if states.shape != targets.shape or states.shape[1:] != (n_x,):
            raise InvalidInput(
                f"Controller.commands: expected as many states as targets, of {n_x} numbers each, found the shapes"
                f" {states.shape} and {targets.shape}; record each period."
            )
        if not (np.isfinite(states).all() and np.isfinite(targets).all()):
            raise InvalidInput(
                "Controller.commands: expected finite states and targets, found NaN or an infinite one; cut the record"
                " before it."
            )
        self.reset()
        return np.array([self._law.command(*row) for row in zip(states, targets, strict=True)])

    def __copy__(self) -> Controller:
        """The controller in the midst of the same run, with a memory of its own."""
        copied = object.__new__(Controller)
        copied.__dict__.update(self.__dict__)
        copied._law = self._law.copied()
        copied._differences = copy.copy(self._differences)
        return copied

    def __deepcopy__(self, memo: dict[int, object]) -> Controller:
        """As `copy.copy`: what both share never changes."""
        return copy.copy(self)

    def __repr__(self) -> str:
        gains = ", ".join(f"{name}={value:.6g}" for name, value in self.parameters.items())
        return f"Controller({gains})"
