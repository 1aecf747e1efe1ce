"""Tables of the controller to fly: gains, margins, the step, effort, use of the envelope."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from twinloop._ground.times import time_unit
from twinloop.campaign.examination.examination import Examination
from twinloop.campaign.examination.use import envelope_use
from twinloop.faces.figures.units import words
from twinloop.faces.report.tables.table import Table, table_of
from twinloop.faces.text import held_at
from twinloop.planning.leaving import risk_words


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
    return table_of(
        "gains-table", "Gains", ["gain", "value", "first", "unit", "bounds", ""], rows, best.get("why") or ""
    )


def margins(found: Examination) -> Table | None:
    """Margins of each loop, the worst over the committee first."""
    loops = found.margins
    if loops is None:
        return None
    rows: list[list[object]] = []
    factor, unit = time_unit(loop.delay for loop in (*loops.nominal, *loops.worst) if loop.stable)
    for nominal, worst in zip(loops.nominal, loops.worst, strict=True):
        for which, loop in (("worst", worst), ("twin", nominal)):
            if not loop.stable:
                rows.append([words(loop.loop), which, *[None] * 7, "NO"])
                continue
            rows.append(
                [words(loop.loop), which, 20.0 * math.log10(loop.gain) if loop.gain > 0 else None,
                 20.0 * math.log10(loop.gain_down) if loop.gain_down > 0 else -math.inf, math.degrees(loop.phase),
                 factor * loop.delay, loop.crossover, loop.sensitivity, loop.complementary, "yes"]
            )  # fmt: skip
    head = [
        "loop",
        "model",
        "gain (dB)",
        "down to (dB)",
        "phase (°)",
        f"delay ({unit})",
        "crossover (rad/s)",
        "Ms",
        "Mt",
        "stable",
    ]
    slides = any(loop.friction for loop in loops.worst)
    if slides:
        head.append("dry friction")
        every = (loop for pair in zip(loops.worst, loops.nominal, strict=True) for loop in pair)
        rows = [[*row, loop.friction] for row, loop in zip(rows, every, strict=True)]
    note = (
        f"Each loop broken at the {loops.broken_at}, the others closed, at the target, with delays and lags; worst:"
        f" the worst of each over {loops.members} model{'s' * (loops.members != 1)} of the committee, which need not"
        " be one model's. A loop that is unstable on one of them has no margins."
    )
    if slides:
        note += (
            " Each is the worse of two: with dry friction that sticks, and damps strongly, and that slides, and damps"
            " nothing; named is the one that bears less delay."
        )
    return table_of("margins", "Margins", head, rows, note)


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
    head = ["state", "flight", "rise 10–90 % (s)", "overshoot (%)", "settling 5 % (s)", "final error (%)"]
    return table_of("steps", "Step response", head, rows, "–: not reached within the flight.", texts=(1,))


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
        "change per period (%)",
        "first: used (%)",
        "first: at a bound (%)",
        "from sensors' noise (%)",
    ]
    note = "Root mean squares in half ranges of each command, about their middle. At a bound: share of the periods."
    return table_of("effort", "Effort of the commands", head, rows, note)


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
        else (
            f" Probability that the flight leaves it, according to the committee:"
            f" {risk_words(found.best.risk, found.setup.predicted_flights)}."
        )
    )
    head = ["state", "predicted (%)", "flown (%)", "largest of all flights (%)"]
    return table_of("envelope", "Use of the envelope", head, rows, f"100 % is a bound.{risk}")
