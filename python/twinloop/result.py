"""A campaign as one plain dictionary: what every face shows, and what `--json` and `--output` write."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from twinloop.arrays import Floats
from twinloop.campaign import Campaign, controller_to_fly
from twinloop.controllers import Gain
from twinloop.flight import fly
from twinloop.history import Experiment, Lesson
from twinloop.identification.noise import exact
from twinloop.models import TestErrors, Twin
from twinloop.objectives import normalised_error
from twinloop.planning.quality import Quality
from twinloop.presets import DefaultOptions
from twinloop.streams import Unit
from twinloop.test import Test

Value = None | bool | int | float | str | list["Value"] | dict[str, "Value"]
Result = dict[str, Value]
REPEATS = 32
"""Flights on the twin from which the scatter of a measurement is taken."""


def summary(campaign: Campaign, system: Mapping[str, object], run_info: Mapping[str, object]) -> Result:
    """What a campaign found.

    Args:
        campaign: with at least one experiment told; what it has not learnt yet is learnt now.
        system: what was experimented on: its name and settings.
        run_info: all that may differ between equal runs: times, threads, host, command line, versions.

    Returns:
        A dictionary of numbers, texts, lists and dictionaries; a number that is not finite is None.

    Raises:
        KeyboardInterrupt: while learning; calling again gives the best so far.
        NotAvailable: nothing was told.
    """
    twin, (best, why) = campaign.twin, controller_to_fly(campaign)
    identified = isinstance(campaign.options, DefaultOptions)
    result: dict[str, object] = {
        "system": dict(system),
        "preset": campaign.setup.preset,
        "options": dataclasses.asdict(campaign.options),
        "goal": campaign.setup.goal,
        "quality": {"kind": campaign.setup.quality.kind, "unit": quality_unit(campaign.setup.quality)},
        "seed": campaign.setup.seed,
        "interrupted": campaign.interrupted,
        "task": {
            "initial_state": campaign.setup.initial_state.tolist(),
            "target_state": campaign.setup.target_state.tolist(),
            "steps": campaign.setup.steps,
            "dt": campaign.signals.dt,
            "distance": float(
                np.linalg.norm(
                    campaign.signals.difference(campaign.setup.final_target, campaign.setup.initial_state)
                )
            ),
        },
        "signals": {
            "states": [dataclasses.asdict(state) for state in campaign.signals.states],
            "commands": [dataclasses.asdict(command) for command in campaign.signals.commands],
        },
        "experiments": [
            _experiment(run, row, identified)
            for run, row in zip(campaign.experiments, twin.errors, strict=True)
        ],
        "iterations": [dataclasses.asdict(iteration) for iteration in campaign.history],
        "twin": {
            "form": twin.model.form,
            "equations": twin.equations().splitlines(),
            "exact_equations": twin.equations(digits=17).splitlines(),
            "program": str(twin.model.program).splitlines(),
            "intron_share": twin.model.program.intron_share,
        },
        "failures": [
            {"test": failure.test.number, "gains": failure.test.parameters, "reason": failure.reason}
            for failure in campaign.failures
        ],
        "controller": None if best is None else _controller(campaign, best, identified),
        "no_controller": why or None,
        "first_controller": _first_controller(campaign, twin, identified),
        "run_info": dict(run_info),
    }
    if identified:
        _add_identified(result, campaign, best)
    return plain_dict(result)


def _controller(campaign: Campaign, best: Test, identified: bool) -> dict[str, object]:
    found: dict[str, object] = {
        "test": best.number,
        "gains": [
            {
                "name": gain.name,
                "value": best.parameters[gain.name],
                "unit": gain.unit,
                "low": gain.low if isinstance(gain, Gain) else None,
                "high": gain.high if isinstance(gain, Gain) else None,
            }
            for gain in campaign.family.law_gains
        ],
        "predicted": best.predicted,
        "measured": best.measured,
    }
    if identified:
        flown = any(run.number == best.number for run in campaign.experiments)
        found |= {"spread": best.spread, "risk": best.risk, "why": best.reason, "flown": flown}
    return found


def _first_controller(campaign: Campaign, twin: Twin, identified: bool) -> dict[str, object] | None:
    """Of the first test that was flown; None where none was."""
    for run in campaign.experiments:
        if run.test is not None:
            found: dict[str, object] = {
                "test": run.test.number,
                "gains": run.test.parameters,
                "measured": run.quality if identified else run.final_distance,
            }
            return found | (
                {"predicted": _first_predicted(campaign, twin, run.test.quiet())} if identified else {}
            )
    return None


def quality_unit(quality: Quality) -> str:
    """Unit of a quality, where it has one: "" where states of several units, or commands, are weighed together.

    Args:
        quality: of a campaign.
    """
    counted = [
        (state, weight)
        for state, weight in zip(quality.signals.states, quality.weights.tolist(), strict=True)
        if weight != 0.0
    ]
    units = {state.unit for state, _ in counted}
    if (
        len(units) != 1
        or any(weight != 1.0 for _, weight in counted)
        or quality.effort
        or quality.effort_rate
    ):
        return ""
    unit = units.pop()
    return {"iae": f"{unit} s", "ise": f"{unit}² s"}.get(quality.kind, unit)


def _experiment(run: Experiment, row: TestErrors, identified: bool) -> dict[str, object]:
    test = run.test
    predicted = None if test is None else test.predicted
    found: dict[str, object] = {
        "test": run.number,
        "gains": None if test is None else test.parameters,
        "ended": run.trajectory.ended,
        "reason": run.trajectory.reason,
        "steps": run.trajectory.steps,
        "predicted": predicted,
        "measured": run.quality if identified else run.final_distance,
        **{key: value for key, value in dataclasses.asdict(row).items() if key != "test"},
        "frozen": run.frozen,
    }
    if identified:
        both = predicted is not None and run.quality is not None
        found |= {
            "spread": None if test is None else test.spread,
            "predicted_minus_measured": predicted - run.quality if both else None,  # type: ignore[operator]
            "risk": None if test is None else test.risk,
            "why": "" if test is None else test.reason,
            "excited": test is not None and test.excitation is not None,
            "final_distance": run.final_distance,
            "normalised_before": None if row.before is None else normalised_error(row.before, run.frozen),
        }
    return found


def _add_identified(result: dict[str, Any], campaign: Campaign, best: Test | None) -> None:
    """What only the preset `default` knows: noise, actuators, what is left, what another experiment would bring."""
    twin, lesson = campaign.twin, campaign.history[-1]
    assert isinstance(lesson, Lesson)
    result["twin"] |= {
        "terms": lesson.terms,
        "misfit": lesson.misfit,
        "readings": lesson.readings,
        "ignored": lesson.ignored,
        "committee": len(campaign.committee),
        "states": [
            {"name": state.name, "unit": state.unit, "error": error, "sensor": sensor, "offset": offset}
            for state, error, sensor, offset in zip(
                campaign.signals.states,
                _errors_by_state(campaign, twin),
                lesson.sensors,
                lesson.offsets,
                strict=True,
            )
        ],
        "actuators": [
            {"name": command.name, "lag": lag, "delay": delay}
            for command, lag, delay in zip(campaign.signals.commands, lesson.lags, lesson.delays, strict=True)
        ],
        "hidden": [
            {
                "commands": [campaign.signals.commands[i].name for i in commands],
                "squared": squared,
                "rest": rest,
                "time": time,
            }
            for commands, squared, rest, time in lesson.hidden
        ],
        "disturbances": _disturbances(campaign, twin, lesson),
        "remarks": list(lesson.remarks),
    }
    result["advice"] = _advice(campaign, twin, best)


def _disturbances(campaign: Campaign, twin: Twin, lesson: Lesson) -> list[dict[str, object]]:
    """What moves the states beside the commands: white, and lasting with a memory; those that are felt at all."""
    # By exact readings none is told: the least that is believed was held.
    if twin.noise is None or exact(lesson.misfit):
        return []
    lasting = {states[0]: (size, memory) for states, _, size, memory in twin.noise.gusts}
    found: list[dict[str, object]] = []
    for i, (state, white) in enumerate(zip(campaign.signals.states, twin.noise.moves.tolist(), strict=True)):
        size, memory = lasting.get(i, (0.0, 0.0))
        # What is far below the sensor's noise, estimated beside it, within its memory cannot be told from nothing.
        least = 0.01 * lesson.sensors[i]
        white = white if white > least else 0.0
        size = size if size * max(memory, campaign.signals.dt) > least else 0.0
        if white or size:
            found.append(
                {"name": state.name, "unit": state.unit, "white": white, "lasting": size, "memory": memory}
            )
    return found


def _errors_by_state(campaign: Campaign, twin: Twin) -> list[float]:
    """Root mean square of flown minus simulated over all flights, for each state in its unit."""
    squares, rows = np.zeros(campaign.signals.n_x), 0
    for run in campaign.experiments:
        test = twin.as_flown(run.replayed, run.trajectory)
        # Without the committee's band, which `twin.simulate` would draw for each flight.
        simulated = fly(twin.model, test, divergence_factor=twin.divergence_factor).states[1:]
        flown = run.trajectory.states[1 : len(simulated) + 1]
        squares += ((flown - simulated[: len(flown)]) ** 2).sum(axis=0)
        rows += len(flown)
    return [float(value) for value in np.sqrt(squares / max(1, rows))]


def _first_predicted(campaign: Campaign, twin: Twin, first: Test) -> float | None:
    """Quality that the twin expects to be measured of a flight, under the sensors' noise; None if it diverges."""
    values = _repeated(campaign, twin, first, gusts=False)
    return None if np.isnan(values).any() else float(np.mean(values))


