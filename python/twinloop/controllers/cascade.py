"""A loop on the angle around a loop on its rate, axis by axis, as the autopilots of drones have it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from twinloop import _core
from twinloop._ground.arrays import number
from twinloop.controllers.axes import (
    TERMS,
    asked_units,
    check_anti_windup,
    checked_axes,
    filter_time,
    place,
)
from twinloop.controllers.family import Family
from twinloop.controllers.gains import GainBounds, bounds_by_name, gain_of, gain_units
from twinloop.controllers.mixer import Mixer, check_output
from twinloop.errors import InvalidInput, unknown
from twinloop.records import Recorded
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class Cascade(Recorded, kind="cascade"):
    """Per axis, a P controller on the angle sets a rate, and a PID controller on the rate follows it.

    rate set point = clip(K (target − angle) + target's rate, ± limit), e = rate set point − rate, and
    u = K_P e + K_I ∫e − K_D d(rate)/dt, where the derivative is the difference of the measured rate over one period.
    The integral is updated before it is used. In PX4 the gains are MC_ROLL_P, MC_ROLLRATE_P, _I and _D, and the limit
    is MC_ROLLRATE_MAX.

    Args:
        axes: (angle, rate) per axis, by the names of the states.
        gains: bounds (low, high) of "<angle>.kp" (the outer loop), "<rate>.kp", "<rate>.ki" and "<rate>.kd" for every
            axis; a third item "log" where decades matter; a number instead of bounds fixes a gain.
        output: from the axes to the commands; None: axis i is command i.
        rate_limits: largest rate set point, by the name of the rate, in its unit; without one there is no limit.
        anti_windup: "clamping": an integral takes no step that would push a command further beyond a bound that it
            has reached. None: integrals never stop.
        derivative_filter: time constant of a first-order low-pass filter on the derivative of the rate, s; 0: none.

    Raises:
        InvalidInput: gains or limits that do not fit the axes, bounds in the wrong order, or unknown options.
    """

    axes: Sequence[tuple[str, str]]
    gains: Mapping[str, GainBounds]
    output: Mixer | None = None
    rate_limits: Mapping[str, float] | None = None
    anti_windup: str | None = None
    derivative_filter: float = 0.0

    def __post_init__(self) -> None:
        axes = [
            (angle, rate) for angle, rate in checked_axes("Cascade", self.axes, "rate") if rate is not None
        ]
        rates = [rate for _, rate in axes]
        if len(axes) < len(tuple(self.axes)) or len({name for axis in axes for name in axis}) != 2 * len(
            axes
        ):
            raise InvalidInput(
                f"Cascade, axes: expected pairs (angle, rate) and every state once, found {self.axes}; give each angle"
                " a rate of its own."
            )
        object.__setattr__(self, "axes", tuple(axes))
        object.__setattr__(self, "gains", bounds_by_name("Cascade", self.gains, _names(axes)))
        limits = {} if self.rate_limits is None else self.rate_limits
        if not isinstance(limits, Mapping):
            raise InvalidInput(
                f"Cascade, rate_limits: expected a dict of limits by the names of the rates, found {limits!r}."
            )
        for name in limits:
            if name not in rates:
                raise unknown("rate to limit", name, rates)
        limits = {
            name: number(f"Cascade, rate limit of {name!r}", limit, above=0.0)
            for name, limit in limits.items()
        }
        object.__setattr__(self, "rate_limits", limits)
        object.__setattr__(self, "derivative_filter", filter_time("Cascade", self.derivative_filter))
        check_output("Cascade", self.output)
        check_anti_windup("Cascade", self.anti_windup)

    def bind(self, signals: Signals) -> Family:
        """The family over these signals; gains in the order (K, K_P, K_I, K_D) per axis.

        Args:
            signals: with the states of the axes.

        Returns:
            The family, its gains with units.

        Raises:
            InvalidInput: an axis that is no state, another number of outputs than of commands, or no gain with bounds.
        """
        assert self.rate_limits is not None  # __post_init__ has set it
        axes = [
            (
                place("Cascade", angle, signals),
                place("Cascade", rate, signals),
                self.rate_limits.get(rate, math.inf),
            )
            for angle, rate in self.axes
        ]
        units = {state.name: state.unit for state in signals.states}
        gains = []
        asked = asked_units("Cascade", self.output, len(axes), signals)
        for (angle, rate), of_output in zip(self.axes, asked, strict=True):
            of_axis = (gain_units(units[rate], units[angle])[0], *gain_units(of_output, units[rate]))
            for name, unit in zip(_names([(angle, rate)]), of_axis, strict=True):
                gains.append(gain_of(name, unit, self.gains[name]))
        engine = _core.Family.cascade(
            signals.engine,
            axes,
            [gain.engine for gain in gains],
            None if self.output is None else self.output.engine,
            derivative_filter=self.derivative_filter,
            anti_windup=self.anti_windup is not None,
        )
        return Family(signals, gains, engine)


def _names(axes: Sequence[tuple[str, str]]) -> list[str]:
    """Names of the gains, in the order of the law."""
    return [name for angle, rate in axes for name in (f"{angle}.kp", *(f"{rate}.{term}" for term in TERMS))]
