"""An FMU: a twin's C, what it says of itself, and its binary for this machine, in one archive."""

from __future__ import annotations

import io
import platform
import sys
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from uuid import NAMESPACE_URL, uuid5

import numpy as np

from twinloop._core import __version__
from twinloop._ground.arrays import Floats
from twinloop.errors import NotAvailable
from twinloop.law.exports.c_source import c_source
from twinloop.law.exports.compiling import compiled
from twinloop.law.exports.fmu.description import (
    build_description,
    late_states,
    model_description,
    source_files,
    variables,
)
from twinloop.law.law import Law

FIRST_DAY = (1980, 1, 1, 0, 0, 0)
"""Of the archive's format: the same twin gives the same bytes on any day."""
BINARIES = {
    ("linux", "x86_64"): ("linux64", "x86_64-linux", ".so"),
    ("linux", "aarch64"): ("", "aarch64-linux", ".so"),
    ("darwin", "x86_64"): ("darwin64", "x86_64-darwin", ".dylib"),
    ("darwin", "arm64"): ("", "aarch64-darwin", ".dylib"),
}
"""Folders of FMI 2.0 and 3.0 and the suffix of libraries, by system and processor; FMI 2.0 knows few."""


@dataclass(frozen=True)
class Unit:
    """An FMU without its binary.

    Args:
        version: of FMI, 2 or 3.
        name: the model's identifier.
        token: by which the binary knows the model description.
        files: by their paths in the archive.
    """

    version: int
    name: str
    token: str
    files: Mapping[str, bytes]


def unit_of(version: int, law: Law, name: str, start: Floats, said: str = "") -> Unit:
    """All of an FMU but its binary.

    Args:
        version: of FMI, 2 or 3.
        law: of the twin.
        name: a name that functions in C may begin with.
        start: state where it begins unless another is set (n_x,).
        said: against it, in a sentence.
    """
    low, high = np.array([command.bounds for command in law.signals.commands]).T
    rest = np.clip(np.zeros(law.signals.n_u), low, high)
    header, source = c_source(law, name)
    listed = variables(law, start, rest)
    functions = source_files(version, name)[0]
    room = files("twinloop.law.exports.fmu")
    texts = {
        f"{name}.h": header,
        f"{name}.c": source,
        "fmi-instance.h": room.joinpath("fmi-instance.h").read_text("utf-8"),
        functions: room.joinpath(functions).read_text("utf-8"),
    }
    content = "\n".join([*texts.values(), repr([(each.name, each.attributes) for each in listed])])
    token = f"{{{uuid5(NAMESPACE_URL, content)}}}"
    texts["fmi-twin.h"] = _header(law, name, token, start, rest)
    found = {"modelDescription.xml": model_description(version, law, name, token, listed, said)}
    found |= {f"sources/{file}": text.encode() for file, text in texts.items()}
    if version == 3:
        found["sources/buildDescription.xml"] = build_description(name)
    return Unit(version, name, token, found)


def built(unit: Unit, folder: Path) -> tuple[Path, str]:
    """Compiles an FMU for this machine.

    Args:
        unit: without its binary.
        folder: to compile in.

    Returns:
        The library, and its path in the FMU; empty where the version has no place for it.

    Raises:
        NotAvailable: no C compiler, a machine that FMI does not know, or a compiler that refuses.
    """
    machine = BINARIES.get((sys.platform, platform.machine()))
    sources_alone = "pass --force (force=True in Python) for an FMU of sources alone"
    if machine is None:
        raise NotAvailable(
            "Export, FMU: expected Linux or macOS to build the binary, found"
            f" {sys.platform} on {platform.machine()}; change that, or {sources_alone}."
        )
    for path, content in unit.files.items():
        if path.startswith("sources/"):
            (folder / path.removeprefix("sources/")).write_bytes(content)
    library = compiled(
        "FMU",
        folder,
        source_files(unit.version, unit.name),
        f"{unit.name}{machine[2]}",
        ["-fvisibility=hidden"],
        sources_alone,
    )
    place = machine[unit.version - 2]
    return library, f"binaries/{place}/{library.name}" if place else ""


def archived(found: Mapping[str, bytes]) -> bytes:
    """Files as an archive, the same bytes whenever it is made.

    Args:
        found: by their paths.
    """
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in found.items():
            entry = zipfile.ZipInfo(path, FIRST_DAY)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o755 if path.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, content)
    return whole.getvalue()


def _header(law: Law, name: str, token: str, start: Floats, rest: Floats) -> str:
    """What the functions of FMI need to know of a twin."""
    big = name.upper()
    lists = {key: ", ".join(map(repr, values.tolist())) for key, values in (("x", start), ("u", rest))}
    late = late_states(law)
    sensors = [
        f"#define LATE_PLACES {{{', '.join(map(str, late))}}}",
        f"#define twin_sensors {name}_sensors", f"#define twin_begin {name}_begin", f"#define twin_read {name}_read",
    ] if late else []  # fmt: skip
    return "\n".join([
        f"/* Written by Twinloop {__version__}: what is behind the interface of FMI. */",
        "#ifndef FMI_TWIN_H", "#define FMI_TWIN_H", "", f'#include "{name}.h"', "",
        f'#define TOKEN "{token}"',
        f"#define STATES {big}_STATES", f"#define COMMANDS {big}_COMMANDS",
        f"#define HIDDEN {len(law.actuation.hidden)}",
        f"#define LATE {len(late)}", *sensors,
        f"#define PERIOD {big}_DT",
        f"#define STARTS {{{lists['x']}}}", f"#define RESTS {{{lists['u']}}}", "",
        f"typedef {name}_memory twin_memory;", "",
        f"#define twin_reset {name}_reset", f"#define twin_clip {name}_clip", f"#define twin_step {name}_step",
        "", "#endif", "",
    ])  # fmt: skip
