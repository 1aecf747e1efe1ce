"""Systems by name: a built-in one, or `module:object` for one of a user's own."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from twinloop.errors import InvalidInput, TwinloopError, unknown
from twinloop.records import differences
from twinloop.signals import Signals
from twinloop.systems.base import System
from twinloop.systems.fmu import FMU
from twinloop.systems.folder import Folder
from twinloop.systems.gymnasium import Gymnasium
from twinloop.systems.quadrotor import Quadrotor
from twinloop.systems.raised import raised
from twinloop.systems.rotorpy import RotorPy

NAMED: Mapping[str, Any] = {
    "quadrotor": Quadrotor,
    "rotorpy": RotorPy,
    "gymnasium": Gymnasium,
    "fmu": FMU,
    "folder": Folder,
}
"""What makes each system that has a name."""
BESIDE = "stands beside the campaign file or is installed"


def system_named(name: object, arguments: Mapping[str, Any], signals: Signals | None, folder: Path) -> System:
    """A system of its name and arguments. A `module:object` is imported: that runs its code.

    Args:
        name: a name in `NAMED`, or "module:object": a class or function that makes a system, or a system.
        arguments: that it is made with.
        signals: that were described; passed on where they are asked for, compared with the system's own elsewhere.
        folder: where modules are looked for first, and relative paths begin.

    Returns:
        The system.

    Raises:
        InvalidInput: no such system, arguments that it has not, or other signals than were described.
        NotAvailable: a package that it needs is not installed.
    """
    if not isinstance(name, str) or (name not in NAMED and ":" not in name):
        raise unknown("system", name, [*NAMED, "module:object"])
    with _importable(folder, first=name not in NAMED):
        found = NAMED[name] if name in NAMED else imported(name, BESIDE)
        if name not in NAMED:
            _refuse_what_makes_no_system(name, found)
        system = _made(name, found, dict(arguments), signals, folder)
    own = getattr(system, "signals", None)
    if not isinstance(own, Signals) or not callable(getattr(system, "run", None)):
        raise InvalidInput(
            f"System {name!r}: expected an object with twinloop.Signals as `signals` and with `run(test)`, found"
            f" {type(system).__name__}; add them."
        )
    if signals is not None and own.to_record() != signals.to_record():
        differ = differences(signals.to_record(), own.to_record(), ("in the campaign file", "in the system"))
        raise InvalidInput(
            f"System {name!r}: expected its own states, commands and dt to be those of the campaign file, found others:"
            f" {differ}; correct the file, or leave [states], [commands] and dt out of it."
        )
    made: System = system
    return made


def imported(name: str, place: str) -> Any:
    """What a `module:object` names. Importing runs the module's code.

    Args:
        name: module, colon, object, which may be an attribute of one.
        place: where the module should be, for the error.

    Raises:
        InvalidInput: there is none, or the module's code raises.
    """
    module, _, attribute = name.partition(":")
    try:
        found: Any = import_module(module)
        for part in attribute.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError, ValueError) as reason:
        raise InvalidInput(
            f"System {name!r}: expected module:object, found: {reason}; check the spelling, and that the module"
            f" {place}."
        ) from reason
    except TwinloopError:
        raise
    except Exception as reason:
        raise InvalidInput(
            f"System {name!r}: expected a module that can be imported, found {raised(reason)}; correct it."
        ) from reason
    return found


def _refuse_what_makes_no_system(name: str, found: object) -> None:
    """Refuses to call what belongs to Python itself: with its arguments a file alone could run any program."""
    written_in = (
        str(getattr(found, "__module__", "")) if inspect.isroutine(found) or inspect.isclass(found) else ""
    )
    of = [module.partition(".")[0] for module in (name.partition(":")[0], written_in)]
    if inspect.isbuiltin(found) or not sys.stdlib_module_names.isdisjoint(of):
        raise InvalidInput(
            f"System {name!r}: expected a system, or a class or function of yours that makes one, found one of Python's"
            " own modules; name another."
        )


def _made(name: str, found: Any, arguments: dict[str, Any], signals: Signals | None, folder: Path) -> Any:
    if not isinstance(found, type) and callable(getattr(found, "run", None)):
        if arguments:
            raise InvalidInput(
                f"System {name!r}: expected no arguments for a system that is there, found {', '.join(arguments)};"
                " name a class or a function."
            )
        return found
    if not callable(found):
        raise InvalidInput(
            f"System {name!r}: expected a system, or a class or function that makes one, found {found!r}."
        )
    parameters = inspect.signature(found).parameters
    any_name = any(one.kind is inspect.Parameter.VAR_KEYWORD for one in parameters.values())
    for key in arguments:
        if key not in parameters and not any_name:
            raise unknown(
                f"argument of the system {name!r}", key, [one for one in parameters if one != "signals"]
            )
    if "signals" in parameters and signals is not None:
        arguments["signals"] = signals
    if name in NAMED and isinstance(arguments.get("path"), str):
        arguments["path"] = folder / arguments["path"]
    missing = [
        key
        for key, one in parameters.items()
        if key not in arguments
        and one.default is one.empty
        and one.kind in (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    ]
    if missing:
        raise InvalidInput(
            f"System {name!r}: expected {', '.join(missing)}, found none; add them to its arguments."
        )
    try:
        return found(**arguments)
    except TwinloopError:
        raise
    except Exception as reason:
        raise InvalidInput(
            f"System {name!r}: expected to be made of its arguments ({', '.join(arguments) or 'none'}), found"
            f" {raised(reason)}; correct it."
        ) from reason


@contextmanager
def _importable(folder: Path, first: bool) -> Iterator[None]:
    """Modules of a folder can be imported meanwhile; before all others where one of them is named, else behind them."""
    place = str(folder.resolve())
    sys.path.insert(0 if first else len(sys.path), place)
    try:
        yield
    finally:
        sys.path.remove(place)
