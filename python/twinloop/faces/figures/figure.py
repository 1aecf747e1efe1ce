"""What a figure shows, as plain values: panels with marks in data's own units; nothing here knows how it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats
from twinloop._ground.writing import write_whole

ROLES = ("measured", "twin", "target", "limit", "old", "worst", "a", "b", "c", "d", "e", "f")
"""What a mark stands for; each has its own colour and dash, the same in all figures."""


@dataclass(frozen=True, eq=False)
class Line:
    """Points joined in their order; a gap where one is not finite.

    Args:
        x: (n,).
        y: (n,).
        role: one of `ROLES`.
        name: for the legend; "" where it has none.
        dots: whether points are drawn, too.
        joined: whether they are joined.
        steps: whether each value is held until the next.
        faint: whether it stands back.
    """

    x: ArrayLike
    y: ArrayLike
    role: str
    name: str = ""
    dots: bool = False
    joined: bool = True
    steps: bool = False
    faint: bool = False


@dataclass(frozen=True, eq=False)
class Band:
    """What lies between two curves.

    Args:
        x: (n,).
        low: (n,).
        high: (n,).
        role: one of `ROLES`.
        name: for the legend.
    """

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    role: str
    name: str = ""


@dataclass(frozen=True, eq=False)
class Bars:
    """Upright bars from 0, or from a base.

    Args:
        x: middles (n,).
        y: heights (n,).
        role: one of `ROLES`.
        name: for the legend.
        width: in units of x.
    """

    x: ArrayLike
    y: ArrayLike
    role: str
    name: str = ""
    width: float = 0.6


@dataclass(frozen=True, eq=False)
class Spans:
    """Upright lines between two ends, such as error bars.

    Args:
        x: (n,).
        low: (n,).
        high: (n,).
        role: one of `ROLES`.
    """

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    role: str


@dataclass(frozen=True, eq=False)
class Level:
    """A straight line across the panel.

    Args:
        at: its value.
        role: one of `ROLES`.
        name: for the legend.
        upright: whether it stands at an x.
    """

    at: float
    role: str
    name: str = ""
    upright: bool = False


@dataclass(frozen=True, eq=False)
class Cells:
    """A table of shaded cells.

    Args:
        values: (rows, columns), from 0, light, to 1, dark; NaN: empty.
        texts: what stands in each cell.
        rows: names, the uppermost first.
        columns: names.
        marked: cells with a frame (row, column).
    """

    values: Floats
    texts: Sequence[Sequence[str]]
    rows: Sequence[str]
    columns: Sequence[str]
    marked: Sequence[tuple[int, int]] = ()


Mark = Line | Band | Bars | Spans | Level | Cells


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes.

    Args:
        title: above it.
        marks: in the order they are drawn.
        x_label: with its unit.
        y_label: with its unit.
        x_log: whether x is on a logarithmic scale.
        y_log: whether y is.
        x_range: ends of x; None: of what is drawn.
        y_range: ends of y; None: of what is drawn.
        x_names: instead of numbers, at 0, 1, 2 and so on.
        y_names: the same, upwards.
        equal: whether a unit of x is as long as one of y.
        whole: whether x is counted.
    """

    title: str
    marks: Sequence[Mark]
    x_label: str = ""
    y_label: str = ""
    x_log: bool = False
    y_log: bool = False
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    x_names: Sequence[str] = ()
    y_names: Sequence[str] = ()
    equal: bool = False
    whole: bool = False


@dataclass(frozen=True, eq=False)
class Figure:
    """Panels that belong together.

    Args:
        name: a word that does not change; files and links use it.
        title: for a person.
        panels: at least one.
        caption: what is to be seen, in sentences.
        columns: in which panels stand where there is room.
        rows: whether panels of a row belong together, so that the next row begins on a line of its own.
    """

    name: str
    title: str
    panels: Sequence[Panel]
    caption: str = ""
    columns: int = 3
    rows: bool = False

    @property
    def legend(self) -> list[tuple[str, str, str]]:
        """Role, name and kind of each mark that has a name, once."""
        found: dict[tuple[str, str], str] = {}
        for panel in self.panels:
            for mark in panel.marks:
                name = getattr(mark, "name", "")
                if name:
                    found.setdefault((mark.role, name), _kind(mark))  # type: ignore[union-attr]
        return [(role, name, kind) for (role, name), kind in found.items()]

    def _repr_svg_(self) -> str:
        from twinloop.faces.figures.svg import drawing

        return drawing(self)

    def save(self, path: str | Path) -> None:
        """Writes it for a paper.

        Args:
            path: that ends in ".svg", ".pdf" or ".png".

        Raises:
            InvalidInput: another ending, or a file that cannot be written.
            NotAvailable: PDF or PNG, and vl-convert is missing.
        """
        from twinloop.faces.figures.saving import FORMATS, picture
        from twinloop.faces.files import check_writable

        where = Path(path)
        check_writable(where, [f".{form}" for form in FORMATS])
        write_whole(where, picture(self, where.suffix.lower()[1:]))


def _kind(mark: Mark) -> str:
    if isinstance(mark, Line) and not mark.joined:
        return "dots"
    return "area" if isinstance(mark, (Band, Bars)) else "line"


def numbers(values: ArrayLike) -> Floats:
    """Values as an array of floats."""
    return np.asarray(values, dtype=np.float64)


@dataclass(frozen=True)
class Section:
    """Figures and tables under one heading; an empty one is not shown."""

    name: str
    title: str
    figures: Sequence[Figure] = field(default_factory=tuple)
