"""Values that show themselves in a notebook; what draws them stands above them, and is loaded when one is shown."""

from __future__ import annotations

from importlib import import_module


class Shown:
    """A value that a notebook shows as HTML."""

    def _repr_html_(self) -> str:
        text: str = import_module("twinloop.faces.notebook").html(self)
        return text
