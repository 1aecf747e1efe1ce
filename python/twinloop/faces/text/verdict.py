"""The verdict of a campaign: a sentence on the twin, one on the controller, and what comes next."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twinloop.faces import answers
from twinloop.faces.text.table import cell
from twinloop.faces.text.words import controller_name, quality_words, with_unit


def verdict(result: Mapping[str, Any], evidence: str = "") -> str:
    """A campaign in three lines: its twin, its controller, what next.

    Args:
        result: a `twinloop.faces.result.summary`.
        evidence: what shows all checks, such as a command to type, said where one fails; empty: it is not said.

    Returns:
        Text.
    """
    where = f" All checks: {evidence}" if evidence else ""
    twin, controller = _on_twin(result), _on_controller(result)
    # Once is enough: one command shows the checks of both.
    if result["verdict"]["twin"]["good"] is False:
        twin += where
    elif result["verdict"]["controller"]["good"] is False:
        controller += where
    return f"Twin: {twin}\nController: {controller}\nNext: {_next(result)}"


def _on_twin(result: Mapping[str, Any]) -> str:
    decided = result["verdict"]["twin"]
    if not decided["good"]:
        return f"{_begun(decided)}. {_strongest(decided)}"
    worst = max(
        (run["normalised"] for run in result["experiments"] if run["normalised"] is not None), default=None
    )
    runs = len(result["experiments"])
    flights = f"{runs} flight{'s' if runs > 1 else ''}"
    error = f"normalised error of {flights} at most {cell(worst)} (0 is perfect, 1 a model that never moves)"
    return f"{_begun(decided)}; {error}."


def _on_controller(result: Mapping[str, Any]) -> str:
    best, first, decided = result["controller"], result["first_controller"], result["verdict"]["controller"]
    if best is None:
        return f"none to fly: {result['no_controller'].removeprefix('No controller to fly: ')}"
    measure = result["quality"]
    words = quality_words(measure["kind"], measure["unit"])
    found = f"measured {cell(best['measured'])}" if best["measured"] is not None else "not measured yet"
    before = "" if first is None else f"; the first one: measured {cell(first['measured'])}"
    worth = f"{controller_name(best['test'])}, {words} predicted {cell(best['predicted'])}, {found}{before}."
    # That its prediction rests on the twin, the line above has said.
    reason = f" {_strongest(decided)}" if decided["answer"] == answers.DO_NOT_FLY else ""
    return f"{_begun(decided)}; {worth}{reason}"


def _begun(decided: Mapping[str, Any]) -> str:
    """An answer within a line."""
    answer: str = decided["answer"]
    return answer[:1].lower() + answer[1:]


def _strongest(decided: Mapping[str, Any]) -> str:
    """The strongest reason, and how many there are besides."""
    first, *others = decided["reasons"]
    if not others:
        return str(first)
    are = "is 1 more reason" if len(others) == 1 else f"are {len(others)} more reasons"
    return f"{first} There {are}."


def _next(result: Mapping[str, Any]) -> str:
    answer, advice = result["verdict"]["next"]["answer"], result.get("advice")
    if answer in WORDS:
        return WORDS[answer]
    off = (result["controller"] or {}).get("off_target")
    if answer in (answers.STOP, answers.STOP_OR_OTHER_TASK):
        last = "fly this controller, then stop" if result["controller"]["measured"] is None else "stop"
        less = "another flight would bring less than the scatter of one measurement."
        return f"{last}, or change the task; {less} {off}" if off else f"{last}; {less}"
    assert advice is not None  # the answers above are those without
    if not advice["trusted"]:
        return "look into the remarks, then fly another test: the twin cannot say what it would bring."
    return f"another flight may bring {with_unit(advice['gain'], result['quality']['unit'])}."


WORDS = {
    answers.FLY_ANOTHER_CONTROLLER: "fly another controller that you trust, and look into the checks that fail.",
    answers.YOU_DECIDE: (
        "fly another test, or this controller; the preset paper does not say what a test would bring."
    ),
    answers.FIND_OUT: (
        "find out what the twin lacks, then fly another test: it cannot say yet what that would bring."
    ),
    answers.OTHER_TASK: "change the task or the controller, whose loops could not be checked.",
    answers.CALMER_CONTROLLER: (
        f"ask for a calmer controller, with {answers.CALMER}: another flight would hardly change this one."
    ),
    answers.ASK: "ask for a flight to see what it would bring.",
}
"""What comes next, for each answer that needs no number."""
