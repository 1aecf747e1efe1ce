"""One PID loop per axis, and an optional mixer to the actuators (paper, section V)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from twinloop import _core
from twinloop.controllers.bounds import GainBounds, bounds_by_name, gain_units
from twinloop.controllers.family import Family, Gain
from twinloop.controllers.mixer import Mixer, check_output
from twinloop.errors import InvalidInput, engine_input, unknown
from twinloop.records import Recorded
from twinloop.signals import Signals

TERMS = ("kp", "ki", "kd")
Axis = tuple[str, "str | None"]


@dataclass(frozen=True, eq=False)
class PID(Recorded, kind="pid"):
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
        names = [f"{angle}.{term}" for angle in angles for term in TERMS]
        object.__setattr__(self, "gains", bounds_by_name("PID", self.gains, names))
        check_output("PID", self.output)

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
        if self.output is not None:
            self.output.check(signals.n_u, len(self.axes))
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


def _axis(axis: object) -> Axis:
    if isinstance(axis, Iterable) and not isinstance(axis, str):
        pair = tuple(axis)
        if len(pair) == 2 and isinstance(pair[0], str) and (pair[1] is None or isinstance(pair[1], str)):
            return pair
    raise InvalidInput(
        f"PID, axes: expected pairs (angle, rate or None) of names, found {axis!r}; write both."
    )
