"""What a sweep came to: one row a group of campaigns that differ by their seed alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from twinloop.campaign import Campaign
from twinloop.faces.text import table
from twinloop.sweep.campaigns import Outcome

QUARTERS = (0.25, 0.5, 0.75)


def summarised(outcomes: Iterable[Outcome]) -> list[dict[str, Any]]:
    """One row a group: its campaigns, and quartiles over them.

    Args:
        outcomes: of a sweep, in any order.

    Returns:
        Rows in the order of their names: `campaigns` that were flown, `failed`, quartiles of the `best` quality flown,
        of the error `before` learning of the last run, both None where nobody knows, of `seconds`, and how many
        experiments `left` the envelope.
    """
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.job.group, []).append(outcome)
    return [_row(name, groups[name]) for name in sorted(groups)]


def _row(name: str, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    flown = [outcome.campaign for outcome in outcomes if outcome.campaign is not None]
    return {
        "group": name,
        "campaigns": len(flown),
        "failed": len(outcomes) - len(flown),
        "best": _quartiles([best_flown(campaign) for campaign in flown]),
        "before": _quartiles([_before(campaign) for campaign in flown]),
        "left": sum(run.left_envelope for campaign in flown for run in campaign.experiments),
        "seconds": _quartiles([outcome.seconds for outcome in outcomes if outcome.campaign is not None]),
    }


def best_flown(campaign: Campaign) -> float | None:
    """The best quality that was measured on a run that kept the envelope; None where there was none.

    Args:
        campaign: with its experiments.
    """
    return min(
        (run.quality for run in campaign.experiments if run.quality is not None and run.kept_envelope),
        default=None,
    )


def _before(campaign: Campaign) -> float | None:
    """The error on its last run of the twin that had not learnt it, over that of a model that never moves."""
    known = [run for run in campaign.experiments if run.before is not None and run.frozen > 0.0]
    return known[-1].before / known[-1].frozen if known and known[-1].before is not None else None


def _quartiles(values: Iterable[float | None]) -> list[float] | None:
    known = sorted(value for value in values if value is not None)
    return [_quantile(known, share) for share in QUARTERS] if known else None


def _quantile(known: Sequence[float], share: float) -> float:
    """A quantile between ranks (method 7 of Hyndman and Fan 1996), where some values may be infinite.

    A twin that diverged left an infinite error: between it and a finite one everything is infinite.
    """
    place = share * (len(known) - 1)
    below, part = math.floor(place), place % 1.0
    if part == 0.0 or known[below] == known[below + 1]:
        return known[below]
    return known[below] + part * (known[below + 1] - known[below])


def as_text(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as a table.

    Args:
        rows: of `summarised`.
    """
    head = ["campaigns", "flown", "failed", "best flown", "error before learning", "left envelope", "seconds"]
    cells = [
        [
            row["group"], row["campaigns"], row["failed"], _cell(row["best"]), _cell(row["before"]), row["left"],
            _cell(row["seconds"]),
        ]
        for row in rows
    ]  # fmt: skip
    return table(head, cells) + "\nMedians over seeds, [quartiles].\n"


def _cell(quartiles: Sequence[float] | None) -> str:
    if quartiles is None:
        return "–"
    low, middle, high = quartiles
    return f"{middle:.4g} [{low:.4g}, {high:.4g}]"
