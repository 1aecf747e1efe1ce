"""The tables of docs/exam.md are those of the exam's code."""

from dataclasses import replace
from pathlib import Path

import pytest

from twinloop_exam import learners, systems


@pytest.fixture
def exam_page(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "scripts"))
    import exam_page

    return exam_page


def test_the_page_is_what_its_script_writes(exam_page):
    written = exam_page.PAGE.read_text(encoding="utf-8")
    assert written == exam_page.page(), "run `python scripts/exam_page.py`"


def test_everybody_and_everything_is_described(exam_page):
    written = exam_page.PAGE.read_text(encoding="utf-8")
    for each in (*learners.LEARNERS.values(), *systems.SUBJECTS.values()):
        assert each.what, each.name
        assert each.name.startswith("without-") or f"| `{each.name}` | {each.what} |" in written


def test_a_page_that_says_other_than_the_code_is_stale(exam_page, monkeypatch):
    written = exam_page.PAGE.read_text(encoding="utf-8")
    for known, name in ((learners.LEARNERS, "operon"), (systems.SUBJECTS, "rotorpy")):
        with monkeypatch.context() as changed:
            changed.setitem(known, name, replace(known[name], what="another one"))
            assert f"| `{name}` | another one |" in exam_page.page() != written


def test_a_description_makes_no_measured_row_stale():
    for who in learners.LEARNERS.values():
        assert learners.key(who) == learners.key(replace(who, what="another one"))
