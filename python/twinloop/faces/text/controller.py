"""The controller of a campaign as text: gains, what it was chosen for, what another experiment would bring."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twinloop._ground.texts import two_digits
from twinloop.faces import answers
from twinloop.faces.text.table import cell, table
from twinloop.faces.text.words import held_at, is_bounded, predicted_flights, with_unit
from twinloop.planning.leaving import risk_of_what, risk_words


def _gains(best: Mapping[str, Any], first: Mapping[str, Any] | None) -> list[list[object]]:
    """A row a gain, but for those that are absent: name, value, the first controller's, unit, bounds."""
    return [
        [
            gain["name"],
            gain["value"],
            None if first is None else first["gains"][gain["name"]],
            gain["unit"],
            "fixed"
            if gain["low"] is None
            else f"{gain['low']:g} to {gain['high']:g}" + (f", {held_at(gain)}" if held_at(gain) else ""),
        ]
        for gain in best["gains"]
        if not _absent(gain)
    ]


def _absent(gain: Mapping[str, Any]) -> bool:
    """Whether a gain is fixed at 0: of a full state feedback most are often declared so."""
    return gain["low"] is None and gain["value"] == 0.0


def _table(best: Mapping[str, Any], first: Mapping[str, Any] | None) -> str:
    """The gains, with how many are left out."""
    absent = sum(_absent(gain) for gain in best["gains"])
    said = f"\n{absent} {'gain' if absent == 1 else 'gains'} fixed at 0 left out." if absent else ""
    return table(["gain", "value", "first", "unit", "bounds"], _gains(best, first)) + said


def tuned_controller_text(result: Mapping[str, Any]) -> str:
    """The best controller of the paper beside the first."""
    best, first = result["controller"], result["first_controller"]
    measured, reference = best["measured"], first["measured"]
    quality = (
        f"Final distance on the system: {cell(measured)}; first controller: {cell(reference)}; "
        f"doing nothing: {result['task']['distance']:.4g}; predicted by the twin: {cell(best['predicted'])}."
    )
    title = f"BEST CONTROLLER FLOWN: TEST {best['test']}"
    return f"{title}\n{_table(best, first)}\n{quality}"


def controller_text(result: Mapping[str, Any]) -> str:
    """The controller to fly beside the first, and why this one."""
    best, first = result["controller"], result["first_controller"]
    if best is None:
        return f"NO CONTROLLER TO FLY\n{result['no_controller'].removeprefix('No controller to fly: ')}"
    state = f"TEST {best['test']}, FLOWN" if best["flown"] else "NOT FLOWN YET"
    qualities = [["this controller", best["predicted"], best["spread"], best["measured"]]]
    if first is not None:
        qualities.append(["first controller", first["predicted"], None, first["measured"]])
    gently = next((run["excited"] for run in result["experiments"] if run["test"] is not None), False)
    excited = "\nThe first controller was excited when it was flown." if gently else ""
    title = "CONTROLLER, NOT TO BE FLOWN" if _is_refused(result) else "CONTROLLER TO FLY"
    return "\n".join(
        [
            f"{title}: {state}",
            _table(best, first),
            "",
            table(["quality", "predicted", "± spread", "measured"], qualities),
            f"{best['why']}{_risk(best['risk'], result)}{excited}",
        ]
    )


def _is_refused(result: Mapping[str, Any]) -> bool:
    return bool(result["verdict"]["controller"]["answer"] == answers.DO_NOT_FLY)


def _risk(risk: float | None, result: Mapping[str, Any]) -> str:
    if risk is None:
        return ""
    bounded = is_bounded(result)
    return f" Risk of {risk_of_what(bounded)}: {risk_words(risk, predicted_flights(result), bounded)}."


def advice_text(result: Mapping[str, Any]) -> str:
    """What another experiment would bring, under its title."""
    return f"ANOTHER EXPERIMENT?\n{advice_words(result)}"


def advice_words(result: Mapping[str, Any]) -> str:
    """What another experiment would bring.

    Args:
        result: a `twinloop.faces.result.summary` of a preset that knows it.
    """
    advice, unit = result["advice"], result["quality"]["unit"]
    scatter = advice["scatter"]
    if advice["gain"] is None:
        return "No flight was planned yet; ask for one to see what it would bring."
    if not advice["trusted"]:
        return "The twin is not reliable yet, so it cannot say. Look into the remarks, then fly another test."
    if result["verdict"]["twin"]["good"] is False:
        return (
            "The twin is not to be trusted yet, so it cannot say. Look into the checks that fail, then fly another"
            " test."
        )
    share = (
        f", {two_digits(100.0 * advice['share'])} % of what it is now" if advice["share"] is not None else ""
    )
    planned = f"When test {advice['before_test']} was planned, knowing which model is right"
    size = None if scatter is None else with_unit(scatter, unit)
    if advice["gain"] == 0.0:
        stop = f" {_stop(result)}" if advice["stop"] else ""
        scattered = "" if size is None else f"\nThe sensors alone scatter one measurement by {size}."
        return f"{planned} would not have improved\nthe quality.{stop}{scattered}"
    words = (
        f"{planned}, and flying gains\nthat are held back, would have improved the quality"
        f" by {with_unit(advice['gain'], unit)}{share}."
    )
    if size is None:
        return words
    by_sensors = f"what the sensors alone scatter one measurement by, {size}"
    if advice["stop"]:
        return f"{words}\nThat is below {by_sensors}. {_stop(result)}"
    return f"{words}\nThat is above {by_sensors}: another experiment may pay."


def _stop(result: Mapping[str, Any]) -> str:
    """That no flight is needed, with what it does not bring the controller to."""
    if _is_refused(result):
        return "Another flight would hardly change the controller, which is not to be flown: ask for a calmer one."
    best = result["controller"]
    off = None if best is None else best.get("off_target")
    return f"For the controller, stop, or change the task. {off}" if off else "For the controller, stop."
