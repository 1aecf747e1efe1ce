"""Draws a figure as SVG: one drawing a panel for pages, or all in one for a file."""

from __future__ import annotations

import math
from collections.abc import Callable
from xml.etree import ElementTree as ET

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.faces.figures.axis import Axis, axis
from twinloop.faces.figures.figure import Band, Bars, Cells, Figure, Level, Line, Mark, Panel, Spans, numbers
from twinloop.faces.figures.style import STYLE, tint

WIDTH, HEIGHT = 380.0, 220.0
LEFT, RIGHT, TOP, BOTTOM = 58.0, 10.0, 22.0, 36.0
FINEST = 1400
"""Points of a line at most: more than the screen has columns."""
CELL = 26.0
LETTER = 6.4
"""Width of a letter of a label, about."""


def panel_svg(panel: Panel) -> str:
    """One panel as a drawing of its own, coloured by the page that it stands in.

    Args:
        panel: to be drawn.

    Returns:
        An `<svg>` element; texts in it are escaped.
    """
    return ET.tostring(_panel(panel), encoding="unicode")


def drawing(figure: Figure) -> str:
    """A whole figure as one drawing, with its style, title and legend in it.

    Args:
        figure: to be drawn.

    Returns:
        An `<svg>` element.
    """
    parts = [_panel(panel) for panel in figure.panels]
    columns = max(1, min(figure.columns, len(parts)))
    widths, heights = (max(float(part.get(side, "0")) for part in parts) for side in ("width", "height"))
    rows = -(-len(parts) // columns)
    top = 28.0 + (18.0 if figure.legend else 0.0)
    whole = _root(columns * widths, top + rows * heights, figure.title)
    ET.SubElement(whole, "style").text = STYLE
    _add(whole, "rect", {"width": _n(columns * widths), "height": _n(top + rows * heights), "class": "paper"})
    _text(whole, 10.0, 18.0, figure.title, "heading")
    _legend(whole, figure)
    for number, part in enumerate(parts):
        part.set("x", _n((number % columns) * widths))
        part.set("y", _n(top + (number // columns) * heights))
        whole.append(part)
    return ET.tostring(whole, encoding="unicode")


def _legend(whole: ET.Element, figure: Figure) -> None:
    x = 10.0
    for role, name, kind in figure.legend:
        _add(whole, "path", {"d": f"M{_n(x)} 34h18", "class": f"{role} {'key-' + kind}"})
        _text(whole, x + 23.0, 38.0, name, "tick")
        x += 38.0 + 6.2 * len(name)


def _root(width: float, height: float, title: str) -> ET.Element:
    size = {"width": _n(width), "height": _n(height), "viewBox": f"0 0 {_n(width)} {_n(height)}"}
    root = ET.Element(
        "svg", {"xmlns": "http://www.w3.org/2000/svg", **size, "role": "img", "aria-label": title}
    )
    return root


def _panel(panel: Panel) -> ET.Element:
    cells = next((mark for mark in panel.marks if isinstance(mark, Cells)), None)
    if cells is not None:
        return _table(panel, cells)
    wide, high = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    xs, ys = _axes(panel, wide, high)
    words = f"{panel.title}: {panel.y_label} against {panel.x_label}" if panel.x_label else panel.title
    root = _root(WIDTH, HEIGHT, words)
    _text(root, LEFT, 14.0, panel.title, "title")
    frame = _add(root, "g", {"transform": f"translate({_n(LEFT)} {_n(TOP)})", "class": "frame"})
    grid = _add(frame, "g", {"class": "grid"})
    _ticks(grid, xs, ys, wide, high)
    _add(frame, "path", {"d": f"M0 0V{_n(high)}H{_n(wide)}", "class": "axis"})
    shown = _add(
        frame,
        "svg",
        {
            **{"width": _n(wide), "height": _n(high), "viewBox": f"0 0 {_n(wide)} {_n(high)}"},
            **{"preserveAspectRatio": "none", "class": "plot", "overflow": "hidden"},
            **{"data-x": _ends(xs), "data-y": _ends(ys)},
        },
    )
    for mark in panel.marks:
        _DRAWN[type(mark)](shown, mark, xs, ys)
    _text(root, LEFT + wide / 2.0, HEIGHT - 5.0, panel.x_label, "label middle")
    label = _text(root, 0.0, 0.0, panel.y_label, "label middle")
    label.set("transform", f"translate(12 {_n(TOP + high / 2.0)}) rotate(-90)")
    return root


def _axes(panel: Panel, wide: float, high: float) -> tuple[Axis, Axis]:
    x_values, y_values = [], []
    for mark in panel.marks:
        x, y = _covered(mark)
        x_values += x
        y_values += y
    xs = axis(x_values, wide, panel.x_log, panel.x_range, panel.x_names, panel.whole, 5)
    ys = axis(y_values, high, panel.y_log, panel.y_range, panel.y_names)
    if not panel.equal:
        return xs, ys
    # A unit is as long on both: the axis that has room for more shows more.
    unit = max((xs.high - xs.low) / wide, (ys.high - ys.low) / high)
    middles = 0.5 * (xs.low + xs.high), 0.5 * (ys.low + ys.high)
    x_ends, y_ends = (
        (middle - 0.5 * unit * length, middle + 0.5 * unit * length)
        for middle, length in zip(middles, (wide, high), strict=True)
    )
    return axis([], wide, ends=x_ends, count=5), axis([], high, ends=y_ends)


def _covered(mark: Mark) -> tuple[list[Floats], list[Floats]]:
    """What of x and y a mark would like to be seen."""
    if isinstance(mark, Line):
        return [numbers(mark.x)], [numbers(mark.y)]
    if isinstance(mark, (Band, Spans)):
        return [numbers(mark.x)], [numbers(mark.low), numbers(mark.high)]
    if isinstance(mark, Bars):
        x, half = numbers(mark.x), 0.5 * mark.width
        return [x - half, x + half], [numbers(mark.y), np.zeros(1)]
    if isinstance(mark, Level):
        at = [np.array([mark.at])]
        return (at, []) if mark.upright else ([], at)
    return [], []


def _ticks(grid: ET.Element, xs: Axis, ys: Axis, wide: float, high: float) -> None:
    for value, words in xs.ticks:
        x = float(xs.place(np.array([value]))[0])
        _add(grid, "path", {"d": f"M{_n(x)} 0V{_n(high)}"})
        _text(grid, x, high + 14.0, words, "tick middle")
    for value, words in ys.ticks:
        y = high - float(ys.place(np.array([value]))[0])
        _add(grid, "path", {"d": f"M0 {_n(y)}H{_n(wide)}"})
        _text(grid, -6.0, y + 3.5, words, "tick end")


def _line(shown: ET.Element, mark: Line, xs: Axis, ys: Axis) -> None:
    x, y = _thinned(xs.place(numbers(mark.x)), ys.length - ys.place(numbers(mark.y)))
    faint = " faint" if mark.faint else ""
    if mark.joined:
        path = _path(*_stepped(x, y)) if mark.steps else _path(x, y)
        _series(shown, path, f"line {mark.role}{faint}", mark.name)
    if mark.dots or not mark.joined:
        there = np.isfinite(x) & np.isfinite(y)
        path = "".join(f"M{_n(a)} {_n(b)}h0" for a, b in zip(x[there], y[there], strict=True))
        _series(shown, path, f"dots {mark.role}{faint}", mark.name)


def _band(shown: ET.Element, mark: Band, xs: Axis, ys: Axis) -> None:
    x = xs.place(numbers(mark.x))
    low, high = (ys.length - ys.place(numbers(end)) for end in (mark.low, mark.high))
    there = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    x, low, high = x[there], low[there], high[there]
    if len(x):
        path = _path(np.concatenate([x, x[::-1]]), np.concatenate([high, low[::-1]])) + "Z"
        _series(shown, path, f"area {mark.role}", mark.name)


def _bars(shown: ET.Element, mark: Bars, xs: Axis, ys: Axis) -> None:
    half = 0.5 * mark.width
    x = numbers(mark.x)
    left, right = xs.place(x - half), xs.place(x + half)
    base = float(np.clip(ys.length - ys.place(np.zeros(1))[0], -1e4, 1e4)) if not ys.log else ys.length
    tops = np.clip(ys.length - ys.place(numbers(mark.y)), -1e4, 1e4)
    path = "".join(
        f"M{_n(a)} {_n(base)}V{_n(top)}H{_n(b)}V{_n(base)}Z"
        for a, b, top in zip(left, right, tops, strict=True)
        if math.isfinite(top)
    )
    _series(shown, path, f"bar {mark.role}", mark.name)


def _spans(shown: ET.Element, mark: Spans, xs: Axis, ys: Axis) -> None:
    x = xs.place(numbers(mark.x))
    low, high = (np.clip(ys.length - ys.place(numbers(end)), -1e4, 1e4) for end in (mark.low, mark.high))
    path = "".join(
        f"M{_n(a)} {_n(b)}V{_n(c)}" for a, b, c in zip(x, low, high, strict=True) if math.isfinite(b + c)
    )
    _series(shown, path, f"line {mark.role}", "")


def _level(shown: ET.Element, mark: Level, xs: Axis, ys: Axis) -> None:
    along = xs if mark.upright else ys
    at = float(along.place(np.array([mark.at]))[0])
    path = f"M{_n(at)} 0V{_n(ys.length)}" if mark.upright else f"M0 {_n(ys.length - at)}H{_n(xs.length)}"
    _add(shown, "path", {"d": path, "class": f"line {mark.role} level"})


_DRAWN: dict[type, Callable[[ET.Element, object, Axis, Axis], None]] = {
    Line: _line,  # type: ignore[dict-item]
    Band: _band,  # type: ignore[dict-item]
    Bars: _bars,  # type: ignore[dict-item]
    Spans: _spans,  # type: ignore[dict-item]
    Level: _level,  # type: ignore[dict-item]
}


def _table(panel: Panel, cells: Cells) -> ET.Element:
    left = 14.0 + LETTER * max((len(name) for name in cells.rows), default=4)
    size = max(58.0, (WIDTH - left - RIGHT) / max(1, len(cells.columns)))
    size = min(size, 96.0)
    top = 44.0
    width = max(WIDTH, left + size * len(cells.columns) + RIGHT)
    root = _root(width, top + CELL * len(cells.rows) + 26.0, panel.title)
    _text(root, 8.0, 14.0, panel.title, "title")
    for j, name in enumerate(cells.columns):
        _text(root, left + (j + 0.5) * size, top - 6.0, name, "tick middle")
    for i, name in enumerate(cells.rows):
        _text(root, left - 6.0, top + (i + 0.5) * CELL + 3.5, name, "tick end")
        for j, words in enumerate(cells.texts[i]):
            value = float(cells.values[i, j])
            if not words:
                continue
            framed = " framed" if (i, j) in cells.marked else ""
            place = {"x": _n(left + j * size + 1.0), "y": _n(top + i * CELL + 1.0)}
            fill = {"fill": tint(value)} if math.isfinite(value) else {}
            box = {"width": _n(size - 2.0), "height": _n(CELL - 2.0), "class": f"cell{framed}", **fill}
            _add(root, "rect", {**place, **box})
            dark = "on-dark" if math.isfinite(value) and value > 0.5 else "on-light"
            _text(root, left + (j + 0.5) * size, top + (i + 0.5) * CELL + 3.5, words, f"tick middle {dark}")
    middle = left + 0.5 * size * len(cells.columns)
    _text(
        root,
        max(middle, 8.0 + 0.5 * LETTER * len(panel.x_label)),  # under few columns it would begin outside
        top + CELL * len(cells.rows) + 18.0,
        panel.x_label,
        "label middle",
    )
    return root


def _thinned(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """At most `FINEST` points, the least and the most of each stretch and its first gap among them."""
    if len(x) <= FINEST:
        return x, y
    kept = []
    for part in np.array_split(np.arange(len(x)), FINEST // 2):
        there = part[np.isfinite(y[part])]
        ends = {int(there[np.argmin(y[there])]), int(there[np.argmax(y[there])])} if len(there) else set()
        kept += sorted(ends | {int(gap) for gap in part[~np.isfinite(y[part])][:1]})
    return x[kept], y[kept]


def _stepped(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    return np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]


def _path(x: Floats, y: Floats) -> str:
    """A path; far outside of the panel it is cut, so that no number is without end."""
    x, y = np.clip(x, -1e4, 1e4), np.clip(y, -1e4, 1e4)
    words, pen = [], "M"
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if math.isfinite(a) and math.isfinite(b):
            words.append(f"{pen}{_n(a)} {_n(b)}")
            pen = "L"
        else:
            pen = "M"
    return "".join(words)


def _series(shown: ET.Element, path: str, role: str, name: str) -> None:
    if path:
        named = {"data-name": name} if name else {}
        _add(shown, "path", {"d": path, "class": role, **named})


def _add(parent: ET.Element, tag: str, attributes: dict[str, str]) -> ET.Element:
    return ET.SubElement(parent, tag, attributes)


def _text(parent: ET.Element, x: float, y: float, words: str, role: str) -> ET.Element:
    found = _add(parent, "text", {"x": _n(x), "y": _n(y), "class": role})
    found.text = words
    return found


def _ends(one: Axis) -> str:
    return f"{one.low!r} {one.high!r} {int(one.log)}"


def _n(value: float) -> str:
    """A number of the drawing, to a tenth."""
    return f"{value:.1f}".removesuffix(".0")
