"""The pages of the API and of the options say what the code says, of all that is public."""

import dataclasses
import inspect
import re
from pathlib import Path

import pytest

import twinloop as tl
from twinloop.campaign.presets import CHOICES, PRESETS, RANGES, options_of
from twinloop.records import Recorded

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def scripts(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))


def page(name):
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def entries():
    """Objects of the page of the API, by their names there."""
    found = {}
    for name in re.findall(r"^### `tl\.(\S+)`$", page("api.md"), re.MULTILINE):
        assert name not in found, f"{name} has two entries"
        *rooms, last = name.split(".")
        found[name] = getattr(getattr(tl, rooms[0]) if rooms else tl, last)
    return found


def test_the_page_of_the_api_is_what_its_script_writes():
    import api_page

    assert page("api.md") == api_page.page(), "run `python scripts/api_page.py`"


def test_the_page_of_the_options_is_what_its_script_writes():
    import options_page

    assert page("options.md") == options_page.page(), "run `python scripts/options_page.py`"


def test_every_public_name_has_an_entry():
    shown = {id(found) for found in entries().values()}
    rooms = [tl, *(getattr(tl, name) for name in tl.__all__ if inspect.ismodule(getattr(tl, name)))]
    missing = [
        f"{room.__name__}.{name}"
        for room in rooms
        for name in room.__all__
        if not inspect.ismodule(getattr(room, name)) and id(getattr(room, name)) not in shown
    ]
    assert missing == ["twinloop.__version__"]


def test_the_page_on_campaigns_names_every_argument_and_every_member():
    text = page("concepts/campaign.md")
    parameters = inspect.signature(tl.Campaign).parameters.values()
    arguments = [each.name for each in parameters if each.kind is not inspect.Parameter.VAR_KEYWORD]
    own = set(dir(tl.Campaign)) - set(dir(Recorded))
    names = [*arguments, *(name for name in own if name.islower() and not name.startswith("_"))]
    assert [name for name in names if not re.search(rf"`(Campaign\.)?{name}[`(]", text)] == []


def test_the_first_lines_name_all_that_the_package_names():
    first = page("api.md").partition("\n## ")[0]
    assert [name for name in tl.__all__ if not re.search(rf"`(?:tl\.)?{name}`", first)] == ["__version__"]


def calls():
    """Functions, classes that somebody makes, and methods of the page, by name."""
    for name, found in entries().items():
        of_the_package = (
            getattr(found, "__module__", "").startswith("twinloop.") and "_core" not in found.__module__
        )
        if inspect.isfunction(found):
            yield name, found
        elif inspect.isclass(found) and of_the_package and not issubclass(found, BaseException):
            if not name.startswith(("results.", "options.")) and not getattr(found, "_is_protocol", False):
                yield name, found
            for member, value in vars(found).items():
                if (
                    inspect.isfunction(value)
                    and not member.startswith("_")
                    and "Args:" in (value.__doc__ or "")
                ):
                    yield f"{name}.{member}", value


def test_every_argument_of_what_is_public_is_explained():
    wrong = []
    for name, call in calls():
        taken = {
            each.name
            for each in inspect.signature(call).parameters.values()
            if each.name != "self" and each.kind is not each.VAR_KEYWORD
        }
        told = set(
            re.findall(r"^ {4}(\w+): ", inspect.getdoc(call).partition("Args:\n")[2].split("\n\n")[0], re.M)
        )
        if taken != told:
            wrong.append(f"{name}: {sorted(taken ^ told)}")
    assert wrong == []


def rows(name, heading):
    """Rows of the table below a heading, by what their first cell says."""
    text = page(name).partition(f"{heading}\n")[2].partition("\n#")[0]
    return {
        line[0].strip("` "): line
        for line in (row.strip("| ").split(" | ") for row in re.findall(r"^\| `.*$", text, re.M))
    }


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_tables_of_options_have_each_option_with_its_default_and_the_range_that_is_checked(preset):
    found = (
        rows("api.md", "### `tl.options.Options`")
        if preset == "paper"
        else {
            **rows("options.md", "## How a twin is learnt"),
            **rows("options.md", "## How tests are chosen and gains tuned"),
        }
    )
    assert list(found) and set(found) == {field.name for field in dataclasses.fields(PRESETS[preset])}
    for name, (low, high) in RANGES[preset].items():
        least, greatest = found[name][3].split(" to ")
        assert (float(least), float(greatest)) == (low, high)
        with pytest.raises(tl.InvalidInput, match=name):
            options_of(preset, {name: type(getattr(PRESETS[preset], name) or 0)(high * 2 + 1)})
    for name, known in CHOICES[preset].items():
        assert all(f"`{each}`" in found[name][3] for each in known)
    for name, line in found.items():
        assert eval(line[2].strip("`")) == getattr(PRESETS[preset], name)


def test_a_page_that_says_less_than_the_code_is_stale(monkeypatch, tmp_path):
    import options_page

    shortened = tmp_path / "options.md"
    shortened.write_text(page("options.md").replace("| `confidence` |", "| `confident` |"), encoding="utf-8")
    monkeypatch.setattr(options_page, "PAGE", shortened)
    assert shortened.read_text(encoding="utf-8") != options_page.page() == page("options.md")
