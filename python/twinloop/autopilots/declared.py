"""What a user declares of an autopilot in a campaign file: its kind, and what it calls each gain; its sweep."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from twinloop.autopilots.files import EVERY_NODE, Autopilot
from twinloop.autopilots.parameters import Parameter
from twinloop.autopilots.sweep import Sweep
from twinloop.errors import InvalidInput, unknown

KEYS = ("kind", "node", "parameters", "sweep")


@dataclass(frozen=True)
class Declared:
    """An autopilot as it was declared, of which the kind may be chosen later.

    Args:
        kind: of its files; None: to be chosen.
        parameters: of each gain by its name; None for a gain that it has not got.
        node: of ROS 2.
        sweep: that excites a test, where it makes chirps by itself.
    """

    kind: str | None
    parameters: Mapping[str, Parameter | None]
    node: str = EVERY_NODE
    sweep: Sweep | None = None

    def autopilot(self, kind: str) -> Autopilot:
        """The autopilot.

        Args:
            kind: of its files.

        Raises:
            InvalidInput: another kind, or names that it cannot have.
        """
        return Autopilot(kind, self.parameters, self.node)


def declared(table: object, where: str) -> Declared:
    """Reads a section [autopilot].

    Args:
        table: as TOML gives it.
        where: it stands, for an error.

    Raises:
        InvalidInput: an unknown key, or a value that cannot be used.
    """
    found = _table(table, f"{where}, [autopilot]", KEYS)
    parameters = {
        gain: None if value is False else _parameter(value, f"{where}, [autopilot.parameters] {gain!r}")
        for gain, value in _table(found.get("parameters", {}), f"{where}, [autopilot.parameters]").items()
    }
    kind, node = found.get("kind"), found.get("node", EVERY_NODE)
    if not (kind is None or isinstance(kind, str)) or not isinstance(node, str):
        raise InvalidInput(
            f"{where}, [autopilot]: expected kind and node as texts, found {kind!r} and {node!r}."
        )
    sweep = None
    if "sweep" in found:
        place = f"{where}, [autopilot.sweep]"
        names = [field.name for field in dataclasses.fields(Sweep)]
        table = _table(found["sweep"], place, names)
        missing = [name for name in names[:6] if name not in table]
        if missing:
            raise InvalidInput(f"{place}: expected {', '.join(missing)}, found none; add them.")
        sweep = Sweep(**table)
    return Declared(kind, parameters, node, sweep)


def _parameter(value: object, where: str) -> Parameter:
    if isinstance(value, str):
        return Parameter(value)
    fields = [field.name for field in dataclasses.fields(Parameter)]
    table = _table(value, where, fields)
    if "name" not in table:
        raise InvalidInput(
            f'{where}: expected a name, found none; write {{ name = "…" }}, or false for none.'
        )
    return Parameter(**table)


def _table(value: object, where: str, keys: tuple[str, ...] | list[str] | None = None) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InvalidInput(f"{where}: expected a section, found {value!r}; write one.")
    for key in value:
        if keys is not None and key not in keys:
            raise unknown(f"key in {where}", key, keys)
    return dict(value)
