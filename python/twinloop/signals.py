"""What a system's states and commands are called, measured in and bounded by."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import InitVar, dataclass
from functools import cached_property
from keyword import iskeyword
from unicodedata import normalize

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._ground.arrays import Floats, number, whole
from twinloop._ground.texts import text
from twinloop._ground.values import Value
from twinloop.errors import InvalidInput, unknown
from twinloop.records import Recorded

Bounds = tuple[float, float]
DEGREES = ("deg", "°", "degree", "degrees")
"""Units of angles of which a turn is 360."""
TURNS = {"rad": 2.0 * math.pi, **dict.fromkeys(DEGREES, 360.0)}
"""A whole turn in the units of angles."""
WHOLE_TURN = 0.99
"""Share of its period that the envelope of an angle spans if it bounds nothing: -3.14 to 3.14 is a whole turn."""
QUICK = 10.0
"""Periods in which a state goes through its scale, at the scale of a rate that is made of past readings."""


@dataclass(frozen=True)
class State(Recorded, kind="state"):
    """One component of the state.

    Args:
        name: a Python identifier; it appears in equations and tables.
        unit: SI, radians for angles.
        scale: its usual size, in its unit; a run that leaves ten times this has diverged.
        derivative_of: name of the state whose time derivative this state is, if there is one.
        envelope: smallest and largest safe value, in its unit. Of an angle that wraps, one that spans the whole
            period bounds nothing and is None.
        noise: standard deviation of its sensor, in its unit, if it is known; the preset `default` starts its own
            estimate there, and a remark says if the two differ much.
        periodic: whether it is an angle that wraps: True for an angle in rad, or its period in its unit, such as
            360.0. Errors and differences then take the short way, and a model sees it within half a period of 0.
        measured: False of a rate that no sensor reads: records may leave it out. Where they do, it is what the readings
            of `derivative_of` change by over a period, and so it is for a controller.

    Raises:
        InvalidInput: a name, unit, scale, envelope, noise or period that cannot be used, or one that is not measured
            and the derivative of nothing.
    """

    name: str
    unit: str
    scale: float
    derivative_of: str | None = None
    envelope: Bounds | None = None
    noise: float | None = None
    periodic: bool | float = False
    measured: bool = True

    VERSION = 2

    def __post_init__(self) -> None:
        _check_words("State", self.name, self.unit)
        if self.derivative_of is not None:
            text(f"State {self.name!r}, derivative_of", self.derivative_of)
        if not isinstance(self.measured, bool):
            raise InvalidInput(
                f"State {self.name!r}, measured: expected True or False, found {self.measured!r}."
            )
        if not self.measured and self.derivative_of is None:
            raise InvalidInput(
                f"State {self.name!r}: expected derivative_of of a state that is not measured, found none; name the"
                " state whose readings it is made of, or leave this one out: what is hidden is looked for."
            )
        object.__setattr__(self, "scale", number(f"State {self.name!r}, scale", self.scale, above=0.0))
        if self.envelope is not None:
            object.__setattr__(self, "envelope", ordered(f"State {self.name!r}, envelope", self.envelope))
        if self.noise is not None:
            object.__setattr__(self, "noise", number(f"State {self.name!r}, noise", self.noise, above=0.0))
        if self.periodic is True and self.unit != "rad":
            raise InvalidInput(
                f"State {self.name!r}, periodic: expected the period in {self.unit!r}, found True, which stands for"
                " 2 pi rad; give the number, such as 360.0 for degrees."
            )
        if not isinstance(self.periodic, bool):
            period = number(f"State {self.name!r}, periodic", self.periodic, above=0.0)
            object.__setattr__(self, "periodic", period)
        if self._turns_freely:
            object.__setattr__(self, "envelope", None)

    @property
    def _turns_freely(self) -> bool:
        """Whether the envelope spans the period, up to how people round it, so that a full turn stays inside."""
        if self.envelope is None or self.period is None:
            return False
        low, high = self.envelope
        return high - low >= WHOLE_TURN * self.period

    @property
    def period(self) -> float | None:
        """Period of an angle that wraps, in its unit; None otherwise."""
        return (
            (2.0 * math.pi if self.periodic else None) if isinstance(self.periodic, bool) else self.periodic
        )


@dataclass(frozen=True)
class Command(Recorded, kind="command"):
    """One component of the command.

    Args:
        name: a Python identifier; it appears in equations and tables.
        unit: SI. Commands with the same unit and bounds count as alike, such as rotors: they share an actuator's lag
            and delay. Give commands that are not alike different units, "pump" and "heater" instead of "1" and "1".
        bounds: smallest and largest value that is ever sent, in its unit.
        scale: value that is 1 for a model, in its unit; by default the larger magnitude of the two bounds.

    Raises:
        InvalidInput: a name, unit, bounds or scale that cannot be used.
    """

    name: str
    unit: str
    bounds: Bounds
    scale: float | None = None

    def __post_init__(self) -> None:
        _check_words("Command", self.name, self.unit)
        low, high = ordered(f"Command {self.name!r}, bounds", self.bounds)
        scale = max(abs(low), abs(high)) if self.scale is None else self.scale
        object.__setattr__(self, "bounds", (low, high))
        object.__setattr__(self, "scale", number(f"Command {self.name!r}, scale", scale, above=0.0))

    @property
    def size(self) -> float:
        """The value that is 1 for a model, in the command's unit."""
        assert self.scale is not None  # __post_init__ has set it
        return self.scale


