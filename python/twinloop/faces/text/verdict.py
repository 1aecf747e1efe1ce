"""The verdict of a campaign: a sentence on the twin, one on the controller, and what comes next."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twinloop.faces.text.table import cell
from twinloop.faces.text.words import controller_name, quality_words, with_unit


def verdict(result: Mapping[str, Any]) -> str:
    """A campaign in three lines: its twin, its controller, what next.

    Args:
        result: a `twinloop.faces.result.summary`.

    Returns:
        Text.
    """
    return f"Twin: {_verdict_on_twin(result)}\nController: {_verdict_on_controller(result)}\nNext: {_next(result)}"


def _verdict_on_twin(result: Mapping[str, Any]) -> str:
    remarks = result["twin"].get("remarks", ())
    grave = [
        remark["sentence"]
        for remark in remarks
        if isinstance(remark, dict) and remark["severity"] == "serious"
    ]
    if grave:
        others = len(grave) - 1
        more = f" There {'is' if others == 1 else 'are'} {others} more serious remark{'s' * (others > 1)}."
        more = more if others else ""
        return f"not reliable yet. {grave[0]}{more}"
    worst = max(
        (run["normalised"] for run in result["experiments"] if run["normalised"] is not None), default=None
    )
    runs = len(result["experiments"])
    flights = f"{runs} flight{'s' if runs > 1 else ''}"
    return f"normalised error of {flights} at most {cell(worst)} (0 is perfect, 1 a model that never moves)."


def _verdict_on_controller(result: Mapping[str, Any]) -> str:
    best, first = result["controller"], result["first_controller"]
    if best is None:
        return f"none to fly: {result['no_controller'].removeprefix('No controller to fly: ')}"
    measure = result["quality"]
    words = quality_words(measure["kind"], measure["unit"])
    found = f"measured {cell(best['measured'])}" if best["measured"] is not None else "not measured yet"
    before = "" if first is None else f"; the first one: measured {cell(first['measured'])}"
    return f"{controller_name(best['test'])}, {words} predicted {cell(best['predicted'])}, {found}{before}."


def _next(result: Mapping[str, Any]) -> str:
    advice = result.get("advice")
    if result["controller"] is None:
        return "fly another controller that you trust, and look into the remarks."
    if advice is None:
        return "fly another test, or this controller; the preset paper does not say what a test would bring."
    if advice["gain"] is None or (advice["trusted"] and advice["stop"] is None):
        return "ask for a flight to see what it would bring."
    if not advice["trusted"]:
        return "look into the remarks, then fly another test: the twin cannot say what it would bring."
    if advice["stop"]:
        last = "fly this controller, then stop" if result["controller"]["measured"] is None else "stop"
        less = "another flight would bring less than the scatter of one measurement."
        off = result["controller"].get("off_target")
        return f"{last}, or change the task; {less} {off}" if off else f"{last}; {less}"
    return f"another flight may bring {with_unit(advice['gain'], result['quality']['unit'])}."
