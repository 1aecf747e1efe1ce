"""Controllers of one's own, written in Python."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.controllers.family import Family
from twinloop.controllers.gains import GainBounds, bounds_by_name, gain_of
from twinloop.errors import InvalidInput
from twinloop.signals import Signals


class Law(Protocol):
    """The methods of a controller in Python."""

    def reset(self) -> None:
        """Clears the memory; called at the start of every run."""
        ...

    def command(self, state: Floats, target: Floats) -> ArrayLike:
        """The command for the coming period (n_u,), from a measured state and a target (n_x,), in their units."""
        ...


@dataclass(frozen=True, eq=False)
class Custom:
    """Controllers of a class in Python, for laws that no family here has.

    An object of the class is one controller. The search makes one for each simulated flight and calls it for every
    command, one at a time and on the calling thread, for any number of threads of the campaign. This is slow: a
    flight of 100 periods takes about 0.2 ms, on a twin of one state some two hundred times as long as with a law of
    the engine, and a campaign with its default options simulates about forty thousand flights for each test; where that
    takes too long choose fewer `evaluations`, `draws` and `candidates`. Commands are clipped to their bounds. A
    campaign with such controllers has no record.

    Args:
        law: makes a controller from all its gains by name: a class with `reset()` and `command(state, target)`. The
            commands must depend only on the gains and on the calls since `reset()`.
        gains: bounds (low, high) by name; a third item "log" where decades matter; a number instead of bounds fixes a
            gain.
        units: of the gains, by name; without one "".

    Raises:
        InvalidInput: a law that cannot be called with these gains by name, no gains, or bounds in the wrong order.
    """

    law: Callable[..., Law]
    gains: Mapping[str, GainBounds]
    units: Mapping[str, str] | None = None

    def __post_init__(self) -> None:
        if not callable(self.law):
            raise InvalidInput(
                f"Custom, law: expected a class of controllers, found {self.law!r}; pass the class, not one of its"
                " objects."
            )
        names = list(self.gains) if isinstance(self.gains, Mapping) else []
        for name in names:
            if not isinstance(name, str) or not name.isidentifier():
                raise InvalidInput(
                    f"Custom, gains: expected names that can be arguments, found {name!r}; rename it."
                )
        object.__setattr__(self, "gains", bounds_by_name("Custom", self.gains, names))
        self._check_constructor(names)
        units = {} if self.units is None else self.units
        if not isinstance(units, Mapping) or not all(name in names for name in units):
            raise InvalidInput(
                f"Custom, units: expected a dict of units by the names of gains, found {units!r}; correct it."
            )
        object.__setattr__(self, "units", dict(units))

    def _check_constructor(self, names: list[str]) -> None:
        """Refuses a law that cannot be made with these gains, before its own errors can be taken for that."""
        try:
            signature = inspect.signature(self.law)
        except (TypeError, ValueError):  # what is not written in Python may have none
            return
        try:
            signature.bind(**dict.fromkeys(names, 0.0))
        except TypeError as reason:
            raise InvalidInput(
                f"Custom, law: expected one that is made with the gains {', '.join(names)} by name, found"
                f" {getattr(self.law, '__name__', self.law)}{signature}: {reason}; give its constructor these names,"
                " or correct the names of the gains."
            ) from reason

    def bind(self, signals: Signals) -> Family:
        """The family over these signals; gains in the order of their names.

        Args:
            signals: states and commands of the controllers.

        Returns:
            The family.

        Raises:
            InvalidInput: no gain with bounds, or a law whose objects lack `reset` or `command`.
        """
        assert self.units is not None  # __post_init__ has set it
        names, law = list(self.gains), self.law
        gains = [gain_of(name, self.units.get(name, ""), self.gains[name]) for name in names]

        def made(values: list[float]) -> Law:
            controller = law(**dict(zip(names, values, strict=True)))
            for method in ("reset", "command"):
                if not callable(getattr(controller, method, None)):
                    raise InvalidInput(
                        f"Custom, law: expected controllers with reset() and command(state, target), found"
                        f" {type(controller).__name__} without {method}; add it."
                    )
            return controller

        made([bounds[0] if isinstance(bounds, tuple) else bounds for bounds in self.gains.values()])
        engine = _core.Family.python(signals.engine, made, [gain.engine for gain in gains])
        return Family(signals, gains, engine)
