"""The twin of a campaign as text: equations, errors, sensors, what disturbs, actuators, hidden states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from twinloop._ground.texts import two_digits
from twinloop.faces.text.table import cell, table
from twinloop.law.actuation import in_periods

A_DAY = 86_400.0
"""Seconds: what takes longer to fade does not fade within a flight."""
STAND_IN = "not identified: the law does not explain the flights"
"""What is said of a lag that may stand for something else."""
CAUSES = {
    "disturbance": "",
    "law": ", a model error",
    "undecided": ", external or a model error",
}
"""What is added to a correlated disturbance, by its cause."""


def equations_text(result: Mapping[str, Any]) -> str:
    """The equations."""
    return "TWIN\n" + "\n".join(result["twin"]["equations"])


def program_errors_text(result: Mapping[str, Any]) -> str:
    """Errors of an evolved program on each test."""
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
    return "ERRORS OF THE TWIN, ONE ROW PER TEST\n" + table(head, rows) + "\n" + note


def states_text(result: Mapping[str, Any]) -> str:
    """Sensors, disturbances, actuators and hidden states."""
    twin = result["twin"]
    rows = [
        [
            state["name"],
            state["unit"] or "1",
            state["error"],
            state["sensor"],
            None if not state["sensor"] or state["error"] is None else state["error"] / state["sensor"],
        ]
        for state in twin["states"]
    ]
    head = ["state", "unit", "error of the twin", "noise of the sensor", "ratio"]
    lines = [
        "RESIDUALS OF THE TWIN, BY STATE",
        table(head, rows),
        "Errors: root mean square of flown minus simulated, over whole flights, each from where it began."
        " Noise:\nstandard deviation, as estimated. A ratio of 1: only the sensors' noise is left.",
        _disturbances(twin["disturbances"]),
        _actuators(twin["actuators"]),
        *hidden_states(twin["hidden"]),
        f"{twin['terms']} terms, {twin['committee']} models in the committee; χ² a reading {cell(twin['misfit'])}"
        f" (1: noise and disturbances explain the residuals)\nover {twin['readings']} readings,"
        f" {twin['ignored']} ignored.",
        *(remark["sentence"] if isinstance(remark, dict) else str(remark) for remark in twin["remarks"]),
    ]
    return "\n".join(lines)


def _disturbances(disturbances: Sequence[Mapping[str, Any]]) -> str:
    if not disturbances:
        return "Disturbances: none found beyond the sensors' noise."
    words = []
    for found in disturbances:
        name, unit = found["name"], found["unit"] or "1"
        parts = [f"{two_digits(found['white'])} {unit} a period"] if found["white"] else []
        if found["correlated"]:
            size, time = found["correlated"], found["correlation_time"]
            cause = CAUSES[found["cause"]]
            parts.append(
                f"{two_digits(size)} ({unit})/s with a correlation time of {two_digits(time)} s{cause}"
            )
        words.append(f"{name} {' and '.join(parts)}")
    return f"Disturbances (standard deviations): {'; '.join(words)}."


def _actuators(actuators: Sequence[Mapping[str, Any]]) -> str:
    """Lags, delays and rates in words; commands that have the same are named together."""
    groups: dict[tuple[float, int, float, bool], list[str]] = {}
    for actuator in actuators:
        kind = actuator["lag"], actuator["delay"], actuator.get("rate", 0.0), actuator.get("identified", True)
        groups.setdefault(kind, []).append(actuator["name"])
    if list(groups) == [(0.0, 0, 0.0, True)]:
        return "Actuators: no lag and no delay found."
    words = []
    for (lag, delay, rate, identified), names in groups.items():
        slow = f"lag {lag:.3g} s" if lag else "no lag"
        late = f"delay {in_periods(delay)}" if delay else "no delay"
        limited = f", at most {rate:.3g} of its unit a second" if rate else ""
        words.append(f"{', '.join(names)}: {slow}, {late}{limited}{'' if identified else f' ({STAND_IN})'}")
    return f"Actuators: {'; '.join(words)}."


def hidden_states(states: Sequence[Mapping[str, Any]]) -> list[str]:
    """States that no sensor reads, in words; two that turn into each other are one mass."""
    said, alone = [], True
    for state in states:
        what = "squares" if state["squared"] else "values"
        fading = f"decays to 1/e in {state['time']:.3g} s" if state["time"] < A_DAY else "does not decay"
        sources = ", ".join((*state["commands"], *state.get("states", ())))
        turns, gap = state.get("turns", 0.0), state.get("gap", 0.0)
        if not turns:
            said.append(
                f"Hidden state: the {what} of {sources} drive a state that is not measured; it {fading}."
            )
        elif alone and gap:
            said.append(
                f"Hidden mass behind a gap: {sources} drives it, with a play of ±{gap:.3g} (unit of {sources},"
                f" times s). Pressed against what drives it, it would swing once in {2.0 * math.pi * turns:.3g} s; its"
                f" own rate {fading}."
            )
        elif alone:
            said.append(
                f"Hidden mass on a spring: the {what} of {sources} drive it; it swings once in"
                f" {2.0 * math.pi * turns:.3g} s and {fading}."
            )
        alone = not (turns and alone)
    return said


def errors_text(result: Mapping[str, Any]) -> str:
    """Errors of an identified twin on each flight, before and after it was learnt."""
    head = ["test", "ended", "one step", "whole flight", "normalised", "before learning"]
    rows = [
        [
            run["test"],
            run["ended"],
            run["open_loop"],
            run["closed_loop"],
            run["normalised"],
            run["normalised_before"],
        ]
        for run in result["experiments"]
    ]
    note = (
        "Mean squares over steps and states, each in units of its scale, to the noisy readings. Normalised: over that"
        " of a\nmodel that never moves; 1 is useless. Before learning: the same, of the twin that had not seen the"
        " flight."
    )
    return "ERRORS OF THE TWIN, ONE ROW PER TEST\n" + table(head, rows) + "\n" + note
