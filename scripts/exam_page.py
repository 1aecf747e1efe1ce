"""Writes the tables of docs/exam.md out of the exam's code: python scripts/exam_page.py.

Who sits the exam stands in `twinloop_exam.learners`, on what in `twinloop_exam.systems`. All the rest of the page is
written by hand.
"""

import sys
from pathlib import Path

from docstrings import cell, table

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "studies"))

from twinloop_exam.ablations import assignments  # noqa: E402
from twinloop_exam.kinds import Campaigner, Fitter, Optimum, Tuner  # noqa: E402
from twinloop_exam.learners import LEARNERS  # noqa: E402
from twinloop_exam.systems import SUBJECTS  # noqa: E402

PAGE = ROOT / "docs" / "exam.md"
ABLATED = "without-"
"""What the names of ablations begin with; all of them are one row, for they have a table elsewhere."""
JUDGED_BY = {
    "final_distance": "distance to the target at the end",
    "iae": "absolute error of the angles, summed and integrated",
}
"""Qualities of controllers in words."""


def systems():
    """What is flown, and what controllers are judged by."""
    rows = []
    for subject in SUBJECTS.values():
        runs = f", mean of {subject.judged_runs} noisy runs" if subject.judged_runs else ""
        rows.append((f"`{subject.name}`", cell(subject.what), JUDGED_BY[subject.quality] + runs))
    return table(("name", "what", "controllers are judged by"), rows)


def learners():
    """Who learns, with what settings, and what it needs to be installed."""
    rows, ablated = [], False
    for who in LEARNERS.values():
        if not who.name.startswith(ABLATED):
            rows.append((f"`{who.name}`", cell(who.what), settings(who), getattr(who, "package", "")))
        elif not ablated:
            ablated = True
            idea = "one idea off each: [ablations](options.md#ablations)"
            rows.append((f"`{ABLATED}…`", idea, "as in that table", ""))
    return table(("name", "what", "settings", "needs"), rows)


def settings(who):
    """Where a learner differs from its kind, as it is written on the command line."""
    match who:
        case Campaigner():
            found = {**who.options, **who.arguments}
        case Fitter() | Tuner():
            found = who.settings
        case Optimum():
            found = {"flights": who.flights, "starts": who.starts, "draws": who.draws}
        case _:
            found = {}
    patient = [f"`flights={flights}` on `{name}`" for name, flights in getattr(who, "patient", {}).items()]
    return ", ".join([*(f"`{each}`" for each in assignments(found)), *patient])


TABLES = {"systems": systems, "learners": learners}
"""By the names in the page's markers."""


def page():
    """The page as it should be: what people wrote, with the tables between their markers."""
    text = PAGE.read_text(encoding="utf-8")
    for name, made in TABLES.items():
        begins, ends = f"<!-- {name}: written by scripts/exam_page.py -->\n", f"<!-- end of {name} -->"
        before, _, rest = text.partition(begins)
        _, _, after = rest.partition(ends)
        text = before + begins + "\n" + "\n".join(made()) + "\n\n" + ends + after
    return text


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
