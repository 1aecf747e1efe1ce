"""Parameter files of autopilots: PX4, ArduPilot, Betaflight, ROS 2, and plain JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from twinloop._ground.texts import one_line
from twinloop.autopilots.parameters import Parameter, Value, translated
from twinloop.errors import InvalidInput, unknown

Set = dict[str, tuple[Value, bool]]
"""Values by the names of parameters, with whether each is a whole number."""
REAL_32, INT_32 = 9, 6
"""Types of parameters in MAVLink."""
EVERY_NODE = "/**"
NODE = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
NO_NAMES = re.compile(r"y|n|yes|no|on|off|true|false|null", re.IGNORECASE)
"""Words that YAML reads as a truth value or as nothing where they are not quoted."""


@dataclass(frozen=True)
class Format:
    """How one kind of file is written.

    Args:
        suffix: of the file.
        names: what its parameters may be called.
        single: whether it holds numbers in single precision.
        written: its lines after the heading, of the values and the node.
        comment: what a line of the heading begins with; empty: it has none.
        whole: whether it holds whole numbers alone.
    """

    suffix: str
    names: re.Pattern[str]
    single: bool
    written: Callable[[Set, str], str]
    comment: str = "# "
    whole: bool = False


def _px4(values: Set, node: str) -> str:
    head = "# Vehicle-Id Component-Id Name Value Type\n"
    rows = (
        f"1\t1\t{name}\t{_short(value)}\t{INT_32 if whole else REAL_32}\n"
        for name, (value, whole) in values.items()
    )
    return head + "".join(rows)


def _px4_shell(values: Set, node: str) -> str:
    return (
        "".join(f"param set {name} {_short(value)}\n" for name, (value, _) in values.items()) + "param save\n"
    )


def _ardupilot(values: Set, node: str) -> str:
    return "".join(f"{name},{_short(value)}\n" for name, (value, _) in values.items())


def _betaflight(values: Set, node: str) -> str:
    return "".join(f"set {name} = {_short(value)}\n" for name, (value, _) in values.items()) + "save\n"


def _ros2(values: Set, node: str) -> str:
    rows = (
        f"    {_key(name)}: {value if whole else _yaml(value)}\n" for name, (value, whole) in values.items()
    )
    return f"{_key(node)}:\n  ros__parameters:\n{''.join(rows)}"


def _json(values: Set, node: str) -> str:
    named = {name: value for name, (value, _) in values.items()}
    return json.dumps({"parameters": named}, indent=2, allow_nan=False) + "\n"


MAVLINK = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
FORMATS = {
    "px4": Format(".params", MAVLINK, True, _px4),
    "px4-shell": Format(".txt", MAVLINK, True, _px4_shell),
    "ardupilot": Format(".param", MAVLINK, True, _ardupilot),
    "betaflight": Format(".txt", re.compile(r"[a-z][a-z0-9_]{0,63}"), True, _betaflight, whole=True),
    "ros2": Format(".yaml", re.compile(r"[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*"), False, _ros2),
    "json": Format(".json", re.compile(r"[^\x00-\x1f\x7f]{1,200}"), False, _json, ""),
}
"""What files are written for."""


@dataclass(frozen=True)
class Autopilot:
    """An autopilot: its parameters for the gains of a controller, and its file format.

    Args:
        kind: "px4", "px4-shell", "ardupilot", "betaflight", "ros2" or "json".
        parameters: of each gain by its name; None for a gain of 0 that the autopilot does not have.
        node: of ROS 2.

    Raises:
        InvalidInput: another kind, a name that the kind cannot have, or one name for two gains.
    """

    kind: str
    parameters: Mapping[str, Parameter | None]
    node: str = EVERY_NODE

    def __post_init__(self) -> None:
        if self.kind not in FORMATS:
            raise unknown("autopilot", self.kind, FORMATS)
        if self.node != EVERY_NODE and (not isinstance(self.node, str) or NODE.fullmatch(self.node) is None):
            raise InvalidInput(
                f"Autopilot, node: expected a name such as '/controller', found {self.node!r}."
            )
        names = [each.name for each in self.parameters.values() if each is not None]
        for name in names:
            if FORMATS[self.kind].names.fullmatch(name) is None:
                raise InvalidInput(
                    f"Autopilot {self.kind}: expected the name of a parameter, found {name!r}, which it cannot have;"
                    " correct it."
                )
            if names.count(name) > 1:
                raise InvalidInput(
                    f"Autopilot {self.kind}: expected one gain for each parameter, found {name!r} twice; correct it."
                )

    @property
    def suffix(self) -> str:
        """Suffix of its files."""
        return FORMATS[self.kind].suffix

    def values(self, gains: Mapping[str, float]) -> dict[str, Value]:
        """Parameters by name, as in the file.

        Args:
            gains: all of a controller, by name, in their units.

        Raises:
            InvalidInput: a gain without a parameter, one that is not finite, or a value beyond its limits, or that the
                autopilot would cut off.
        """
        return {name: value for name, (value, _) in self._held(gains).items()}

    def text(self, gains: Mapping[str, float], heading: str) -> str:
        """A parameter file.

        Args:
            gains: all of a controller, by name, in their units.
            heading: a comment of one line.

        Raises:
            InvalidInput: as for `values`.
        """
        form = FORMATS[self.kind]
        first = f"{form.comment}{one_line(heading)}\n" if form.comment else ""
        return first + form.written(self._held(gains), self.node)

    def _held(self, gains: Mapping[str, float]) -> Set:
        values = translated(self.parameters, gains)
        if not FORMATS[self.kind].single:
            return values
        held: Set = {}
        for name, (value, whole) in values.items():
            if FORMATS[self.kind].whole and value != int(value):
                raise InvalidInput(
                    f"Parameter {name!r}: expected a whole number, for {self.kind} cuts off what follows the point,"
                    f" found {value:g}; say whole = true, and it is rounded, and correct its scale if gains are small."
                )
            if not abs(value) <= (2**31 - 1 if whole else float(np.finfo(np.float32).max)):
                raise InvalidInput(
                    f"Parameter {name!r}: expected a number of 32 bits, found {value:g}; correct its scale."
                )
            held[name] = (value if whole else float(np.float32(value))), whole
        return held


def _short(value: Value) -> str:
    """The shortest text that single precision reads back."""
    return str(value) if isinstance(value, int) else np.format_float_positional(np.float32(value), trim="0")


def _key(name: str) -> str:
    """A name that YAML reads as one."""
    return f'"{name}"' if NO_NAMES.fullmatch(name) else name


def _yaml(value: Value) -> str:
    """A number that YAML reads as one that is not whole: with a point."""
    return np.format_float_positional(float(value), trim="0")
