"""From what an axis asks for to what the actuators get: a linear map, a power, and the bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats, floats, number
from twinloop._ground.texts import text
from twinloop.errors import InvalidInput
from twinloop.records import Recorded
from twinloop.signals import Signals

ROUNDED = 1e-9
"""Share of a command's bounds that a command at rest may be beyond them by."""


@dataclass(frozen=True, eq=False)
class Mixer(Recorded, kind="mixer"):
    """command = clip(sign(v) |v| ** power), v = matrix u + offset, with one entry of u per axis.

    Args:
        matrix: (n_u, axes), from the axes to the actuators.
        offset: (n_u,), commands of the actuators for u = 0; zeros by default.
        power: exponent, such as 0.5 from squared rotor speeds to rotor speeds.
        unit: the unit of u, for the units of the gains.

    Raises:
        InvalidInput: a shape that does not fit, numbers that are not finite, or a unit that is no text.
    """

    matrix: Floats
    offset: Floats | None = None
    power: float = 1.0
    unit: str = "u"

    def __post_init__(self) -> None:
        matrix = floats("Mixer, matrix (commands, axes)", self.matrix, (None, None))
        rows = len(matrix)
        offset = [0.0] * rows if self.offset is None else self.offset
        if np.ndim(offset) == 1 and len(offset) != rows:
            raise InvalidInput(
                f"Mixer: expected a row of the matrix and an entry of the offset for each command, found {rows} and"
                f" {len(offset)}."
            )
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "offset", floats("Mixer, offset (one entry a command)", offset, (rows,)))
        object.__setattr__(self, "power", number("Mixer, power", self.power, above=0.0))
        text("Mixer, unit", self.unit)

    @property
    def engine(self) -> tuple[Floats, Floats, float]:
        """The same as numbers, for the native engine."""
        assert self.offset is not None  # __post_init__ has set it
        return self.matrix, self.offset, self.power

    def check(self, commands: int, axes: int) -> None:
        """Checks that the matrix fits these numbers of axes and commands.

        Args:
            commands: n_u.
            axes: outputs of the controller's law.

        Raises:
            InvalidInput: a matrix of another shape.
        """
        if self.matrix.shape != (commands, axes):
            raise InvalidInput(
                f"Mixer, matrix: expected the shape ({commands}, {axes}) (commands, axes), found"
                f" {self.matrix.shape}; one row a command, one column an axis."
            )

    def check_offset(self, signals: Signals) -> None:
        """Refuses an offset that no command can reach; 0 is none, and may be beyond the bounds.

        Args:
            signals: with as many commands.

        Raises:
            InvalidInput: such an offset.
        """
        assert self.offset is not None  # __post_init__ has set it
        at_rest = np.sign(self.offset) * np.abs(self.offset) ** self.power
        for command, value in zip(signals.commands, at_rest.tolist(), strict=True):
            low, high = command.bounds
            beyond = ROUNDED * max(abs(low), abs(high))
            if value != 0.0 and not low - beyond <= value <= high + beyond:
                raise InvalidInput(
                    f"Mixer, offset: expected {command.name} within its bounds, {low:g} to {high:g}, where no axis asks"
                    f" for anything, found {value:g}; give it in the unit of the command."
                )


def check_output(family: str, output: object) -> None:
    """Refuses an output that is neither a mixer nor none.

    Args:
        family: whose output it is, for the error.
        output: what was given.

    Raises:
        InvalidInput: something else.
    """
    if output is not None and not isinstance(output, Mixer):
        raise InvalidInput(f"{family}, output: expected a Mixer or None, found {output!r}; build a Mixer.")
