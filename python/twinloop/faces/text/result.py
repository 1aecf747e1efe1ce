"""The result of a campaign as text, section by section."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twinloop.faces.text.controller import advice_text, controller_text, tuned_controller_text
from twinloop.faces.text.table import table
from twinloop.faces.text.twin import equations_text, errors_text, program_errors_text, states_text
from twinloop.faces.text.verdict import verdict
from twinloop.faces.text.words import counted, is_bounded, predicted_flights, quality_words
from twinloop.planning.leaving import short_risk


def render(result: Mapping[str, Any], state: str | None = None, evidence: str = "") -> str:
    """The result of a campaign, for a person.

    Args:
        result: a `twinloop.faces.result.summary`.
        state: words before the number of its experiments; None: that it was interrupted, or has finished.
        evidence: what shows all checks, such as a command to type, said where one fails; empty: it is not said.

    Returns:
        Text.
    """
    if "advice" in result:
        parts = [
            _title(result, state),
            verdict(result, evidence),
            equations_text(result),
            states_text(result),
            errors_text(result),
            _flights(result),
            controller_text(result),
            advice_text(result),
            _time(result),
        ]
    else:
        parts = [
            _title(result, state),
            verdict(result, evidence),
            equations_text(result),
            program_errors_text(result),
            tuned_controller_text(result),
            _remarks(result),
        ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _title(result: Mapping[str, Any], state: str | None) -> str:
    runs = len(result["experiments"])
    if state is None:
        state = "interrupted, best so far after" if result["interrupted"] else "finished after"
    flown = f"{runs} experiment{'s' if runs != 1 else ''}"
    return f"{result['system']['name']}, preset {result['preset']}, seed {result['seed']}: {state} {flown}"


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
    remarks += [line for line in [_time(result)] if line]
    return "\n".join(remarks)


def _time(result: Mapping[str, Any]) -> str:
    seconds = result["run_info"].get("seconds")
    if not isinstance(seconds, float):
        return ""
    return f"{seconds:.1f} s on {result['run_info']['threads']} threads."


def _flights(result: Mapping[str, Any]) -> str:
    head = ["test", "predicted", "± spread", "flown", "predicted − flown", "risk"]
    keys = ("test", "predicted", "spread", "measured", "predicted_minus_measured", "risk")
    flights = predicted_flights(result)
    runs = [{**run, "risk": short_risk(run["risk"], flights)} for run in result["experiments"]]
    rows = [[run[key] for key in keys] for run in runs]
    reasons = [
        _of_run(run) + (f" It was cut: {run['reason']}." if run["reason"] else "")
        for run in result["experiments"]
    ]
    reasons += [
        f"Test {failure['test']} failed: {failure['reason']}." for failure in result.get("failures", ())
    ]
    reasons += [_withdrawn(each) for each in result.get("withdrawn", ())]
    measure = result["quality"]
    title = (
        f"FLIGHTS\nQuality: {quality_words(measure['kind'], measure['unit'])}; lower is better.\n"
        f"What counts: {counted(measure)}."
    )
    note = (
        "Spread: standard deviation that the measured quality is expected to have.\nRisk: probability that the flight"
        f" {'leaves the envelope' if is_bounded(result) else 'diverges; no envelope is declared'}."
    )
    return "\n".join([title, table(head, rows), note, *reasons])


def _of_run(run: Mapping[str, Any]) -> str:
    if run["test"] is None:
        return f"A run of {run['steps']} steps, attached{': ' + run['log'] if run.get('log') else ''}."
    return f"Test {run['test']}: {run['why'] or _own(run)}"


def _withdrawn(flight: Mapping[str, Any]) -> str:
    of = f"A flight of test {flight['test']}"
    if flight["test"] is None:
        of = f"The attached log {flight['log']}" if flight.get("log") else "An attached flight"
    return f"{of} was withdrawn: {flight['reason']}."


def _own(run: Mapping[str, Any]) -> str:
    return "Gains of your own" + (", gently excited." if run["excited"] else ".")
