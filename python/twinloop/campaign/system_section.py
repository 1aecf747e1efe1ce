"""The section [system] of a campaign file: what flies by itself, where no person does."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twinloop._ground.arrays import number
from twinloop.errors import InvalidInput, unknown

KEYS = ("use", "timeout", "arguments")


@dataclasses.dataclass(frozen=True)
class SystemSection:
    """What the section says.

    Args:
        use: its name, or "module:object".
        timeout: seconds that a run may take; None: as long as it wants.
        arguments: that it is made with.
    """

    use: str
    timeout: float | None
    arguments: Mapping[str, Any]


def system_section(found: object) -> SystemSection | None:
    """Reads the section; None where there is none.

    Args:
        found: what TOML gives.

    Raises:
        InvalidInput: an unknown key, or a value that cannot be used.
    """
    if found is None:
        return None
    arguments = found.get("arguments", {}) if isinstance(found, Mapping) else None
    if not isinstance(found, Mapping) or not isinstance(arguments, Mapping):
        raise InvalidInput(
            "Campaign file, system: expected a section, found something else; write [system] and [system.arguments]."
        )
    for key in found:
        if key not in KEYS:
            raise unknown("key in [system]", key, KEYS)
    if "use" not in found:
        raise InvalidInput("Campaign file, [system]: expected use, found none; add it.")
    timeout = found.get("timeout")
    seconds = None if timeout is None else number("Campaign file, [system], timeout (s)", timeout, above=0.0)
    return SystemSection(found["use"], seconds, dict(arguments))


def said_by(system: object, names: tuple[str, ...], path: Path) -> dict[str, Any]:
    """What a system says of itself, where the file does not.

    Args:
        system: that was made.
        names: of its attributes.
        path: of the file.

    Raises:
        InvalidInput: it does not say it.
    """
    missing = [name for name in names if not hasattr(system, name)]
    if missing:
        wanted = {"controller": "controller", "default_gains": "first"}.get(names[0], "task")
        raise InvalidInput(
            f"Campaign file, {path}: expected [{wanted}], found none, and no {', '.join(missing)} of the system; add"
            " the section."
        )
    return {name: getattr(system, name) for name in names}
