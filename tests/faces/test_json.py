"""Every verb answers with one JSON object where `--json` asks for it, and with nothing else."""

import json

import click
import pytest

from command import invoke
from dashboards import begun, flight, look
from lives import RIG
from twinloop.faces.cli import main

ALONE = ("bench",)
"""Verbs that only lead to others."""


def test_every_verb_has_it():
    with click.Context(main) as context:
        for name in main.list_commands(context):
            if name not in ALONE:
                verb = main.get_command(context, name)
                assert "as_json" in [option.name for option in verb.params], name


@pytest.fixture
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    store = begun(folder / "rig.db")
    (folder / "signals.toml").write_text(RIG)
    flight(folder / "flight1.csv", look(store).tests[1])
    return folder


@pytest.mark.parametrize(
    ("words", "keys"),
    [
        (("show", "rig.db"), {"store", "result"}),
        (("report", "rig.db", "-o", "rig.html"), {"files"}),
        (("report", "rig.db", "-o", "figures", "--format", "svg"), {"files"}),
        (("compare", "rig.db", "rig.db"), {"campaigns", "answers"}),
        (("certify", "rig.db", "-o", "sheet"), {"granted", "refusals", "files"}),
        (("settings", "rig.db", "1", "-o", "sheet"), {"files", "note"}),
        (("export", "rig.db", "twin", "--to", "latex", "--force"), {"kind", "text"}),
        (("export", "rig.db", "controller", "-o", "law.py", "--force"), {"kind", "files"}),
        (("check", "flight1.csv", "signals.toml"), {"fit", "rows", "remarks"}),
        (("tell", "rig.db", "1", "flight1.csv"), {"test", "status", "quality", "experiments"}),
        (("learn", "rig.db"), {"learnt"}),
        (("abandon", "rig.db", "1"), {"test", "status"}),
        (("new", "other.toml"), {"files", "store"}),
    ],
    ids=lambda each: " ".join(each[:1]) if isinstance(each, tuple) else "",
)
def test_a_verb_prints_one_object_that_says_what_was_done(room, monkeypatch, words, keys):
    monkeypatch.chdir(room)
    done = invoke(*words, "--json")
    found = json.loads(done.stdout)
    assert keys <= set(found) and done.exit_code in (0, 1)
    for file in found.get("files", ()):
        assert (room / file).exists()


def test_ask_prints_the_test_that_is_to_be_flown(room, monkeypatch):
    monkeypatch.chdir(room)
    assert invoke("tell", "rig.db", "1", "flight1.csv").exit_code == 0
    assert "test" in json.loads(invoke("ask", "rig.db", "--json").stdout)
