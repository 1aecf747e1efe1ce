"""One door to all exports: made, checked on the twin's flights, and written."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.writing import write_whole
from twinloop.controllers import Family, UnboundFamily
from twinloop.errors import InvalidInput, NotAvailable, unknown
from twinloop.law.exports.c_source import c_source
from twinloop.law.exports.casadi_source import casadi_source
from twinloop.law.exports.checks import check_controller, check_simulation, check_sympy
from twinloop.law.exports.control_source import control_source
from twinloop.law.exports.controller_source import controller_c, controller_python
from twinloop.law.exports.fmu.running import fmu_simulation
from twinloop.law.exports.fmu.unit import archived, built, unit_of
from twinloop.law.exports.gymnasium_source import Episode, gymnasium_source
from twinloop.law.exports.python_source import python_source
from twinloop.law.exports.simulations import (
    Simulation,
    c_controller,
    c_simulation,
    casadi_simulation,
    control_simulation,
    gymnasium_simulation,
    python_controller,
    python_simulation,
)
from twinloop.law.exports.symbolic import latex_source, sympy_source
from twinloop.law.law import Law
from twinloop.trajectory import Trajectory

SUFFIXES = {
    "python": ".py",
    "c": ".c",
    "fmu3": ".fmu",
    "fmu2": ".fmu",
    "latex": ".tex",
    "sympy": ".py",
    "casadi": ".py",
    "control": ".py",
    "gymnasium": ".py",
    "json": ".json",
}
"""Kinds of exports, with the suffix of their files."""
Contents = dict[str, str] | dict[str, bytes]
"""Of files, by their suffixes."""
OTHER_NAMES = {"fmu": "fmu3"}
"""What a kind is called, too."""
FMUS = {"fmu3": 3, "fmu2": 2}
"""Versions of FMI."""
UNFIT = frozenset("\"'<>\\")
"""What the name of a file may not have: C includes it between quotes."""
PRECISIONS = ("double", "float")
FORCED = "Exported by force: its checks, and a comparison on flights, were left out."
"""What a file says of itself that was: whoever is handed it cannot know."""
COMMENTS = {".py": "# {}\n", ".c": "/* {} */\n", ".h": "/* {} */\n", ".tex": "% {}\n"}
"""A line of its own in the files that are texts, by their suffixes; a twin as JSON has its remarks."""


@dataclass(frozen=True, eq=False)
class Source:
    """What is exported, and what it is checked with.

    Args:
        law: of the twin.
        simulate: the twin's own free run, cut where it diverges.
        flights: that it was learnt from.
        record: the twin as JSON.
        check: whether what is made is compared with the twin on its flights.
        episode: what an environment begins with.
    """

    law: Law
    simulate: Simulation
    flights: Sequence[Trajectory]
    record: str
    check: bool
    episode: Episode


MODULES: dict[str, tuple[str, Callable[[Source], str], Callable[[str], Simulation]]] = {
    "python": ("Python", lambda source: python_source(source.law), python_simulation),
    "casadi": ("CasADi", lambda source: casadi_source(source.law), casadi_simulation),
    "control": ("python-control", lambda source: control_source(source.law), control_simulation),
    "gymnasium": (
        "Gymnasium",
        lambda source: gymnasium_source(source.law, source.episode),
        gymnasium_simulation,
    ),
}
"""Kinds that are modules of Python: what they are called, how they are written, and how they are run."""


def asked(to: str | Path, kind: str | None) -> tuple[str, Path | None]:
    """The kind of an export, and the file that it goes to, if it does.

    Args:
        to: a kind, or a path with the suffix of one.
        kind: of the file, where its suffix does not say it.

    Raises:
        InvalidInput: no such kind, no such suffix, or no such folder.
    """
    to = OTHER_NAMES.get(str(to), to)
    kind = None if kind is None else OTHER_NAMES.get(kind, kind)
    if isinstance(to, str) and to in SUFFIXES and kind is None:
        if to in FMUS:
            raise InvalidInput(
                f"Export: expected a path that ends in {SUFFIXES[to]}, found the kind {to!r} alone, which is no text;"
                " name a file."
            )
        return to, None
    path = Path(to)
    if kind is None:
        suffixes = {suffix: name for name, suffix in reversed(SUFFIXES.items())}
        if path.suffix not in suffixes:
            raise unknown(
                "kind of export", str(to), [*SUFFIXES, *(f"a path that ends in {s}" for s in suffixes)]
            )
        kind = suffixes[path.suffix]
    if kind not in SUFFIXES:
        raise unknown("kind of export", kind, SUFFIXES)
    if path.suffix != SUFFIXES[kind]:
        raise InvalidInput(
            f"Export: expected a path that ends in {SUFFIXES[kind]} for the kind {kind!r}, found {str(path)!r};"
            " change it."
        )
    if not path.stem.isprintable() or set(path.stem) & UNFIT:
        raise InvalidInput(
            f"Export: expected a file name without quotes, backslashes and control characters, found {path.name!r}; its"
            " header is included by that name. Choose another one."
        )
    if not path.parent.is_dir():
        raise InvalidInput(f"Export: expected an existing folder, found {str(path.parent)!r}; make it first.")
    return kind, path


def exported(source: Source, kind: str, name: str, precision: str = "double") -> Contents:
    """What is in the files of an export by the suffix of their files, the main one first.

    Args:
        source: what is exported.
        kind: a name in `SUFFIXES`.
        name: what functions in C begin with.
        precision: of C, "double" or "float".

    Raises:
        InvalidInput: another precision.
        NotAvailable: the export does not give the twin's numbers, or cannot be checked.
    """
    contents = _contents(source, kind, name, precision)
    return contents if source.check else by_force(contents)


def by_force(contents: Contents) -> Contents:
    """The same, where each text says that it was exported by force.

    Args:
        contents: by suffix.
    """
    return {
        suffix: COMMENTS[suffix].format(FORCED) + content
        if suffix in COMMENTS and isinstance(content, str)
        else content
        for suffix, content in contents.items()
    }  # type: ignore[return-value]


def _contents(source: Source, kind: str, name: str, precision: str) -> Contents:
    law, flights = source.law, source.flights
    if precision not in PRECISIONS:
        raise unknown("precision", precision, PRECISIONS)
    if kind == "json":
        return {".json": source.record + "\n"}
    if kind == "latex":
        return {".tex": latex_source(law)}
    if kind == "sympy":
        text = sympy_source(law)
        if source.check:
            check_sympy(text, law, flights)
        return {".py": text}
    if law.actuation.stored:
        raise NotAvailable(
            f"Export, {kind}: expected a law whose hidden states are filled by commands, found one that motion fills,"
            " and whose steps or rewards know no further states; export it as 'python', 'c' or 'fmu3' where its outputs"
            " are derivatives, its equations ('sympy', 'latex') or the twin itself ('json'), or learn without them:"
            " storage=False."
        )
    if kind in MODULES:
        what, write, simulated = MODULES[kind]
        text = write(source)
        if source.check:
            check_simulation(what, simulated(text), source.simulate, law, flights, "double")
        return {".py": text}
    name = c_name(name)
    if kind in FMUS:
        if precision != "double":
            raise InvalidInput(f"Export, precision: expected 'double' for an FMU, found {precision!r}.")
        return {".fmu": _unit(source, FMUS[kind], name)}
    header, text = c_source(law, name, precision)
    if source.check:
        found = c_simulation(header, text, name, law, precision)
        check_simulation("C", found, source.simulate, law, flights, precision)
    return {".c": text, ".h": header}


def _unit(source: Source, version: int, name: str) -> bytes:
    """An FMU; by force also without a binary."""
    law, flights = source.law, source.flights
    start = flights[0].states[0] if flights else np.zeros(law.signals.n_x)
    unit = unit_of(version, law, name, start, "" if source.check else FORCED)
    with TemporaryDirectory(prefix="fmu-") as folder:
        try:
            library, place = built(unit, Path(folder))
        except NotAvailable:
            if source.check:
                raise
            return archived(unit.files)
        if source.check:
            found = fmu_simulation(version, library, unit.token, law)
            check_simulation(f"FMI {version}.0", found, source.simulate, law, flights, "double")
        return archived({**unit.files, **({place: library.read_bytes()} if place else {})})


def exported_controller(
    described: UnboundFamily,
    family: Family,
    genes: Floats,
    kind: str,
    name: str,
    precision: str,
    flights: Sequence[Trajectory],
    target: Floats,
) -> dict[str, str]:
    """Texts of a controller by the suffix of their files, the main one first, checked on flights.

    Args:
        described: the family as a user wrote it.
        family: the same, bound.
        genes: gains (size,).
        kind: "python" or "c".
        name: what functions in C begin with.
        precision: of C, "double" or "float".
        flights: whose states it is checked on; none: it is not checked.
        target: state that it leads to then (n_x,), or a reference, a row for each state of a run.

    Raises:
        InvalidInput: another kind or precision.
        NotAvailable: a family that cannot be written down, or an export that differs or cannot be checked.
    """
    if kind not in ("python", "c"):
        raise unknown("kind of export of a controller", kind, ("python", "c"))
    if precision not in PRECISIONS:
        raise unknown("precision", precision, PRECISIONS)

    def own(states: Floats, goal: Floats) -> Floats:
        controller = family.controller(genes)
        goals = np.broadcast_to(goal, states.shape)
        return np.array([controller.command(*pair) for pair in zip(states, goals, strict=True)])

    if kind == "python":
        text = controller_python(described, family, genes)
        if flights:
            check_controller("Python", python_controller(text), own, family, flights, target, "double")
        return {".py": text}
    name = c_name(name)
    header, text = controller_c(described, family, genes, name, precision)
    if flights:
        found = c_controller(header, text, name, family.signals.n_u, precision)
        check_controller("C", found, own, family, flights, target, precision)
    return {".c": text, ".h": header}


def delivered(contents: Contents, name: str, path: Path | None) -> str | tuple[Path, ...]:
    """One text where no path was given, else the files that were written.

    Args:
        contents: by suffix, the main one first.
        name: what functions in C begin with.
        path: of the main file.

    Raises:
        InvalidInput: a file that cannot be written.
    """
    include = f'#include "{c_name(name)}.h"'
    if path is None:
        texts = [text for text in contents.values() if isinstance(text, str)]
        return "\n".join(reversed(texts)).replace(f"{include}\n", "")
    written = []
    for suffix, content in contents.items():
        file = path.with_suffix(suffix)
        if isinstance(content, str):
            content = content.replace(include, f'#include "{path.stem}.h"').encode()
        try:
            write_whole(file, content)
        except OSError as reason:
            raise InvalidInput(f"Export: expected to be able to write {str(file)!r}: {reason}.") from reason
        written.append(file)
    return tuple(written)


def c_name(name: str) -> str:
    """A name that functions in C may begin with.

    Args:
        name: such as that of a file.
    """
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return plain if plain[:1].isalpha() else f"twin_{plain}"