def _advice(campaign: Campaign, twin: Twin, best: Test | None) -> dict[str, object]:
    """What another experiment would bring, by the committee's own estimate, beside what a repeated flight scatters."""
    lessons = [lesson for lesson in campaign.history if isinstance(lesson, Lesson)]
    judged = [(plan, lesson) for lesson in lessons for plan in lesson.asked if math.isfinite(plan.predicted)]
    gain = judged[-1][0].gain if judged else None
    # A model that does not follow its own runs, then or now, can advise nobody.
    trusted = bool(judged) and judged[-1][1].follows and lessons[-1].follows
    scatter = None if best is None else _scatter(campaign, twin, best)
    quality = None if best is None else best.predicted if best.measured is None else best.measured
    known = gain is not None and quality is not None and math.isfinite(quality) and quality > 0.0
    return {
        "before_test": judged[-1][0].test if judged else None,
        "trusted": trusted,
        "gain": gain,
        "share": gain / quality if known else None,  # type: ignore[operator]
        "scatter": scatter,
        "stop": None if gain is None or scatter is None or not trusted else gain <= scatter,
    }


def _scatter(campaign: Campaign, twin: Twin, best: Test) -> float | None:
    """Standard deviation of the quality that would be measured if the same flight were repeated, on the twin."""
    values = [value for value in _repeated(campaign, twin, best, gusts=True) if not math.isnan(value)]
    return float(np.std(values)) if len(values) > 1 else None


