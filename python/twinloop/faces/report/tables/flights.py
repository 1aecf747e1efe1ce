"""Tables of the flights: what was predicted and flown, and how good their data are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twinloop.campaign.examination.examination import Examination
from twinloop.faces.figures.units import words
from twinloop.faces.report.tables.table import Table, shown_spread, table_of
from twinloop.faces.text import counted, predicted_flights, quality_words
from twinloop.planning.leaving import short_risk


def flights(found: Examination, result: Mapping[str, Any]) -> Table:
    """Predicted and flown, with the reason of each."""
    rows = [
        [
            name, run["predicted"], shown_spread(run.get("spread")), run["measured"],
            run.get("predicted_minus_measured"),
            short_risk(run.get("risk"), predicted_flights(result)),
            run.get("why") or ("" if run["test"] is None else "Gains of your own."),
        ]
        for name, run in zip(found.names, result["experiments"], strict=True)
    ]  # fmt: skip
    measure = result["quality"]
    unit = f" ({measure['unit']})" if measure["unit"] else ""
    head = ["flight", f"predicted{unit}", f"± spread{unit}", f"flown{unit}", f"predicted − flown{unit}",
            "risk", "why"]  # fmt: skip
    note = (
        f"Quality: {quality_words(measure['kind'], measure['unit'])}; lower is better. What counts: {counted(measure)}."
        " The prediction and its spread were made before the flight."
    )
    return table_of("flights-table", "Flights", head, rows, note, texts=(6,))


def data(found: Examination) -> Table:
    """Data quality, flight by flight."""
    rows = [
        [name, each.seconds, each.ended,
         None if each.moved is None else f"{each.moved:.3g} ({words(each.least)})", 100.0 * each.saturated,
         None if each.large is None else 100.0 * each.large, None if each.usage is None else 100.0 * each.usage,
         each.fingerprint]
        for name, each in zip(found.names, found.data, strict=True)
    ]  # fmt: skip
    head = [
        "flight",
        "length (s)",
        "ended",
        "least moved (noise σ)",
        "at a bound (%)",
        "beyond 3 σ (%)",
        "envelope (%)",
        "SHA-256 of the data",
    ]
    note = (
        "Least moved: the state that moved least, in standard deviations of its sensor; below about 10 little can"
        " be learnt about it. Beyond 3 σ: innovations; 0.3 % are expected of noise. The last column begins the SHA-256"
        " of times, states and commands as little-endian doubles."
    )
    return table_of("data", "Data, flight by flight", head, rows, note)
