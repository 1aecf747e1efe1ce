"""What a gain is called elsewhere, in which unit, and between which limits: declared by a user, never guessed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from twinloop._ground.arrays import number
from twinloop.errors import InvalidInput
from twinloop.signals import Bounds, ordered

Value = float | int


@dataclass(frozen=True)
class Parameter:
    """The parameter of a gain: scale times the gain, plus the offset.

    Args:
        name: of the parameter in the autopilot.
        scale: factor on the gain, in units of the parameter per unit of the gain.
        offset: in units of the parameter.
        limits: smallest and largest value of the parameter; None: no limits.
        whole: whether the parameter is a whole number; then the value is rounded.

    Raises:
        InvalidInput: a scale of 0, or numbers that are not finite.
    """

    name: str
    scale: float = 1.0
    offset: float = 0.0
    limits: Bounds | None = None
    whole: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InvalidInput(
                f"Parameter: expected a name, found {self.name!r}; write what the autopilot calls it."
            )
        object.__setattr__(self, "scale", number(f"Parameter {self.name!r}, scale", self.scale))
        object.__setattr__(self, "offset", number(f"Parameter {self.name!r}, offset", self.offset))
        if self.scale == 0.0:
            raise InvalidInput(f"Parameter {self.name!r}, scale: expected a number that is not 0, found 0.")
        if self.limits is not None:
            object.__setattr__(self, "limits", ordered(f"Parameter {self.name!r}, limits", self.limits))
        if not isinstance(self.whole, bool):
            raise InvalidInput(
                f"Parameter {self.name!r}, whole: expected true or false, found {self.whole!r}."
            )

    def value(self, gain: str, given: float) -> Value:
        """The value of the parameter.

        Args:
            gain: its name, for an error.
            given: the gain, in its unit.

        Raises:
            InvalidInput: a gain that is not finite, or a value beyond the limits.
        """
        if not math.isfinite(given):
            raise InvalidInput(
                f"Gain {gain!r}: expected a finite number for {self.name!r}, found {given!r}; nothing is written."
            )
        value = self.scale * given + self.offset
        if not math.isfinite(value):
            raise InvalidInput(
                f"Parameter {self.name!r}: expected a finite number, found {value!r}; correct its scale."
            )
        found: Value = round(value) if self.whole else value
        low, high = (-math.inf, math.inf) if self.limits is None else self.limits
        if not low <= found <= high:
            raise InvalidInput(
                f"Parameter {self.name!r}: expected {low:g} to {high:g}, found {found:g} for the gain {gain!r} ="
                f" {given:g}; nothing is written. Correct its scale, or the bounds of the gain."
            )
        return found


def translated(
    parameters: Mapping[str, Parameter | None], gains: Mapping[str, float]
) -> dict[str, tuple[Value, bool]]:
    """All parameters by name, with whether each is a whole number.

    Args:
        parameters: by the name of the gain; None for one that the autopilot has not got, and that is 0.
        gains: all of a controller, by name, in their units.

    Raises:
        InvalidInput: a gain without a parameter, a parameter without a gain, or a value that cannot be used.
    """
    missing = [gain for gain in gains if gain not in parameters]
    if missing:
        raise InvalidInput(
            f"Autopilot: expected a parameter for each gain, found none for {', '.join(map(repr, missing))}; declare"
            " what the autopilot calls them."
        )
    unused = [gain for gain in parameters if gain not in gains]
    if unused:
        raise InvalidInput(
            f"Autopilot: expected parameters for gains of the controller, found {', '.join(map(repr, unused))}; its"
            f" gains are {', '.join(gains)}."
        )
    found: dict[str, tuple[Value, bool]] = {}
    for gain, given in gains.items():
        parameter = parameters[gain]
        if parameter is not None:
            found[parameter.name] = parameter.value(gain, given), parameter.whole
        elif given != 0.0:
            raise InvalidInput(
                f"Gain {gain!r}: expected 0, because the autopilot is declared to have no parameter for it, found"
                f" {given!r}; declare one."
            )
    return found
