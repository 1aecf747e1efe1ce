"""Reporting: the result of a campaign as text or as a page; what shows it stands above and is loaded when asked."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twinloop._ground.writing import write_whole

if TYPE_CHECKING:
    from twinloop.campaign.campaign import Campaign
    from twinloop.faces.figures.plots import Plots


def reported(campaign: Campaign, to: str | Path | None, name: str) -> str:
    """The whole result, as `Campaign.report` describes it."""
    if to is None:
        result = _face("result").summary(campaign, {"name": name}, {})
        text: str = _face("text").render(result, evidence="print(campaign.checks())")
        return text
    path = Path(to)
    _face("files").check_writable(path, [".html"])
    page: str = _face("report.page").report_page(campaign, name, {"name": name}, {})
    write_whole(path, page)
    return page


def plots(campaign: Campaign) -> Plots:
    """Figures by name, as `Campaign.plot` describes them."""
    found: Plots = _face("figures.plots").Plots(campaign)
    return found


def _face(name: str) -> Any:
    return import_module(f"twinloop.faces.{name}")