def _repeated(campaign: Campaign, twin: Twin, test: Test, gusts: bool) -> list[float]:
    """Qualities that would be measured if a flight were repeated, on the twin; NaN for one that diverges."""
    draws: list[tuple[Floats | None, Floats | None]] = [(None, None)]
    if twin.noise is not None:
        noise, moves = twin.noise.drawn(
            REPEATS, test.steps, Unit(campaign.setup.seed).part(0).stream("repeats")
        )
        draws = [(seen, moved if gusts else None) for seen, moved in zip(noise, moves, strict=True)]
    values = []
    for seen, moved in draws:
        run = fly(twin.model, test, noise=seen, disturbance=moved, divergence_factor=twin.divergence_factor)
        lasted = run.steps == test.steps
        values.append(campaign.setup.quality.flown(run, test.target_state) if lasted else math.nan)
    return values


def plain_dict(values: Mapping[str, object]) -> Result:
    """A dictionary that JSON can hold.

    Args:
        values: anything that `plain` takes, by name.

    Returns:
        The same, plain.
    """
    return {str(key): plain(value) for key, value in values.items()}


def plain(value: object) -> Value:
    """A value that JSON can hold.

    Args:
        value: numbers, texts, arrays, sequences and mappings of them.

    Returns:
        The same in Python's own types; None for a number that is not finite.

    Raises:
        TypeError: a value of another type.
    """
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return plain_dict(value)
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    raise TypeError(f"expected numbers, texts, lists and dicts, found {type(value).__name__}")


def to_json(result: Mapping[str, object], ascii_only: bool = False) -> str:
    """One JSON object, two spaces deep, with a last line break.

    Args:
        result: a plain dictionary.
        ascii_only: whether all other letters are written as escapes.

    Returns:
        The text.
    """
    return json.dumps(plain_dict(result), indent=2, ensure_ascii=ascii_only, allow_nan=False) + "\n"
