"""Writes docs/api.md out of signatures and docstrings: python scripts/api_page.py."""

import ast
import inspect
import re
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path

from docstrings import cell, code, doc_of, explained, flowing, prose, python, table
from options_page import TABLES, options_table

import twinloop as tl
from twinloop._ground.showing import Shown
from twinloop.records import Recorded

PAGE = Path(__file__).parents[1] / "docs" / "api.md"
STUB = Path(tl.__file__).with_name("_core.pyi")
WIDTH = 100
SECTIONS = {
    "Campaign": ["Campaign", "identify"],
    "Twin": ["Twin", "load_twin", "Remark"],
    "Experiments": ["Test", "Trajectory", "Replay", "Limits"],
    "Signals": ["Signals", "State", "Command", "RigidBody"],
    "Logs": ["load", "check_log"],
    "Systems": ["System", "systems.*"],
    "Controllers": ["controllers.*"],
    "Autopilots": ["autopilots.*"],
    "Guarding": ["guard.*"],
    "What campaigns and twins give back": ["results.*"],
    "Options": ["options.*"],
    "Objectives": ["objectives.*"],
    "Candidate flights": ["flights.*"],
    "Ranking and archive": ["pareto.*"],
    "Contracts": ["contracts.*"],
    "Errors": ["errors.*"],
}
"""Headings, with the names below each; `*` stands for all of a room that no heading before it has."""
HANDLES = {"engine", "dynamics"}
"""Members that give the engine what it reads itself."""


def named():
    """Objects by heading and by their name under `tl`, which is that of a room where the package has none."""
    found, seen = {}, set()
    for heading, names in SECTIONS.items():
        found[heading] = {}
        for name in names:
            room, _, inner = name.rpartition(".")
            for each in getattr(tl, room).__all__ if inner == "*" else [inner]:
                thing = getattr(getattr(tl, room) if room else tl, each)
                if id(thing) not in seen:
                    found[heading][each if hasattr(tl, each) else f"{room}.{each}"] = thing
                    seen.add(id(thing))
    return found


# Signatures


def signed(name, thing):
    """A call with its types and defaults, on as many lines as it takes."""
    signature = inspect.signature(thing)
    parts, star = [], False
    for each in signature.parameters.values():
        if each.name in ("self", "cls") or each.kind is each.VAR_KEYWORD:
            continue
        if each.kind is each.KEYWORD_ONLY and not star:
            parts.append("*")
        star = star or each.kind in (each.KEYWORD_ONLY, each.VAR_POSITIONAL)
        parts.append(str(each.replace(annotation=each.empty, default=each.empty)) + typed(each))
    given = signature.return_annotation
    result = "" if inspect.isclass(thing) or given is signature.empty else f" -> {hint(given)}"
    line = f"{name}({', '.join(parts)}){result}"
    if len(line) > WIDTH:
        line = f"{name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){result}"
    return line


def typed(parameter):
    """Type and default of a parameter, as they stand behind its name."""
    kind = "" if parameter.annotation is parameter.empty else f": {hint(parameter.annotation)}"
    if parameter.default is parameter.empty:
        return kind
    default = python(parameter.default)
    return f"{kind}{' = ' if kind else '='}{'...' if default.startswith('<') else default}"


def hint(annotation):
    """A type as text, without the modules that it comes from."""
    annotation = getattr(annotation, "__forward_arg__", annotation)
    text = annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
    # A field that is an argument alone is one of its type.
    text = re.sub(r"^InitVar\[(.*)\]$", r"\1", text)
    return re.sub(r"\b(?:\w+\.)+(?=\w)|\b_(?=[A-Z])", "", text)


def block(line):
    """A signature as a block of code."""
    return f"```python\n{line}\n```"


# Entries


def entry(name, thing):
    """The part of the page on a class, a function or a value."""
    if not inspect.isclass(thing) and not inspect.isroutine(thing):
        parts = [prose(flowing(said_of(name)))]
    elif thing.__module__ == "twinloop._core":
        parts = of_the_engine(thing)
    elif inspect.isroutine(thing):
        parts = [block(signed(f"tl.{name}", thing)), *explained(doc_of(thing.__doc__))]
    elif issubclass(thing, BaseException):
        kinds = [base.__name__ for base in thing.__bases__ if base is not Exception]
        parts = [
            *explained(doc_of(thing.__doc__))[:1],
            *([f"Is a {' and a '.join(kinds)}."] if kinds else []),
        ]
    elif name.startswith("options."):
        parts = of_options(thing)
    elif name.startswith("results."):
        parts = of_what_is_given_back(thing)
    else:
        made = [] if getattr(thing, "_is_protocol", False) else [block(signed(f"tl.{name}", thing))]
        parts = [*made, *explained(doc_of(thing.__doc__)), *members(thing)]
    return [f"### `tl.{name}`", *parts]


