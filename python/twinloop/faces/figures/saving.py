"""Figures as files for a paper: SVG by itself; PNG and PDF by the package vl-convert."""

from __future__ import annotations

from typing import Any

from twinloop.errors import NotAvailable, unknown
from twinloop.faces.figures.figure import Figure
from twinloop.faces.figures.style import LIGHT
from twinloop.faces.figures.svg import drawing

FORMATS = ("svg", "pdf", "png")
SCALE = 2.0
"""Pixels of a PNG for each unit of the drawing."""


def check_format(form: str) -> None:
    """Refuses a format that there is not, or that a missing package would write.

    Args:
        form: one of `FORMATS`.

    Raises:
        InvalidInput: another one.
        NotAvailable: vl-convert is missing.
    """
    if form not in FORMATS:
        raise unknown("format of figures", form, FORMATS)
    if form != "svg":
        _converter()


def picture(figure: Figure, form: str) -> bytes:
    """A figure as the contents of a file.

    Args:
        figure: to be drawn.
        form: one of `FORMATS`.

    Raises:
        InvalidInput: another one.
        NotAvailable: vl-convert is missing.
    """
    check_format(form)
    text = drawing(figure)
    if form == "svg":
        return text.encode("utf-8")
    plain = _without_variables(text)
    found = _converter()
    return bytes(found.svg_to_pdf(plain) if form == "pdf" else found.svg_to_png(plain, scale=SCALE))


def _without_variables(text: str) -> str:
    """Colours as they are: converters do not know variables."""
    for name, value in LIGHT.items():
        text = text.replace(f"var(--{name})", value)
    return text


def _converter() -> Any:
    try:
        import vl_convert
    except ImportError as missing:
        raise NotAvailable(
            "Figures as PDF or PNG need vl-convert, which is not installed: pip install 'twinloop[paper]'; SVG needs"
            " nothing."
        ) from missing
    return vl_convert
