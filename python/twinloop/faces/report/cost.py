"""What the campaign has cost, as a table of the report and as a sentence of the text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twinloop.campaign.remaining import duration
from twinloop.faces.report.tables.table import Table, shown_value


def cost_table(result: Mapping[str, Any], elapsed: float | None) -> Table:
    """A row for each thing that was spent.

    Args:
        result: of the campaign.
        elapsed: seconds until the last `tell`; None if unknown.
    """
    cost, unit = result["cost"], result["quality"]["unit"]
    rows = [
        ["runs on the system", str(cost["runs"])],
        ["of these cut, failed", f"{cost['cut']}, {cost['failed']}"],
        ["flight that was recorded", f"{cost['seconds']:.4g} s"],
        ["runs that left the envelope", str(cost["left"])],
        [
            "most of the envelope that any used",
            f"{100.0 * cost['usage']:.3g} %" if cost["usage"] else "none declared",
        ],
    ]
    if cost["attached"]:
        rows.insert(1, ["flights that nobody asked for", str(cost["attached"])])
    if cost["abandoned"]:
        rows.insert(1, ["tests that were not flown", str(cost["abandoned"])])
    if cost["given_away"] is not None:
        given = f"{shown_value(cost['given_away'])} {unit}".rstrip()
        rows.append(
            ["quality given away", f"{given} over a best of {shown_value(cost['best'])} {unit}".rstrip()]
        )
    if elapsed is not None:
        rows.append(["from its beginning to the last flight told", duration(elapsed)])
    note = (
        "Given away: by how much all other complete runs of the task were worse than the best one, together."
        if (cost["given_away"] is not None)
        else ""
    )
    if elapsed is not None:
        note += " The time on the clock holds learning, planning, flying and all that lay between."
    return Table("cost", "What it cost", ["spent", "how much"], rows, note.strip(), texts=(1,))
