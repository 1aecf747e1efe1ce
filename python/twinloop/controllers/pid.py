"""One PID loop per axis, and an optional mixer to the actuators (paper, section V)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from twinloop import _core
from twinloop.controllers.axes import (
    TERMS,
    Axis,
    asked_units,
    check_anti_windup,
    checked_axes,
    filter_time,
    place,
)
from twinloop.controllers.family import Family
from twinloop.controllers.gains import GainBounds, bounds_by_name, gain_of, gain_units
from twinloop.controllers.mixer import Mixer, check_output
from twinloop.records import Recorded
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class PID(Recorded, kind="pid"):
    """u = K_P e + K_I ∫e − K_D rate on every axis, where e = target − angle.

    The integral is updated before it is used. A gain fixed at 0 leaves its term out: a PD is a PID.

    Args:
        axes: (angle, rate) per axis, by the names of the states; a rate of None is the difference of the
            measured angle over one period.
        gains: bounds (low, high) of "<angle>.kp", "<angle>.ki" and "<angle>.kd" for every axis; a third item
            "log" where decades matter; a number instead of bounds fixes a gain.
        output: from the axes to the commands; None: axis i is command i.
        anti_windup: "clamping": an integral takes no step that would push a command further beyond a bound that it
            has reached. None: integrals never stop.
        derivative_filter: time constant of a first-order low-pass filter on the rates, s; 0: none.

    Raises:
        InvalidInput: gains that do not fit the axes, bounds in the wrong order, or unknown options.
    """

    axes: Sequence[Axis]
    gains: Mapping[str, GainBounds]
    output: Mixer | None = None
    anti_windup: str | None = None
    derivative_filter: float = 0.0

    def __post_init__(self) -> None:
        axes = checked_axes("PID", self.axes, "rate or None")
        object.__setattr__(self, "axes", axes)
        names = [f"{angle}.{term}" for angle, _ in axes for term in TERMS]
        object.__setattr__(self, "gains", bounds_by_name("PID", self.gains, names))
        object.__setattr__(self, "derivative_filter", filter_time("PID", self.derivative_filter))
        check_output("PID", self.output)
        check_anti_windup("PID", self.anti_windup)

    def bind(self, signals: Signals) -> Family:
        """The family over these signals; gains in the order (K_P, K_I, K_D) per axis.

        Args:
            signals: with the states of the axes.

        Returns:
            The family, its gains with units.

        Raises:
            InvalidInput: an axis that is no state, another number of outputs than of commands, or no gain with bounds.
        """
        axes = [
            (place("PID", angle, signals), None if rate is None else place("PID", rate, signals))
            for angle, rate in self.axes
        ]
        units = {state.name: state.unit for state in signals.states}
        asked = asked_units("PID", self.output, len(axes), signals)
        gains = [
            gain_of(f"{angle}.{term}", unit, self.gains[f"{angle}.{term}"])
            for (angle, _), of_output in zip(self.axes, asked, strict=True)
            for term, unit in zip(TERMS, gain_units(of_output, units[angle]), strict=True)
        ]
        engine = _core.Family.pid(
            signals.engine,
            axes,
            [gain.engine for gain in gains],
            None if self.output is None else self.output.engine,
            derivative_filter=self.derivative_filter,
            anti_windup=self.anti_windup is not None,
        )
        return Family(signals, gains, engine)
