"""The page of the API has all that is public: what the package names, and what these give back."""

import inspect
import re
import typing
from importlib import import_module
from pathlib import Path

import twinloop as tl

DOCS = Path(__file__).parents[2] / "docs"
PAGE = "\n".join((DOCS / name).read_text(encoding="utf-8") for name in ("api.md", "options.md"))
ENTRIES = re.findall(r"^::: (\S+)$", PAGE, re.MULTILINE)

ONLY = {
    name: re.findall(r"\w+", found) if found else None
    for name, found in re.findall(
        r"^::: (\S+)\n(?:    .*\n)*?(?:      members: \[(.*)\]\n|\n|\Z)", PAGE, re.MULTILINE
    )
}
"""Members that are all that is shown of an entry, where the page says so."""


def entry(name):
    """What an entry of the page stands for."""
    parts = name.split(".")
    for split in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:split]))
        except ModuleNotFoundError:
            continue
        for part in parts[split:]:
            found = getattr(found, part)
        return found
    raise AssertionError(name)


def documented():
    """Classes and functions of the page, those of whole modules among them."""
    for name in ENTRIES:
        found = entry(name)
        if not inspect.ismodule(found):
            yield found
            continue
        for member, each in vars(found).items():
            shown = ONLY[name] is None or member in ONLY[name]
            if shown and (inspect.isroutine(each) or inspect.isclass(each)) and each.__module__ == name:
                yield each


KNOWN = {id(each) for each in documented()}


def named():
    """Classes and functions that the package and its modules name, by the name."""
    for name in tl.__all__:
        found = getattr(tl, name)
        if not inspect.ismodule(found):
            yield name, found
            continue
        for inner in getattr(found, "__all__", ()):
            yield f"{name}.{inner}", getattr(found, inner)


def classes_in(hint):
    """Classes of a type hint, those within its brackets among them."""
    if inspect.isclass(hint):
        yield hint
    for part in typing.get_args(hint):
        yield from classes_in(part)


def given_back():
    """Classes of the package that public members of public classes give back, each with who gives it."""
    for known in list(documented()):
        members = inspect.getmembers(known) if inspect.isclass(known) else [("", known)]
        for name, member in members:
            if name.startswith("_"):
                continue
            called = getattr(member, "fget", None) or getattr(member, "func", None) or member
            if not inspect.isfunction(called) or not called.__module__.startswith("twinloop."):
                continue
            scope = {**vars(import_module(called.__module__))}
            try:
                hint = eval(str(called.__annotations__.get("return")), scope)
            except NameError:
                continue  # a name for type checkers alone
            for each in classes_in(hint):
                if each.__module__.startswith("twinloop.") and each.__module__ != "twinloop._core":
                    yield f"{getattr(known, '__name__', known)}.{name}", each


def test_every_name_of_the_package_has_an_entry():
    missing = [
        name
        for name, found in named()
        if (inspect.isclass(found) or inspect.isfunction(found)) and id(found) not in KNOWN
    ]
    assert missing == []


def test_what_public_members_give_back_has_an_entry():
    missing = {
        f"{each.__module__}.{each.__qualname__}, of {who}"
        for who, each in given_back()
        if id(each) not in KNOWN
    }
    assert sorted(missing) == []


def test_entries_are_there_once():
    assert len(ENTRIES) == len(set(ENTRIES))
    assert all(entry(name).__doc__ for name in ENTRIES)
