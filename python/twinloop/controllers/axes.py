"""What a PID and a cascade share: axes over named states, an output map, anti-windup and the filter of rates."""

from __future__ import annotations

from collections.abc import Iterable

from twinloop._ground.arrays import number
from twinloop.controllers.mixer import Mixer
from twinloop.errors import InvalidInput, unknown
from twinloop.signals import Signals

Axis = tuple[str, str | None]
TERMS = ("kp", "ki", "kd")
"""Of a PID, in the order of its gains."""


def checked_axes(family: str, axes: object, second: str) -> tuple[Axis, ...]:
    """Pairs of names of states, each first name once; None may stand for a second.

    Args:
        family: how to call it in an error.
        axes: the pairs.
        second: what the second of a pair is.

    Raises:
        InvalidInput: no pairs, none at all, or an angle twice.
    """
    listed = tuple(axes) if isinstance(axes, Iterable) and not isinstance(axes, str) else (axes,)
    pairs: list[Axis] = []
    for axis in listed:
        match tuple(axis) if isinstance(axis, Iterable) and not isinstance(axis, str) else ():
            case (str() as angle, str() | None as rate):
                pairs.append((angle, rate))
            case _:
                raise InvalidInput(
                    f"{family}, axes: expected pairs (angle, {second}) of names, found {axis!r}; write both."
                )
    angles = [angle for angle, _ in pairs]
    if not angles or len(set(angles)) != len(angles):
        raise InvalidInput(
            f"{family}, axes: expected at least one axis and each angle once, found {angles}; correct them."
        )
    return tuple(pairs)


def place(family: str, name: str, signals: Signals) -> int:
    """Place of a state of an axis.

    Args:
        family: how to call it in an error.
        name: of the state.
        signals: where it is found.

    Raises:
        InvalidInput: no such state.
    """
    if name not in signals.state_names:
        raise unknown(f"state in the axes of a {family}", name, signals.state_names)
    return signals.state_names.index(name)


def asked_units(family: str, output: Mixer | None, axes: int, signals: Signals) -> list[str]:
    """The unit of what each axis asks for: that of the map, or of the command that it is.

    Args:
        family: how to call it in an error.
        output: from the axes to the commands.
        axes: how many there are.
        signals: with the commands.

    Raises:
        InvalidInput: another number of axes than of commands, or a map of another shape.
    """
    if output is not None:
        output.check(signals.n_u, axes)
        return [output.unit] * axes
    if axes != signals.n_u:
        raise InvalidInput(
            f"{family}: expected one axis for each of the {signals.n_u} commands, found {axes}; "
            "add axes, or an output=Mixer(...)."
        )
    return [command.unit for command in signals.commands]


def check_anti_windup(family: str, anti_windup: object) -> None:
    """Refuses a way of stopping integrals that there is not.

    Args:
        family: how to call it in an error.
        anti_windup: what was given.

    Raises:
        InvalidInput: neither None nor "clamping".
    """
    if anti_windup not in (None, "clamping"):
        raise InvalidInput(
            f'{family}, anti_windup: expected "clamping" or None, found {anti_windup!r}; choose one of them.'
        )


def filter_time(family: str, time: object) -> float:
    """The time constant of a derivative filter.

    Args:
        family: how to call it in an error.
        time: what was given, s; 0: no filter.

    Raises:
        InvalidInput: no finite number of at least 0.
    """
    seconds = number(f"{family}, derivative_filter (s)", time)
    if seconds < 0.0:
        raise InvalidInput(
            f"{family}, derivative_filter: expected a time of at least 0 s, found {seconds:g}; change its sign."
        )
    return seconds