@cache
def said_of(name):
    """The string behind the assignment of a room's value, in the room or in the module that it comes from."""
    room, _, value = name.rpartition(".")
    source = inspect.getsource(getattr(tl, room))
    come_from = re.findall(rf"^from (\S+) import (?:\([^)]*|.*)\b{value}\b", source, re.MULTILINE)
    body = ast.parse(inspect.getsource(import_module(come_from[0])) if come_from else source).body
    for at, following in pairwise(body):
        if isinstance(at, (ast.Assign, ast.AnnAssign)) and ast.unparse(at).partition(":")[0].startswith(
            value
        ):
            return ast.literal_eval(following.value)
    raise LookupError(f"{name} says nothing of itself.")


def of_options(cls):
    """Options: their table, or where it stands."""
    said = explained(doc_of(cls.__doc__), arguments=False)
    if cls is tl.options.Options:
        return [*said, *options_table(cls, "paper")]
    place = "".join(f"#{each.lower().replace(' ', '-')}" for each, shown in TABLES.items() if shown is cls)
    return [said[0], f"See [Options](options.md{place})."]


def of_what_is_given_back(cls):
    """A class that nobody makes: what it has, and what it does."""
    doc, fields = doc_of(cls.__doc__), fields_of(cls)
    said = {name: text for name, text in doc.arguments.items() if name in fields}
    rows = [(f"`{name}`", code(fields[name]), cell(text)) for name, text in said.items()]
    return [*explained(doc, arguments=False), *table(("attribute", "type", ""), rows), *members(cls)]


def fields_of(cls):
    """Types of the attributes that a class declares, by name."""
    found = {}
    for base in reversed(cls.__mro__):
        found |= {name: hint(each) for name, each in inspect.get_annotations(base).items()}
    return found


def public_members(cls):
    """Members by name, as the classes of the package define them, in the order of the source."""
    hidden = {*HANDLES, "recorded_fields", *doc_of(cls.__doc__).arguments}
    found = {}
    for base in cls.__mro__:
        if base.__module__.startswith("twinloop") and base not in (Recorded, Shown):
            for name, member in vars(base).items():
                if not name.startswith("_") and name not in hidden:
                    found.setdefault(name, member)
    return found


def members(cls):
    """A table of what a class has and does in a word, then each method that needs more than one."""
    rows, parts = [], []
    for name, member in public_members(cls).items():
        read = getattr(member, "fget", None) or getattr(member, "func", None)
        method = getattr(member, "__func__", member)
        if read is not None:
            rows.append(
                (f"`{name}`", code(hint(inspect.signature(read).return_annotation)), cell(at_length(read)))
            )
        elif inspect.isfunction(method):
            doc, call = doc_of(method.__doc__), signed(name, method)
            if doc.body or doc.arguments or doc.returned or doc.raised:
                parts += [f"#### `{cls.__name__}.{name}`", block(call), *explained(doc)]
            else:
                called, _, kind = flowing(call).partition(" -> ")
                rows.append((f"`{called}`", code(kind.removesuffix("None")), cell(doc.summary)))
    return [*table(("member", "type", ""), rows), *parts]


def at_length(read):
    """All that the docstring of a property says."""
    doc = doc_of(read.__doc__)
    return flowing(f"{doc.line} {' '.join(f'Raises `{name}`: {text}' for name, text in doc.raised.items())}")


def of_the_engine(cls):
    """A class of the engine, which its stub describes."""
    (found,) = [each for each in stub().body if isinstance(each, ast.ClassDef) and each.name == cls.__name__]
    rows = []
    for each in found.body:
        if isinstance(each, ast.FunctionDef) and not each.name.startswith("_"):
            read = any(ast.unparse(mark) == "property" for mark in each.decorator_list)
            names = [one.arg for one in (*each.args.args, *each.args.kwonlyargs) if one.arg != "self"]
            call = each.name if read else f"{each.name}({', '.join(names)})"
            said = cell(doc_of(ast.get_docstring(each)).line)
            rows.append((f"`{call}`", code(hint(ast.unparse(each.returns))), said))
    doc = doc_of(ast.get_docstring(found))
    return [*explained(doc, arguments=False), *table(("member", "type", ""), rows)]


@cache
def stub():
    """What describes the engine to type checkers."""
    return ast.parse(STUB.read_text(encoding="utf-8"))


# The page


def head():
    """What `import twinloop` gives, and how the page is to be read."""
    rooms = [name for name in tl.__all__ if inspect.ismodule(getattr(tl, name))]
    names = [f"`{name}`" for name in tl.__all__ if name not in rooms and name != "__version__"]
    rows = [(f"`tl.{name}`", cell(doc_of(getattr(tl, name).__doc__).summary)) for name in rooms]
    return [
        "# API",
        f"`import twinloop as tl` gives {', '.join(names)}, and the rooms below; `dir(tl)` shows nothing else.",
        *table(("room", ""), rows),
        "Shapes come first; units are SI and radians. `Floats` is an array of float64. What can be"
        " [kept](concepts/records.md) has `to_record()` and a class method `from_record(record)`. `twinloop.sweep` is"
        " imported by its own name: see [Many campaigns at once](sweep.md).",
        "This page is made from the code by `python scripts/api_page.py`.",
    ]


def page():
    """The page as it should be."""
    parts = head()
    for heading, things in named().items():
        parts.append(f"## {heading}")
        for name, thing in things.items():
            parts += entry(name, thing)
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
