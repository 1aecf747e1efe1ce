"""One PID loop per axis, and an optional mixer to the actuators (paper, section V)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from twinloop import _core
from twinloop.arrays import number
from twinloop.controllers.family import Family, Gain
from twinloop.controllers.mixer import Mixer
from twinloop.errors import InvalidInput, engine_input, unknown
from twinloop.signals import Signals, ordered

TERMS = ("kp", "ki", "kd")
Axis = tuple[str, "str | None"]
GainBounds = tuple[float, float] | tuple[float, float, str]


@dataclass(frozen=True, eq=False)
class PID:
    """u = K_P e + K_I ∫e − K_D rate on every axis, where e = target − angle.

    The integral is updated before it is used. There is no anti-windup.

    Args:
        axes: (angle, rate) per axis, by the names of the states; a rate of None is the difference of the
            measured angle over one period.
        gains: bounds (low, high) of "<angle>.kp", "<angle>.ki" and "<angle>.kd" for every axis; a third item
            "log" where decades matter.
        output: from the axes to the commands; None: axis i is command i.

    Raises:
        InvalidInput: gains that do not fit the axes, or bounds the wrong way round.
    """

    axes: Sequence[Axis]
    gains: Mapping[str, GainBounds]
    output: Mixer | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", tuple(_axis(axis) for axis in self.axes))
        angles = [angle for angle, _ in self.axes]
        if not angles or len(set(angles)) != len(angles):
            raise InvalidInput(
                f"PID, axes: expected at least one axis and each angle once, found {angles}; mend them."
            )
        if not isinstance(self.gains, Mapping):
            raise InvalidInput(
                f"PID, gains: expected a dict of bounds by name, found {self.gains!r}; name every gain."
            )
        names = [f"{angle}.{term}" for angle in angles for term in TERMS]
        for name in self.gains:
            if name not in names:
                raise unknown("gain", name, names)
        missing = [name for name in names if name not in self.gains]
        if missing:
            raise InvalidInput(
                f"PID, gains: expected bounds for all {len(names)}, found none for {', '.join(missing)}; add"
                " them."
            )
        if self.output is not None and not isinstance(self.output, Mixer):
            raise InvalidInput(
                f"PID, output: expected a Mixer or None, found {self.output!r}; build a Mixer."
            )
        object.__setattr__(self, "gains", {name: _bounds(name, self.gains[name]) for name in names})

    def bind(self, signals: Signals) -> Family:
        """The family over these signals; genes in the order (K_P, K_I, K_D) per axis.

        Args:
            signals: where the axes are found.

        Returns:
            The family, its gains with units.

        Raises:
            InvalidInput: an axis that is no state, or another number of outputs than of commands.
        """
        index = {name: i for i, name in enumerate(signals.state_names)}
        for name in (name for axis in self.axes for name in axis if name is not None):
            if name not in index:
                raise unknown("state in the axes of a PID", name, index)
        if self.output is None and len(self.axes) != signals.n_u:
            raise InvalidInput(
                f"PID: expected one axis for each of the {signals.n_u} commands, found {len(self.axes)}; "
                "add axes, or an output=Mixer(...)."
            )
        if self.output is not None and self.output.matrix.shape != (signals.n_u, len(self.axes)):
            raise InvalidInput(
                f"Mixer, matrix: expected the shape ({signals.n_u}, {len(self.axes)}) (commands, axes), found"
                f" {self.output.matrix.shape}; one row a command, one column an axis."
            )
        gains = self._gains(signals)
        with engine_input():
            engine = _core.Family.pid(
                signals.engine,
                [(index[angle], None if rate is None else index[rate]) for angle, rate in self.axes],
                [gain.low for gain in gains],
                [gain.high for gain in gains],
                [gain.logarithmic for gain in gains],
                None if self.output is None else self.output.matrix,
                None if self.output is None else self.output.offset,
                1.0 if self.output is None else self.output.power,
            )
        return Family(signals, gains, engine)

    def _gains(self, signals: Signals) -> list[Gain]:
        units = {state.name: state.unit for state in signals.states}
        gains = []
        for i, (angle, _) in enumerate(self.axes):
            asked = signals.commands[i].unit if self.output is None else self.output.unit
            for term, unit in zip(TERMS, gain_units(asked, units[angle]), strict=True):
                name = f"{angle}.{term}"
                low, high, *scale = self.gains[name]
                gains.append(Gain(name, unit, float(low), float(high), scale == ["log"]))
        return gains


def gain_units(output: str, angle: str) -> tuple[str, str, str]:
    """Units of K_P, K_I and K_D of an axis.

    Args:
        output: unit of what the axis asks for.
        angle: unit of what the axis controls.

    Returns:
        The three units, such as "N m/rad", "N m/(rad s)" and "N m s/rad".
    """
    top = f"({output})" if "/" in output else output or "1"
    bottom = f"({angle})" if "/" in angle or " " in angle else angle or "1"
    return f"{top}/{bottom}", f"{top}/({bottom} s)", f"{top} s/{bottom}"


def _axis(axis: object) -> Axis:
    if isinstance(axis, Iterable) and not isinstance(axis, str):
        pair = tuple(axis)
        if len(pair) == 2 and isinstance(pair[0], str) and (pair[1] is None or isinstance(pair[1], str)):
            return pair
    raise InvalidInput(
        f"PID, axes: expected pairs (angle, rate or None) of names, found {axis!r}; write both."
    )


def _bounds(name: str, bounds: object) -> GainBounds:
    items = tuple(bounds) if isinstance(bounds, Iterable) and not isinstance(bounds, str) else ()
    what = f"Gain {name!r}, bounds"
    if len(items) == 3 and items[2] != "log":
        raise InvalidInput(
            f'{what}: expected "log" as the third item, found {items[2]!r}; write "log" or leave it out.'
        )
    if len(items) not in (2, 3):
        raise InvalidInput(
            f'{what}: expected (low, high) or (low, high, "log"), found {bounds!r}; write both numbers.'
        )
    low, high = ordered(what, items[:2])
    if len(items) == 3 and number(what, low) <= 0.0:
        raise InvalidInput(
            f'{what}: expected low > 0 with "log", found {low:g}; raise it, or leave "log" out.'
        )
    return (low, high, "log") if len(items) == 3 else (low, high)