@dataclass(frozen=True)
class RigidBody(Recorded, kind="rigid_body"):
    """A prior: the three body rates of a rigid body turn its three angles.

    Args:
        angles: names of roll, pitch and yaw, in rad, turned about z, then y, then x.
        rates: names of the body rates about x, y and z, in rad/s.

    Raises:
        InvalidInput: not three names each, or one of them twice.
    """

    angles: Sequence[str]
    rates: Sequence[str]

    def __post_init__(self) -> None:
        for which in ("angles", "rates"):
            names = tuple(text(f"RigidBody, {which}", name) for name in getattr(self, which))
            object.__setattr__(self, which, names)
        if len(self.angles) != 3 or len(self.rates) != 3 or len({*self.angles, *self.rates}) != 6:
            raise InvalidInput(
                f"RigidBody: expected three angles and three rates that differ, found {self.angles} and"
                f" {self.rates}; name six states."
            )


@dataclass(frozen=True)
class Signals(Value, Recorded, kind="signals"):
    """The states and commands of a system, and the period at which commands are sent.

    Args:
        states: n_x of them, in the order of a state vector.
        commands: n_u of them, in the order of a command vector.
        dt: period, s; a command is held for one period.
        kinematics: which states are angles and body rates of a rigid body, if there are any.
        lags: past readings of which the rest of the state may be made, where only outputs are measured. From 1 on, each
            state that has no derivative and is none gets its rate, as `angle_rate` of `angle`, a state that is not
            measured. More than one adds nothing: rates of rates are noise, and what else is hidden the preset `default`
            looks for.

    Raises:
        InvalidInput: no states or no commands, a name used twice, a `derivative_of` or `kinematics` that do not fit,
            a rigid body in other units than rad and rad/s, lags that are no whole number, or no state whose rate they
            could give.
    """

    states: Sequence[State]
    commands: Sequence[Command]
    dt: float
    kinematics: RigidBody | None = None
    lags: InitVar[int] = 0

    def __post_init__(self, lags: int) -> None:
        object.__setattr__(self, "states", _members("states", State, self.states))
        object.__setattr__(self, "commands", _members("commands", Command, self.commands))
        object.__setattr__(self, "dt", number("Signals, dt (s)", self.dt, above=0.0))
        self._check_names()
        self._check_derivatives()
        if self.kinematics is not None:
            if not isinstance(self.kinematics, RigidBody):
                raise InvalidInput(
                    f"Signals, kinematics: expected a twinloop.RigidBody or None, found {self.kinematics!r}."
                )
            for name in (*self.kinematics.angles, *self.kinematics.rates):
                if name not in self.state_names:
                    raise unknown("state in the kinematics", name, self.state_names)
            self._check_turned(self.kinematics)
            self._check_radians(self.kinematics)
        if whole("Signals, lags", lags):
            self._append_rates()
            self._check_names()

    def _check_names(self) -> None:
        # As Python reads them, for which a ligature is its letters.
        names = [normalize("NFKC", name) for name in self.state_names + self.command_names]
        for name in names:
            if names.count(name) > 1:
                raise InvalidInput(
                    f"Signals: expected names that differ, found {name!r} twice; rename one of them."
                )

    def _append_rates(self) -> None:
        """Appends rates, not measured, of the states that lack one."""
        rates = [
            State(
                f"{state.name}_rate",
                _a_second(state.unit),
                state.scale / (QUICK * self.dt),
                derivative_of=state.name,
                measured=False,
            )
            for state in (self.states[i] for i in self.without_rates)
        ]
        if not rates:
            raise InvalidInput(
                "Signals, lags: expected a state whose rate is not declared, found none; leave lags out, or leave out"
                " the rates that no sensor reads."
            )
        object.__setattr__(self, "states", (*self.states, *rates))

    def _check_turned(self, body: RigidBody) -> None:
        """Refuses angles of a body that have a derivative besides: body rates already say how they turn."""
        declared = [state for state in self.states if state.derivative_of in body.angles]
        if declared:
            found = ", ".join(f"{state.name!r} of {state.derivative_of!r}" for state in declared)
            raise InvalidInput(
                f"Signals: expected angles that the kinematics alone turn, found derivatives too: {found}; remove"
                f" `derivative_of` from {', '.join(repr(state.name) for state in declared)}, because body rates are not"
                " the derivatives of the angles."
            )

    def _check_radians(self, body: RigidBody) -> None:
        """Refuses a body in other units: how rates turn angles is known in radians alone, by their sines."""
        units = {state.name: state.unit for state in self.states}
        wanted = {**dict.fromkeys(body.angles, "rad"), **dict.fromkeys(body.rates, "rad/s")}
        found = ", ".join(f"{name} in {units[name]}" for name in wanted if units[name] != wanted[name])
        if found:
            raise InvalidInput(
                f"Signals, kinematics: expected {', '.join(body.angles)} in rad and {', '.join(body.rates)} in rad/s,"
                f" found {found}; declare them so, with scales, envelopes and noise in these units, and convert the"
                " columns of the log."
            )

    def _check_derivatives(self) -> None:
        parents = {state.name: state.derivative_of for state in self.states}
        integrals = [of for of in parents.values() if of is not None]
        made = {state.name: state.measured for state in self.states}
        for name, of in parents.items():
            if of is None:
                continue
            if of not in parents:
                raise unknown(
                    f"state that {name!r} is the derivative of,", of, [*filter(name.__ne__, parents)]
                )
            if integrals.count(of) > 1:
                raise InvalidInput(
                    f"Signals: expected at most one derivative of {of!r}, found several; "
                    "keep `derivative_of` on one of them."
                )
            self._check_unit(name, of)
            if not made[name] and not made[of]:
                raise InvalidInput(
                    f"Signals: expected {of!r} to be measured, of whose readings {name!r} is made, found that it is"
                    f" not; leave {name!r} out: what else is hidden is looked for."
                )
            seen, up = {name}, of
            while up is not None:
                if up in seen:
                    raise InvalidInput(
                        f"Signals: expected derivatives that end at a state, found that {name!r} is in the"
                        " end the derivative of itself; remove one `derivative_of`."
                    )
                seen.add(up)
                up = parents[up]  # type: ignore[assignment]

    def _check_unit(self, rate: str, angle: str) -> None:
        """Refuses a rate in one unit of angles that is the derivative of an angle in the other."""
        units = {state.name: state.unit for state in self.states}
        for one, other in (pair for each in DEGREES for pair in ((each, "rad"), ("rad", each))):
            if units[angle] == one and units[rate].startswith(f"{other}/s"):
                raise InvalidInput(
                    f"Signals: expected {rate!r} in {one}/s, the derivative of {angle!r} in {one}, found it in"
                    f" {units[rate]}; declare both in the unit that the log has, or convert one of them."
                )

    @property
    def n_x(self) -> int:
        """Number of states."""
        return len(self.states)

    @property
    def n_u(self) -> int:
        """Number of commands."""
        return len(self.commands)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states, in order."""
        return tuple(state.name for state in self.states)

    @property
    def command_names(self) -> tuple[str, ...]:
        """Names of the commands, in order."""
        return tuple(command.name for command in self.commands)

    @cached_property
    def driven(self) -> tuple[int, ...]:
        """States whose motion is learnt: all except integrals of other states and angles of a rigid body."""
        given = {state.derivative_of for state in self.states}
        if self.kinematics is not None:
            given |= set(self.kinematics.angles)
        return tuple(i for i, name in enumerate(self.state_names) if name not in given)

    @property
    def without_rates(self) -> tuple[int, ...]:
        """States that are no rates, and of which none is declared."""
        body = self.kinematics
        turned = () if body is None else (*body.angles, *body.rates)
        known = {*turned, *(state.derivative_of for state in self.states)}
        return tuple(
            i
            for i, state in enumerate(self.states)
            if state.derivative_of is None and state.name not in known
        )

    @cached_property
    def unmeasured(self) -> tuple[int, ...]:
        """States that no sensor reads, in order."""
        return tuple(i for i, state in enumerate(self.states) if not state.measured)

    @cached_property
    def measured(self) -> tuple[int, ...]:
        """States that sensors read, in order."""
        return tuple(i for i, state in enumerate(self.states) if state.measured)

    @cached_property
    def periods(self) -> tuple[tuple[int, float], ...]:
        """Places and periods of the states that wrap."""
        return tuple((i, state.period) for i, state in enumerate(self.states) if state.period is not None)

    def difference(self, a: ArrayLike, b: ArrayLike) -> Floats:
        """The difference a − b; for a periodic state the short way, at most half a period in either direction.

        Args:
            a: states (…, n_x), in their units.
            b: the same.

        Returns:
            Differences (…, n_x), in their units.
        """
        difference = np.asarray(np.subtract(a, b), dtype=np.float64)
        for i, period in self.periods:
            difference[..., i] -= np.rint(difference[..., i] / period) * period
        return difference

    def wrapped(self, states: ArrayLike) -> Floats:
        """States as a model sees them, the periodic ones within half a period of 0.

        Args:
            states: (…, n_x), in their units; further columns stay as they are.

        Returns:
            A copy.
        """
        wrapped = np.array(states, dtype=np.float64)
        for i, period in self.periods:
            wrapped[..., i] -= np.rint(wrapped[..., i] / period) * period
        return wrapped

    def continued(self, states: Floats, start: Floats) -> Floats:
        """Rows of readings with continuous periodic states: from row to row they take the short way.

        Args:
            states: (rows, n_x), in their units.
            start: a state (n_x,) that the first row follows.

        Returns:
            The rows, periodic states shifted by whole periods.
        """
        if not self.periods:
            return states
        continued = states.copy()
        for i, period in self.periods:
            last = float(start[i])
            for k, reading in enumerate(states[:, i].tolist()):
                last = reading - float(np.rint((reading - last) / period)) * period
                continued[k, i] = last
        return continued

    @property
    def substeps(self) -> int:
        """Runge-Kutta steps per period of a rigid body, as the scales of its rates require."""
        return self.engine.substeps

    @cached_property
    def engine(self) -> _core.Signals:
        """The same signals as numbers, for the native engine."""
        index = {name: i for i, name in enumerate(self.state_names)}
        return _core.Signals(
            self.dt,
            [state.scale for state in self.states],
            [command.bounds for command in self.commands],
            [command.size for command in self.commands],
            [None if state.derivative_of is None else index[state.derivative_of] for state in self.states],
            None
            if self.kinematics is None
            else (
                tuple(index[name] for name in self.kinematics.angles),
                tuple(index[name] for name in self.kinematics.rates),
            ),
            periods=[state.period for state in self.states],
        )


def rates(signals: Signals) -> set[int]:
    """Places of the states that are declared derivatives or body rates.

    Args:
        signals: of the system.
    """
    body = () if signals.kinematics is None else signals.kinematics.rates
    return {
        i for i, state in enumerate(signals.states) if state.derivative_of is not None or state.name in body
    }


def ordered(what: str, bounds: object) -> Bounds:
    """Two finite numbers, the smaller first.

    Args:
        what: how to call them in an error.
        bounds: the pair.

    Returns:
        The pair as floats.

    Raises:
        InvalidInput: it is no pair of finite numbers, or not in order.
    """
    if isinstance(bounds, str) or not isinstance(bounds, Iterable):
        raise InvalidInput(f"{what}: expected a pair (low, high), found {bounds!r}; write both numbers.")
    pair = tuple(bounds)
    if len(pair) != 2:
        raise InvalidInput(f"{what}: expected a pair (low, high), found {pair!r}; write both numbers.")
    low, high = (number(what, value) for value in pair)
    if low >= high:
        raise InvalidInput(
            f"{what}: expected low < high, found {low:g} and {high:g}; exchange or widen them."
        )
    return low, high


def _check_words(kind: str, name: object, unit: object) -> None:
    if not isinstance(name, str) or not name.isidentifier() or iskeyword(name):
        raise InvalidInput(
            f"{kind}: expected a name of letters, digits and underscores, no word of Python's own, found {name!r}; "
            "it becomes a symbol in equations, so rename it."
        )
    text(f"{kind} {name!r}, unit", unit)


def _a_second(unit: str) -> str:
    """The unit of the rate of what has a unit."""
    return f"{unit.removesuffix('/s')}/s²" if unit.endswith("/s") else f"{unit}/s"


def _members(what: str, kind: type, values: object) -> tuple[object, ...]:
    members = tuple(values) if isinstance(values, Iterable) and not isinstance(values, str) else ()
    if not members or not all(isinstance(member, kind) for member in members):
        raise InvalidInput(
            f"Signals, {what}: expected a list of at least one twinloop.{kind.__name__}, found {values!r}; "
            "describe each one."
        )
    return members
