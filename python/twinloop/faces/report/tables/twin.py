"""Tables of the twin: what it leaves, what disturbs, what else the flights would allow, where it was flown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from twinloop._ground.texts import in_unit
from twinloop._ground.times import time_unit
from twinloop.campaign.examination.examination import Examination
from twinloop.campaign.examination.poles import Pole
from twinloop.faces.figures.units import words
from twinloop.faces.report.tables.table import Table, shown_value, table_of
from twinloop.faces.text.twin import STAND_IN

RIVALS = 3
"""Rivals of each equation that are shown."""
CAUSES = {
    "disturbance": "a disturbance",
    "law": "a model error",
    "undecided": "not decided yet",
}
"""What a correlated disturbance is, by its cause."""


def states(result: Mapping[str, Any]) -> Table | None:
    """What the twin leaves beside the sensors' noise."""
    twin = result["twin"]
    if "states" not in twin:
        return None
    rows = []
    per_second, late = time_unit(state["offset"] for state in twin["states"])
    for state in twin["states"]:
        error, sensor = state["error"], state["sensor"]
        rows.append([
            words(state["name"]), state["unit"] or "1", error, sensor,
            error / sensor if sensor and error is not None else None,
            per_second * state["offset"],
        ])  # fmt: skip
    head = ["state", "unit", "error of whole flights", "sensor's noise", "ratio", f"read late by ({late})"]
    note = (
        "Errors are root mean squares of flown minus simulated; noise is a standard deviation, as estimated. A ratio"
        " of 1: only the sensors' noise is left."
    )
    return table_of("noise", "Residuals of the twin, by state", head, rows, note)


def disturbances(result: Mapping[str, Any]) -> Table | None:
    """What moves the states beside the commands."""
    found = result["twin"].get("disturbances")
    if not found:
        return None
    rows = []
    for each in found:
        rows.append([
            words(each["name"]), each["unit"] or "1", each["white"] or None, each["correlated"] or None,
            each["correlation_time"] or None, CAUSES[each["cause"]] if each["correlated"] else None,
        ])  # fmt: skip
    head = [
        "state",
        "unit",
        "white, each period",
        "correlated, each second",
        "correlation time (s)",
        "which is",
    ]
    return table_of("disturbances", "Disturbances (standard deviations)", head, rows)


def actuators(result: Mapping[str, Any]) -> Table | None:
    """Lags, delays, and limited rates where there are any."""
    found = result["twin"].get("actuators")
    if not found:
        return None
    limited = any(each.get("rate") for each in found)
    head = [
        "command",
        "lag (s)",
        "delay (periods)",
        *(["rate at most (unit/s)"] if limited else []),
        "identified",
    ]
    rows = [
        [
            words(each["name"]),
            each["lag"],
            each["delay"],
            *([each.get("rate") or "–"] if limited else []),
            _identified(each),
        ]
        for each in found
    ]
    return table_of("actuators", "Actuators", head, rows)


def _identified(actuator: Mapping[str, Any]) -> str:
    """Whether a lag or a delay was identified; a dash where there is neither."""
    if not (actuator["lag"] or actuator["delay"] or actuator.get("rate")):
        return "–"
    # Results of earlier versions do not say so: what they name was identified.
    return "yes" if actuator.get("identified", True) else STAND_IN


def rivals(found: Examination) -> Table | None:
    """Other equations that the flights tell apart the least."""
    rows: list[list[object]] = []
    for state in dict.fromkeys(rival.state for rival in found.rivals):
        others = sorted((r for r in found.rivals if r.state == state and not r.chosen), key=lambda r: r.above)
        chosen = next((set(r.terms) for r in found.rivals if r.state == state and r.chosen), set())
        for rival in others[:RIVALS]:
            gone = ", ".join(sorted(chosen - set(rival.terms))) or "–"
            come = ", ".join(sorted(set(rival.terms) - chosen)) or "–"
            rows.append([words(state), len(rival.terms), come, gone, rival.above])
    if not rows:
        return None
    head = ["equation of", "terms", "with", "without", "above the chosen (χ²)"]
    note = "From about 10 on the flights contradict a rival; below that they cannot distinguish the two."
    return table_of("rivals", "Rival equations", head, rows, note, (2, 3))


def poles(found: Examination, tuned: bool) -> list[Table]:
    """Of the twin alone.

    Args:
        found: its examination.
        tuned: whether a controller was to be tuned, for a target; logs alone have none.
    """
    note = "A negative time constant: unstable."
    title = "Poles of the twin at the target"
    if not tuned:
        title = "Poles of the twin in the middle of the envelope"
        point = zip(found.signals.states, found.setup.final_target.tolist(), strict=True)
        values = ", ".join(
            f"{words(state.name)} {in_unit(f'{value:.4g}', state.unit)}" for state, value in point
        )
        note += f" At {values}: logs have no target, and where no envelope is declared the middle is 0."
    return _sticking_and_sliding("poles", title, found.open_poles, found.sliding_open_poles, note)


def closed_poles(found: Examination) -> list[Table]:
    """Of the twin with the loops of its controller closed."""
    return _sticking_and_sliding(
        "closed-poles", "Poles with the loops closed", found.closed_poles, found.sliding_closed_poles, ""
    )


def _sticking_and_sliding(
    name: str, title: str, sticking: Sequence[Pole], sliding: Sequence[Pole], note: str
) -> list[Table]:
    """A table of poles; with dry friction one as it sticks, and one as it slides."""
    tables = [
        _poles(name, f"{title}, dry friction sticking" if sliding else title, sticking, note),
        _poles(f"sliding-{name}", f"{title}, dry friction sliding", sliding, "Beyond the smallest motions."),
    ]
    return [table for table in tables if table is not None]


def _poles(name: str, title: str, found: Sequence[Pole], note: str) -> Table | None:
    if not found:
        return None
    rows = [
        [f"{pole.real:.3g} ± {pole.imaginary:.3g} j".replace("-", "−") if pole.imaginary else shown_value(pole.real),
         pole.frequency, pole.damping, pole.time]
        for pole in found
    ]  # fmt: skip
    # Six integrators are one row.
    count = {str(row): rows.count(row) for row in rows}
    rows = [[f"{row[0]}, {count[str(row)]} times", *row[1:]] if count[str(row)] > 1 else row
            for row in {str(row): row for row in rows}.values()]  # fmt: skip
    return table_of(
        name, title, ["pole (1/s)", "frequency (rad/s)", "damping", "time constant (s)"], rows, note
    )


def ranges(found: Examination) -> Table:
    """What was flown: where the twin's word holds."""
    runs = found.flown
    rows: list[list[object]] = []
    of_states = [(state.name, state.unit) for state in found.signals.states]
    of_commands = [(command.name, command.unit) for command in found.signals.commands]
    for signals, values in (
        (of_states, [run.states for run in runs]),
        (of_commands, [run.commands for run in runs]),
    ):
        every = np.concatenate(values)
        for (name, unit), low, high in zip(signals, every.min(axis=0), every.max(axis=0), strict=True):
            rows.append([words(name), unit or "1", float(low), float(high)])
    note = "Over all flights together; outside it the twin extrapolates."
    return table_of("ranges", "Flown range", ["signal", "unit", "from", "to"], rows, note)
