"""Results as text for a terminal: equations, gains, errors, and the best controller beside the first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Columns of text, the first to the left, the others to the right.

    Args:
        head: title of each column.
        rows: cells; a float gets four digits, None a dash.

    Returns:
        Lines of equal width.
    """
    cells = [list(head), *[[cell(value) for value in row] for row in rows]]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    lines = [
        "  ".join(
            text.ljust(width) if i == 0 else text.rjust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in cells
    ]
    lines.insert(1, "  ".join("─" * width for width in widths))
    return "\n".join(line.rstrip() for line in lines)


def cell(value: object) -> str:
    """A value as it appears in a table."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def render(result: Mapping[str, Any]) -> str:
    """The result of a campaign, for a person.

    Args:
        result: a `twinloop.result.summary`.

    Returns:
        Text.
    """
    parts = [_title(result), _twin(result), _errors(result), _controller(result), _remarks(result)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _title(result: Mapping[str, Any]) -> str:
    runs = len(result["experiments"])
    state = "interrupted, best so far" if result["interrupted"] else "finished"
    flown = f"{runs} experiment{'s' if runs != 1 else ''}"
    return (
        f"{result['system']['name']}, preset {result['preset']}, seed {result['seed']}: {state} after {flown}"
    )


def _twin(result: Mapping[str, Any]) -> str:
    return "TWIN\n" + "\n".join(result["twin"]["equations"])


def _errors(result: Mapping[str, Any]) -> str:
    head = [
        "test",
        "ended",
        "open loop",
        "closed loop",
        "normalised",
        "before learning",
        "predicted δ",
        "measured δ",
    ]
    keys = ("test", "ended", "open_loop", "closed_loop", "normalised", "before", "predicted", "measured")
    rows = [[run[key] for key in keys] for run in result["experiments"]]
    note = (
        "Errors are mean squares over steps and states, SI units; normalised: 1 is a model that never"
        " moves.\nδ is the distance of the last state to the target."
    )
    return "ERRORS OF THE TWIN, ONE ROW A TEST\n" + table(head, rows) + "\n" + note


def _controller(result: Mapping[str, Any]) -> str:
    best, first = result["controller"], result["first_controller"]
    rows = [
        [
            gain["name"],
            gain["value"],
            first["gains"][gain["name"]],
            gain["unit"],
            f"{gain['low']:g} to {gain['high']:g}",
        ]
        for gain in best["gains"]
    ]
    measured, reference = best["measured"], first["measured"]
    quality = (
        f"Final distance on the system: {cell(measured)}; first controller: {cell(reference)}; "
        f"doing nothing: {result['task']['distance']:.4g}; predicted by the twin: {cell(best['predicted'])}."
    )
    title = f"BEST CONTROLLER FLOWN: TEST {best['test']}"
    return f"{title}\n{table(['gain', 'value', 'first', 'unit', 'bounds'], rows)}\n{quality}"


def _remarks(result: Mapping[str, Any]) -> str:
    remarks = []
    last = result["iterations"][-1]
    flat = [loop["test"] for iteration in result["iterations"] for loop in iteration["asked"] if loop["flat"]]
    if flat:
        remarks.append(
            f"The best model ignored the commands when test{'s' if len(flat) > 1 else ''} "
            f"{', '.join(str(test) for test in flat)} {'were' if len(flat) > 1 else 'was'} chosen."
        )
    capped = sum(iteration["capped_generations"] for iteration in result["iterations"])
    if capped:
        remarks.append(f"The non-dominated set was at its cap in {capped} generations.")
    poor = [
        run["test"] for run in result["experiments"] if run["normalised"] is None or run["normalised"] > 1.0
    ]
    if poor:
        remarks.append(
            f"On test{'s' if len(poor) > 1 else ''} {', '.join(str(test) for test in poor)} the twin is no"
            " better than a model that never moves: give it more generations."
        )
    remarks.append(
        f"Iteration {last['iteration']}, {last['generations']} generations, {last['archive_size']}"
        f" non-dominated models, {100 * last['intron_share']:.0f} % introns, {last['evaluations']}"
        f" evaluations, {last['spared']} spared."
    )
    seconds = result["run_info"].get("seconds")
    if isinstance(seconds, float):
        remarks.append(f"{seconds:.1f} s on {result['run_info']['threads']} threads.")
    return "\n".join(remarks)
