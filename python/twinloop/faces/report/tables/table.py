"""A table: rows under one heading, and how numbers are shown in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from twinloop._ground.texts import two_digits
from twinloop.faces.text import cell


@dataclass(frozen=True)
class Table:
    """Rows under one heading.

    Args:
        name: a word that does not change; links use it.
        title: for a person.
        head: of the columns.
        rows: cells as texts.
        note: below it.
        texts: columns that are read, not compared.
    """

    name: str
    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    texts: Sequence[int] = ()


def table_of(
    name: str,
    title: str,
    head: Sequence[str],
    rows: Sequence[Sequence[object]],
    note: str = "",
    texts: Sequence[int] = (),
) -> Table:
    """A table whose cells are numbers and texts.

    Args:
        name: a word that does not change; links use it.
        title: for a person.
        head: of the columns.
        rows: cells.
        note: below it.
        texts: columns that are read, not compared.
    """
    return Table(name, title, head, [[shown_value(value) for value in row] for row in rows], note, texts)


def shown_value(value: object) -> str:
    """A cell of a table: four digits, and signs as they are set."""
    if isinstance(value, float):
        return (
            ("−∞" if value < 0.0 else "∞")
            if math.isinf(value)
            else "–"
            if math.isnan(value)
            else f"{value:.4g}".replace("-", "−")
        )
    return cell(value)


def shown_spread(value: float | None) -> str | None:
    """A standard deviation, with as many digits as it is worth."""
    return None if value is None else two_digits(value)
