"""What the campaign has cost, as a table of the report and as a sentence of the text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twinloop._ground.texts import in_unit
from twinloop.campaign.remaining import duration
from twinloop.faces.report.tables.table import Table, shown_value
from twinloop.faces.text.words import is_bounded


def cost_table(result: Mapping[str, Any], elapsed: float | None) -> Table:
    """A row for each thing that was spent.

    Args:
        result: of the campaign.
        elapsed: seconds until the last `tell`; None if unknown.
    """
    cost, unit, bounded = result["cost"], result["quality"]["unit"], is_bounded(result)
    rows = [
        ["runs on the system", str(cost["runs"])],
        ["of these cut, failed", f"{cost['cut']}, {cost['failed']}"],
        ["recorded flight time", f"{cost['seconds']:.4g} s"],
        ["runs that left the envelope", str(cost["left"]) if bounded else "–"],
        [
            "largest use of the envelope",
            f"{100.0 * cost['usage']:.3g} %" if bounded else "none declared",
        ],
    ]
    if cost["attached"]:
        rows.insert(2, ["attached flights, not planned here", str(cost["attached"])])
    if cost.get("withdrawn"):
        rows.insert(2, ["flights that were withdrawn", str(cost["withdrawn"])])
    if cost["abandoned"]:
        rows.insert(2, ["tests that were not flown", str(cost["abandoned"])])
    if cost["given_away"] is not None:
        given, best = (in_unit(shown_value(cost[name]), unit) for name in ("given_away", "best"))
        rows.append(["cumulative regret", f"{given} over a best of {best}"])
    if elapsed is not None:
        rows.append(["elapsed time to the last recorded flight", duration(elapsed)])
    note = (
        "Regret: how much worse than the best run the other complete runs of the task were, summed."
        if (cost["given_away"] is not None)
        else ""
    )
    if elapsed is not None:
        note += " Elapsed time includes learning, planning, flying and pauses."
    return Table("cost", "Cost of the campaign", ["spent", "how much"], rows, note.strip(), texts=(1,))
