"""What a user sees of the package: the names that are meant, and a name for every type that these give back."""

import inspect
import subprocess
import sys
import typing
from dataclasses import dataclass

import pytest

import twinloop as tl
from lives import begun
from twinloop.faces.figures.plots import Plots

HANDLES = {"engine", "setting", "dynamics"}
"""Members that give the engine what it reads itself; nobody annotates with these."""


def rooms():
    """The package, and each of its public modules."""
    return {"": tl} | {name: getattr(tl, name) for name in tl.__all__ if inspect.ismodule(getattr(tl, name))}


def public():
    """Classes and functions that somebody can reach, by the names under which he does."""
    return {
        f"{room}.{name}".lstrip("."): getattr(module, name)
        for room, module in rooms().items()
        for name in module.__all__
        if not inspect.ismodule(getattr(module, name))
    }


def classes_in(hint):
    """Classes of a type hint, those within its brackets among them."""
    if inspect.isclass(hint):
        yield hint
    for part in typing.get_args(hint):
        yield from classes_in(part)


def hints_of(thing, owner=None):
    """Type hints by name; `Self` and `Plots`, a face, are imported for type checkers alone."""
    return typing.get_type_hints(thing, localns={"Self": owner, "Plots": Plots})


def meant(member):
    """Whether somebody may read a member of a public class."""
    return not member.startswith("_") and member not in HANDLES


def given_back_by(name, thing):
    """Classes that a function returns, or that the fields and members of a class give, each with who gives it."""
    if not inspect.isclass(thing):
        found = [(name, hints_of(thing).get("return"))] if inspect.isfunction(thing) else []
    else:
        fields = hints_of(thing, thing).items()
        found = [(f"{name}.{field}", hint) for field, hint in fields if meant(field)]
        found += [(name, base) for base in getattr(thing, "__orig_bases__", ())]
        for member, value in inspect.getmembers(thing):
            if not meant(member):
                continue
            called = getattr(value, "fget", None) or getattr(value, "func", None) or value
            if inspect.isfunction(called) or inspect.ismethod(called):
                found.append((f"{name}.{member}", hints_of(called, thing).get("return")))
    for who, hint in found:
        yield from ((who, each) for each in classes_in(hint))


def nameless(names):
    """Classes of the package that what is named gives back, and that have no name themselves, with who gives them."""
    known = set(map(id, names.values()))
    return sorted(
        f"{who} gives {each.__module__}.{each.__qualname__}"
        for name, thing in names.items()
        for who, each in given_back_by(name, thing)
        if each.__module__.split(".")[0] == "twinloop" and id(each) not in known
    )


def test_the_package_shows_what_is_meant_and_nothing_else():
    assert {name for name in dir(tl) if not (name.startswith("__") and name.endswith("__"))} == {
        name for name in tl.__all__ if name != "__version__"
    }


def test_the_package_still_shows_the_same_after_all_of_it_was_loaded():
    code = "import twinloop as tl; seen = dir(tl); import twinloop.sweep, twinloop.faces.cli; print(seen == dir(tl))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "True"


def test_importing_the_package_loads_no_face_no_study_and_no_optional_package():
    code = "import sys, twinloop; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    heavy = {"click", "jinja2", "matplotlib", "pyulog", "rich", "scipy", "sqlalchemy", "starlette"}
    rooms = ("twinloop.faces", "twinloop.sweep", "twinloop.reproduce")
    assert [name for name in loaded if name.split(".")[0] in heavy or name.startswith(rooms)] == []


@pytest.mark.parametrize("room", sorted(set(rooms()) - {""}))
def test_every_public_room_says_which_of_its_names_are_meant(room):
    names = rooms()[room].__all__
    assert len(names) == len(set(names)) and not any(name.startswith("_") for name in names)
    found = [getattr(rooms()[room], name) for name in names]
    assert all(each.__doc__ for each in found if typing.get_origin(each) is not typing.Literal)


def test_every_type_that_a_public_member_gives_back_has_a_public_name():
    assert nameless(public()) == []


def test_what_draws_a_campaign_has_its_type():
    assert tl.Campaign.plot.fget.__annotations__["return"] == "Plots"
    assert type(begun().plot) is tl.results.Plots is Plots


def test_causes_and_tasks_have_names():
    assert set(typing.get_args(tl.results.Cause)) == {"disturbance", "law", "undecided"}
    assert isinstance(begun().experiments[0].test.task, tl.results.Task)
    with pytest.raises(AttributeError, match="'Plot'"):
        _ = tl.results.Plot


def test_a_type_without_a_name_is_found_wherever_it_hides(monkeypatch):
    @dataclass
    class Hidden:
        width: float

    class Table(tuple[Hidden, ...]):
        pass

    @dataclass
    class Seen:
        field: Hidden

        @property
        def one(self): ...

        def several(self): ...

        def engine(self): ...

    Seen.one.fget.__annotations__["return"] = Hidden | None
    Seen.several.__annotations__["return"] = dict[str, list[Hidden]]
    Seen.engine.__annotations__["return"] = Hidden
    for each in (Hidden, Seen, Table):
        monkeypatch.setattr(each, "__module__", "twinloop.inside")
    found = [line.split(" ")[0] for line in nameless({"Seen": Seen, "Table": Table})]
    assert found == ["Seen.field", "Seen.one", "Seen.several", "Table"]
    assert nameless({"Seen": Seen, "Table": Table, "Hidden": Hidden}) == []
