"""Writes the tables of docs/options.md out of the options' code: python scripts/options_page.py."""

from pathlib import Path

from docstrings import cell, code, doc_of, python, table

from twinloop.campaign.presets import CHOICES, PRESETS, RANGES
from twinloop.options import IdentificationOptions, PlanningOptions

PAGE = Path(__file__).parents[1] / "docs" / "options.md"
TABLES = {
    "How a twin is learnt": IdentificationOptions,
    "How tests are chosen and gains tuned": PlanningOptions,
}
"""Options of the preset `default`, by the headings above their tables."""


def options_table(cls, preset):
    """Name, type, default, range and meaning of each option that a class describes."""
    rows = []
    for name, meaning in doc_of(cls.__doc__).arguments.items():
        kind = str(cls.__dataclass_fields__[name].type)
        default = f"`{python(getattr(PRESETS[preset], name))}`"
        rows.append((code(name), code(kind), default, span(preset, name, kind), cell(meaning)))
    return table(("option", "type", "default", "range", ""), rows)


def span(preset, name, kind):
    """What an option may be; nothing where its type says all."""
    if name in CHOICES[preset]:
        several = "any of " if kind.startswith("tuple") else ""
        return several + ", ".join(f"`{each}`" for each in CHOICES[preset][name])
    low, high = RANGES[preset].get(name, (None, None))
    return (
        ""
        if low is None
        else f"{low:g} to {high:g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")
    )


def page():
    """The page as it should be: what people wrote, then the tables."""
    text = PAGE.read_text(encoding="utf-8")
    parts = [text[: text.index(f"## {next(iter(TABLES))}\n")].rstrip()]
    for heading, cls in TABLES.items():
        parts += [f"## {heading}", *options_table(cls, "default")]
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
