"""What results come from: the commit of the checkout, and the command as a person would type it again."""

import subprocess
import sys
from pathlib import Path

import pytest

from twinloop._ground import versions
from twinloop.campaign.provenance import as_typed, without_tokens
from twinloop.faces.report.source import source


@pytest.mark.parametrize(
    ("words", "typed"),
    [
        (["/x/python/twinloop/__main__.py", "run", "quadrotor"], ["twinloop", "run", "quadrotor"]),
        (["/usr/bin/twinloop", "report", "a b.db"], ["twinloop", "report", "a b.db"]),
        (["/home/me/rig/fly.py", "4"], ["python", "fly.py", "4"]),
        (["/x/pytest/__main__.py", "-q"], ["python", "-m", "pytest", "-q"]),
        (["-c"], ["python", "-c"]),
        ([""], ["python"]),
        ([], ["python"]),
    ],
)
def test_a_command_is_what_a_person_would_type(words, typed):
    assert as_typed(words) == typed == as_typed(typed)


@pytest.mark.parametrize("token", [["--token", "opensesame"], ["--token=opensesame"]])
def test_a_command_that_is_recorded_has_no_token(token):
    words = ["twinloop", "dashboard", "rig.db", *token, "--port", "0"]
    shown = without_tokens(words)
    assert "opensesame" not in " ".join(shown) and shown[:3] == words[:3] and shown[-2:] == words[-2:]
    assert without_tokens(shown) == shown and without_tokens(words[:3]) == words[:3]


def test_the_commit_is_that_of_the_checkout_the_package_stands_in():
    top = Path(versions.__file__).parents[3]
    if not (top / ".git").exists():
        pytest.skip("no checkout")
    asked = ["git", "-C", str(top), "rev-parse", "HEAD"]
    head = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    said = versions.versions()["commit"].split(" ")
    assert head.startswith(said[0]) and len(said[0]) >= 7 and said[1:] in ([], ["with", "changes"])


def test_a_package_that_is_no_checkout_has_no_commit(tmp_path, monkeypatch):
    monkeypatch.setattr(versions, "__file__", str(tmp_path / "lib" / "twinloop" / "_ground" / "versions.py"))
    versions.commit.cache_clear()
    assert "commit" not in versions.versions() and "twinloop" in versions.versions()
    versions.commit.cache_clear()


def test_the_command_line_is_named_by_its_name_however_it_was_called(tmp_path):
    store = str(tmp_path / "a.db")
    words = ["run", "quadrotor", "--preset", "paper", "--experiments", "1", "--generations", "1"]
    called = [sys.executable, "-m", "twinloop", *words, "--store", store]
    subprocess.run(called, check=True, capture_output=True)
    assert source(store).sessions[0]["command"].startswith("twinloop run quadrotor --preset paper")
