"""Tables of the report, as plain rows of numbers and texts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinloop.campaign.examination.examination import Examination
from twinloop.campaign.examination.poles import Pole
from twinloop.campaign.examination.use import envelope_use
from twinloop.faces.figures.units import said, shown_unit, words
from twinloop.faces.text import cell, counted, held_at, quality_words

RIVALS = 3
"""Rivals of each equation that are shown."""
CAUSES = {
    "disturbance": "a disturbance",
    "law": "an error of the law",
    "undecided": "not decided yet",
}
"""What a correlated disturbance is, by its cause."""


@dataclass(frozen=True)
class Table:
    """Rows under one heading.

    Args:
        name: a word that does not change; links use it.
        title: for a person.
        head: of the columns.
        rows: cells as texts.
        note: below it.
        texts: columns that are read, not compared.
    """

    name: str
    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    texts: Sequence[int] = ()


def _table(
    name: str,
    title: str,
    head: Sequence[str],
    rows: Sequence[Sequence[object]],
    note: str = "",
    texts: Sequence[int] = (),
) -> Table:
    return Table(name, title, head, [[shown_value(value) for value in row] for row in rows], note, texts)


def shown_value(value: object) -> str:
    """A cell of a table: four digits, and signs as they are set."""
    if isinstance(value, float):
        return (
            ("−∞" if value < 0.0 else "∞")
            if math.isinf(value)
            else "–"
            if math.isnan(value)
            else f"{value:.4g}".replace("-", "−")
        )
    return cell(value)


def shown_spread(value: float | None) -> str | None:
    """A standard deviation, with as many digits as it is worth."""
    return None if value is None else f"{value:.2g}"


def states(result: Mapping[str, Any]) -> Table | None:
    """What the twin leaves beside the sensors' noise."""
    twin = result["twin"]
    if "states" not in twin:
        return None
    rows = [
        [
            words(state["name"]), state["unit"] or "1", state["error"], state["sensor"],
            state["error"] / state["sensor"] if state["sensor"] and state["error"] is not None else None,
            1e3 * state["offset"],
        ]
        for state in twin["states"]
    ]  # fmt: skip
    head = ["state", "unit", "error of whole flights", "sensor's noise", "ratio", "read late by (ms)"]
    note = (
        "Errors are root mean squares of flown minus simulated; noise is a standard deviation, as estimated. A ratio"
        " of 1 leaves nothing but the sensors."
    )
    return _table("noise", "What the twin leaves, state by state", head, rows, note)


def disturbances(result: Mapping[str, Any]) -> Table | None:
    """What moves the states beside the commands."""
    found = result["twin"].get("disturbances")
    if not found:
        return None
    rows = [
        [
            words(each["name"]),
            each["unit"] or "1",
            each["white"] or None,
            each["correlated"] or None,
            each["correlation_time"] or None,
            CAUSES[each["cause"]] if each["correlated"] else None,
        ]
        for each in found
    ]
    head = [
        "state",
        "unit",
        "white, each period",
        "correlated, each second",
        "correlation time (s)",
        "which is",
    ]
    return _table("disturbances", "Disturbances (standard deviations)", head, rows)


def actuators(result: Mapping[str, Any]) -> Table | None:
    """Lags and delays."""
    found = result["twin"].get("actuators")
    if not found:
        return None
    rows = [[words(each["name"]), each["lag"], each["delay"]] for each in found]
    return _table("actuators", "Actuators", ["command", "lag (s)", "delay (periods)"], rows)


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
    note = "From about 10 on the flights speak against a rival; below that they cannot tell the two apart."
    return _table("rivals", "Rival equations", head, rows, note, (2, 3))


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
    return _table(
        name, title, ["pole (1/s)", "frequency (rad/s)", "damping", "time constant (s)"], rows, note
    )


def poles(found: Examination) -> list[Table]:
    """Of the twin alone, and closed."""
    both = [
        _poles(
            "poles", "Poles of the twin at the target", found.open_poles, "A negative time constant grows."
        ),
        _poles("closed-poles", "Poles with the loops closed", found.closed_poles, ""),
    ]
    return [table for table in both if table is not None]


