"""What `campaign.plot` is: a picture of all flights when it is called, and every figure of the report by its name."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from twinloop.campaign import Campaign
from twinloop.faces.figures.catalogue import FIGURES, asked
from twinloop.faces.figures.figure import Figure
from twinloop.planning.quality import quality_unit


class Plots:
    """Figures of a campaign: `campaign.plot.unseen()`, `campaign.plot.bode().save("bode.pdf")`.

    Args:
        campaign: with at least one run, when a figure is asked for.
    """

    def __init__(self, campaign: Campaign) -> None:
        self._campaign = campaign

    def __call__(self, path: str | Path) -> None:
        """Draws every state of every flight, flown and predicted, above the errors and qualities by experiment.

        Args:
            path: of the picture, .svg or .png.

        Raises:
            InvalidInput: another suffix, or a file that cannot be written.
            NotAvailable: matplotlib is missing, or nothing was told.
        """
        from twinloop.faces import files, plots, text

        files.check_picture(Path(path))
        quality = self._campaign.setup.quality
        words = text.quality_words(quality.kind, quality_unit(quality))
        plots.campaign_picture(self._campaign, Path(path), words)

    def __getattr__(self, name: str) -> Callable[[], Figure]:
        if name not in FIGURES:
            raise AttributeError(f"expected a figure, one of {', '.join(FIGURES)}, found {name!r}")
        return lambda: asked(self._campaign.examine(), name)

    def __repr__(self) -> str:
        """Which figures there are, and how they are asked for."""
        return f"Figures of {self._campaign!r}, such as campaign.plot.unseen(): {', '.join(FIGURES)}."

    def __dir__(self) -> Iterable[str]:
        return [*super().__dir__(), *FIGURES]
