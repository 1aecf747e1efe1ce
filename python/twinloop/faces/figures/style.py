"""Colours that people with any eyes tell apart (Okabe and Ito 2008), on light and on dark; the style of marks."""

from __future__ import annotations

LIGHT = {
    "paper": "#ffffff", "ink": "#1c2126", "soft": "#57606a", "grid": "#e6e9ed", "edge": "#8c959f",
    "measured": "#1c2126", "twin": "#0072b2", "target": "#57606a", "limit": "#a33f00", "old": "#8a5a00",
    "worst": "#a33f00", "a": "#0072b2", "b": "#b84d00", "c": "#00785a", "d": "#a2427b", "e": "#7a6100", "f": "#2b7fb0",
}  # fmt: skip
DARK = {
    "paper": "#14181d", "ink": "#e8ebee", "soft": "#a5aeb8", "grid": "#2a3038", "edge": "#6c7681",
    "measured": "#f2f4f6", "twin": "#56b4e9", "target": "#a5aeb8", "limit": "#ff8c4a", "old": "#e69f00",
    "worst": "#ff8c4a", "a": "#56b4e9", "b": "#e69f00", "c": "#2fc79d", "d": "#e493c0", "e": "#f0e442", "f": "#7fb8e6",
}  # fmt: skip
"""Okabe and Ito's hues; darker on white where their own would not be read there (WCAG 2.2, 1.4.11)."""
MARKS = ("measured", "twin", "target", "limit", "old", "worst", "a", "b", "c", "d", "e", "f")
DASHES = {
    "target": "2 3",
    "limit": "6 3",
    "old": "7 3 2 3",
    "worst": "6 3",
    "b": "7 3",
    "c": "2 2",
    "d": "9 3 2 3",
    "e": "4 2",
}


def variables(colours: dict[str, str]) -> str:
    """Colours as CSS variables.

    Args:
        colours: by name.
    """
    return "".join(f"--{name}:{value};" for name, value in colours.items())


def tint(value: float) -> str:
    """A shade of one hue, from light at 0 to dark at 1, the same on light and dark pages.

    Args:
        value: between 0 and 1.
    """
    share = min(1.0, max(0.0, value))
    ends = (0xEA, 0xF3, 0xFA), (0x00, 0x3A, 0x5D)
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in zip(*ends, strict=True))


_SHAPES = """
svg text{font-family:system-ui,-apple-system,"Segoe UI",Roboto,"Noto Sans",sans-serif;fill:var(--ink);font-size:11px}
svg .title{font-size:12px;font-weight:600}
svg .heading{font-size:14px;font-weight:600}
svg .tick{fill:var(--soft);font-size:10.5px}
svg .label{fill:var(--soft)}
svg .middle{text-anchor:middle}
svg .end{text-anchor:end}
svg .paper{fill:var(--paper)}
svg .grid path{stroke:var(--grid);stroke-width:1;fill:none}
svg .axis{stroke:var(--edge);stroke-width:1;fill:none}
svg .line{fill:none;stroke-width:1.6;stroke-linejoin:round;vector-effect:non-scaling-stroke}
svg .level{stroke-width:1}
svg .dots{fill:none;stroke-width:5;stroke-linecap:round;vector-effect:non-scaling-stroke}
svg .faint{opacity:.45}
svg .area{stroke:none;fill-opacity:.2}
svg .bar{stroke:none;fill-opacity:.8}
svg .cell{stroke:none}
svg .framed{stroke:var(--limit);stroke-width:2.5}
svg .on-light{fill:#14181d}
svg .on-dark{fill:#ffffff}
svg .key-line{fill:none;stroke-width:2}
svg .key-dots{fill:none;stroke-width:6;stroke-linecap:round;stroke-dasharray:.1 8}
svg .key-area{fill:none;stroke-width:9;stroke-opacity:.35}
"""


def _roles() -> str:
    found = []
    for name in MARKS:
        found.append(
            f"svg .{name}{{stroke:var(--{name})}}svg .area.{name},svg .bar.{name}{{fill:var(--{name})}}"
        )
        if name in DASHES:
            found.append(f"svg .line.{name},svg .key-line.{name}{{stroke-dasharray:{DASHES[name]}}}")
    return "\n".join(found)


SCROLL = """
.scroll{overflow-x:auto;background:
linear-gradient(90deg,var(--under,var(--paper)) 50%,transparent) 0 0/1.6rem 100% no-repeat local,
linear-gradient(-90deg,var(--under,var(--paper)) 50%,transparent) calc(100% + 1px) 0/1.6rem 100% no-repeat local,
linear-gradient(90deg,color-mix(in srgb,var(--ink) 30%,transparent),transparent) 0 0/.8rem 100% no-repeat,
linear-gradient(-90deg,color-mix(in srgb,var(--ink) 30%,transparent),transparent) 100% 0/.8rem 100% no-repeat,
var(--under,var(--paper))}
"""
"""What is wider than its page: an edge beyond which it goes on is shaded, and covered where it ends there."""

RULES = (
    _SHAPES
    + _roles()
    + "\nsvg .area,svg .bar{stroke:none}\nsvg .measured.line{stroke-width:3.6;opacity:.42}\n"
)
"""How marks look, in colours that are variables."""
STYLE = f"svg{{{variables(LIGHT)}}}{RULES}"
"""The same for a drawing that stands alone, on white."""