def gains(result: Mapping[str, Any]) -> Table | None:
    """Gains of the controller to fly beside the first."""
    best, first = result["controller"], result["first_controller"]
    if best is None:
        return None
    rows = []
    for gain in best["gains"]:
        box = "fixed" if gain["low"] is None else f"{gain['low']:g} to {gain['high']:g}"
        rows.append(
            [
                gain["name"],
                gain["value"],
                None if first is None else first["gains"][gain["name"]],
                gain["unit"],
                box,
                held_at(gain),
            ]
        )
    return _table(
        "gains-table", "Gains", ["gain", "value", "first", "unit", "bounds", ""], rows, best.get("why") or ""
    )


def margins(found: Examination) -> Table | None:
    """Margins of each loop, the worst over the committee first."""
    loops = found.margins
    if loops is None:
        return None
    rows: list[list[object]] = []
    for nominal, worst in zip(loops.nominal, loops.worst, strict=True):
        for which, loop in (("worst", worst), ("twin", nominal)):
            if not loop.stable:
                rows.append([words(loop.loop), which, *[None] * 7, "NO"])
                continue
            rows.append(
                [words(loop.loop), which, 20.0 * math.log10(loop.gain) if loop.gain > 0 else None,
                 20.0 * math.log10(loop.gain_down) if loop.gain_down > 0 else -math.inf, math.degrees(loop.phase),
                 1e3 * loop.delay, loop.crossover, loop.sensitivity, loop.complementary, "yes"]
            )  # fmt: skip
    head = [
        "loop",
        "model",
        "gain (dB)",
        "down to (dB)",
        "phase (°)",
        "delay (ms)",
        "crossover (rad/s)",
        "Ms",
        "Mt",
        "stable",
    ]
    note = (
        f"Each loop broken at the {loops.broken_at}, the others closed, at the target, with delays and lags; worst:"
        f" the worst of each over {loops.members} model{'s' * (loops.members != 1)} of the committee, which need not"
        " be one model's. A loop that is unstable on one of them has no margins."
    )
    return _table("margins", "Margins", head, rows, note)


def steps(found: Examination) -> Table | None:
    """Rise, overshoot and settling as predicted, as flown and of the first gains."""
    if found.planned is None:
        return None
    runs = [("predicted", found.planned)]
    if found.best_flown is not None:
        runs.append(("flown", found.best_flown.trajectory))
    if found.old is not None:
        runs.append(("first gains, on the twin", found.old))
    follows, steps = found.twin.follows, found.setup.steps
    rows: list[list[object]] = []
    for i in range(len(found.step(found.planned))):
        for name, run in runs:
            answer = found.step(run)[i]
            on_twin = name != "flown"
            if on_twin and (not follows or run.steps < steps):
                why = "it diverges" if run.steps < steps else "the twin does not follow"
                rows.append([words(answer.state), f"{name}: {why}", *[None] * 4])
                continue
            numbers = [
                answer.rise,
                100.0 * answer.overshoot,
                answer.settling,
                100.0 * answer.steady_state_error,
            ]
            rows.append([words(answer.state), name, *numbers])
    if not rows:
        return None
    head = ["state", "flight", "rise 10–90 % (s)", "overshoot (%)", "settling 5 % (s)", "off at the end (%)"]
    return _table("steps", "The step", head, rows, "–: it does not get there within the flight.", texts=(1,))


def effort(found: Examination) -> Table | None:
    """What the planned flight asks of each command."""
    if found.planned is None or found.planned.steps == 0:
        return None
    first = None if found.first_flown is None else found.effort(found.first_flown.trajectory)
    noise = None if found.closed is None else found.closed.noise_of_commands
    rows = []
    for j, each in enumerate(found.effort(found.planned)):
        low, high = found.signals.commands[j].bounds
        rows.append(
            [words(each.command), 100.0 * each.used, 100.0 * each.saturated, 100.0 * each.moved,
             None if first is None else 100.0 * first[j].used, None if first is None else 100.0 * first[j].saturated,
             None if noise is None else 200.0 * float(noise[j]) / (high - low)]
        )  # fmt: skip
    head = [
        "command",
        "used (%)",
        "at a bound (%)",
        "change a period (%)",
        "first: used (%)",
        "first: at a bound (%)",
        "from sensors' noise (%)",
    ]
    note = "Root mean squares in half ranges of each command, about their middle. At a bound: share of the periods."
    return _table("effort", "Effort of the commands", head, rows, note)


