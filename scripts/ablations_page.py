"""Writes the table of ablations of docs/options.md: python scripts/ablations_page.py.

What is switched off and how stands in `twinloop_exam.ablations`. What it buys is the answer of `twinloop bench zoo
--ablation all --table json`, which is kept as `MEASURED`, once that was flown.
"""

import json
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "studies"))

from twinloop_exam.ablations import ABLATIONS  # noqa: E402
from twinloop_exam.zoo.ablated import BY_LUCK, MEASURES, shown  # noqa: E402

PAGE = ROOT / "docs" / "options.md"
MEASURED = ROOT / "studies" / "twinloop_exam" / "zoo" / "ablations.json"
BEGINS, ENDS = "## Ablations\n", "\n```\ntwinloop run"


def measured():
    """What was measured, or None."""
    return json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.exists() else None


def table(found):
    """A row an ablation, with what it buys once that is measured."""
    rows = {} if found is None else {row["ablation"]: row for row in found["ablations"] if row["campaigns"]}
    head = ["name", "without", "set"]
    if rows:
        head += [f"{measure.text}, without / with" for measure in MEASURES]
    lines = [head, ["---"] * len(head)]
    for name, ablation in ABLATIONS.items():
        line = [f"`{name}`", ablation.without, ", ".join(f"`{each}`" for each in ablation.settings)]
        if rows:
            line += [
                ": ".join(shown(rows[name][each.name])[::-1]) if name in rows else "" for each in MEASURES
            ]
        lines.append(line)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def text(found):
    """The section, from its heading on."""
    parts = [
        BEGINS,
        "Each row switches one idea off; `twinloop bench zoo --ablation NAME` flies the zoo without it and says what it"
        " buys.\n\nAn empty list is written `libraries=`. This table is written by `scripts/ablations_page.py`.\n",
    ]
    if found is not None:
        number = max(row["campaigns"] for row in found["ablations"])
        parts.append(
            f"Measured on {number} campaigns ({found['plants']} plants, {found['seeds']} seeds) by"
            f" {', '.join(found['versions'])}: the median of without / with, above 1 where the idea is missed; the"
            " shares of campaigns that are better and worse with it; and what a paired sign test says of them at"
            f" {100.0 * BY_LUCK:g} %. An idea that acts on few plants cannot be seen by it.\n"
        )
    return "\n".join([*parts, f"{table(found)}\n"])


def page():
    """The page as it should be."""
    written = PAGE.read_text(encoding="utf-8")
    before, _, rest = written.partition(BEGINS)
    _, ends, after = rest.partition(ENDS)
    return before + text(measured()) + ends + after


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