def envelope(found: Examination) -> Table | None:
    """The largest usage of the envelope, predicted and flown."""
    if found.planned is None:
        return None
    planned = envelope_use(found.planned.states, found.signals)
    if not planned:
        return None
    met = (
        None
        if found.best_flown is None
        else dict(envelope_use(found.best_flown.trajectory.states, found.signals))
    )
    flown = [dict(envelope_use(run.trajectory.states, found.signals)) for run in found.experiments]
    rows = [
        [
            words(name),
            100.0 * used,
            None if met is None else 100.0 * met[name],
            100.0 * max(each[name] for each in flown),
        ]
        for name, used in planned
    ]
    risk = (
        ""
        if found.best is None or found.best.risk is None
        else (f" Probability that the flight leaves it, by the committee: {found.best.risk:.2g}.")
    )
    head = ["state", "foretold (%)", "met (%)", "most of all flights (%)"]
    return _table("envelope", "Use of the envelope", head, rows, f"100 % is a bound.{risk}")


def ranges(found: Examination) -> Table:
    """What was flown: where the twin's word holds."""
    runs = [run.trajectory for run in found.experiments]
    rows: list[list[object]] = []
    of_states = [(state.name, *shown_unit(state.unit)) for state in found.signals.states]
    # Commands keep their units, as in the figures: a rotor's speed is no angle.
    of_commands = [(command.name, 1.0, command.unit or "1") for command in found.signals.commands]
    for signals, values in (
        (of_states, [run.states for run in runs]),
        (of_commands, [run.commands for run in runs]),
    ):
        every = np.concatenate(values)
        for (name, factor, unit), low, high in zip(
            signals, every.min(axis=0), every.max(axis=0), strict=True
        ):
            rows.append([words(name), unit, factor * float(low), factor * float(high)])
    note = "Of all flights together. Beyond, the twin goes on from its equations, and nobody has looked."
    return _table("ranges", "The range that was flown", ["signal", "unit", "from", "to"], rows, note)


def data(found: Examination) -> Table:
    """Data quality, flight by flight."""
    rows = [
        [said(each.number), each.seconds, each.ended,
         None if each.moved is None else f"{each.moved:.3g} ({words(each.least)})", 100.0 * each.saturated,
         None if each.large is None else 100.0 * each.large, 100.0 * each.usage, each.fingerprint]
        for each in found.data
    ]  # fmt: skip
    head = [
        "flight",
        "length (s)",
        "ended",
        "least moved, in noises",
        "at a bound (%)",
        "beyond 3 σ (%)",
        "envelope (%)",
        "SHA-256 of the data",
    ]
    note = (
        "Least moved: the state that moved least, in standard deviations of its sensor; below about 10 little can be"
        " learnt of it. Beyond 3 σ: innovations; 0.3 % are expected of noise. The last column begins the SHA-256 of"
        " times, states and commands as little-endian doubles."
    )
    return _table("data", "Data, flight by flight", head, rows, note)


def flights(result: Mapping[str, Any]) -> Table:
    """Predicted and flown, with the reason of each."""
    rows = [
        [
            said(run["test"]), run["predicted"], shown_spread(run.get("spread")), run["measured"],
            run.get("predicted_minus_measured"),
            run.get("risk"), run.get("why") or ("" if run["test"] is None else "Gains of your own."),
        ]
        for run in result["experiments"]
    ]  # fmt: skip
    measure = result["quality"]
    unit = f" ({measure['unit']})" if measure["unit"] else ""
    head = ["flight", f"predicted{unit}", f"± spread{unit}", f"flown{unit}", f"predicted − flown{unit}",
            "risk (probability)", "why"]  # fmt: skip
    note = (
        f"Quality: {quality_words(measure['kind'], measure['unit'])}; less is better. What counts: {counted(measure)}."
        " Predicted and its spread are what was said before the flight."
    )
    return _table("flights-table", "Flights", head, rows, note, texts=(6,))
