"""A campaign as one plain dictionary: what every face shows, and what `--json` and `--output` write."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from twinloop.campaign import Campaign
from twinloop.campaign.assessment import (
    disturbances,
    expected_quality,
    latest_lesson,
    number_of,
    predicted_quality,
)
from twinloop.campaign.cost import Cost
from twinloop.campaign.data.excited import hidden
from twinloop.campaign.examination.beside import Beside
from twinloop.campaign.examination.checking import checks
from twinloop.campaign.examination.examination import Examination
from twinloop.campaign.history import Experiment, Lesson
from twinloop.controllers import Gain
from twinloop.faces.verdict import verdict, verdict_facts
from twinloop.law.accuracy import TestErrors
from twinloop.law.twin import Twin
from twinloop.planning.quality import Quality, quality_unit
from twinloop.test import Test
from twinloop.trajectory import Trajectory

Value = None | bool | int | float | str | list["Value"] | dict[str, "Value"]
Result = dict[str, Value]


def summary(
    campaign: Campaign,
    system: Mapping[str, object],
    run_info: Mapping[str, object],
    examined: Examination | None = None,
) -> Result:
    """What a campaign found.

    Args:
        campaign: with at least one run; what it has not learnt yet is learnt now.
        system: what was experimented on: its name and settings.
        run_info: all that may differ between equal runs: times, threads, host, command line, versions.
        examined: its examination, where it was made already; None: it is made now.

    Returns:
        A dictionary of numbers, texts, lists and dictionaries; a number that is not finite is None.

    Raises:
        KeyboardInterrupt: while learning; calling again gives the best so far.
        NotAvailable: nothing was told.
    """
    found = campaign.examine() if examined is None else examined
    twin, best, identified = found.twin, found.best, campaign.options.identifies
    foretold = {each.place: each.predicted for each in found.unseen}
    result: dict[str, object] = {
        "system": dict(system),
        "preset": campaign.setup.preset,
        "options": dataclasses.asdict(campaign.options),
        "goal": campaign.setup.goal,
        "quality": quality_facts(campaign.setup.quality),
        "seed": campaign.setup.seed,
        "interrupted": campaign.interrupted,
        "task": {
            "initial_state": campaign.setup.initial_state.tolist(),
            "target_state": campaign.setup.target_state.tolist(),
            "steps": campaign.setup.steps,
            "dt": campaign.signals.dt,
            "distance": found.distance,
        },
        "signals": {
            "states": [dataclasses.asdict(state) for state in campaign.signals.states],
            "commands": [dataclasses.asdict(command) for command in campaign.signals.commands],
        },
        "experiments": [
            {**_experiment(campaign, each.run, row, identified), "series": _series(each, foretold.get(place))}
            for place, (each, row) in enumerate(zip(found.beside, twin.errors, strict=True))
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
        "withdrawn": [
            {"test": each.test, "reason": each.reason, "log": log or None}
            for each, log in zip(campaign.withdrawals, campaign.withdrawn_logs, strict=True)
        ],
        "cost": _cost(campaign.cost),
        "controller": None if best is None else _controller(campaign, best, found, identified),
        "no_controller": found.no_controller or None,
        "first_controller": _first_controller(campaign, twin, identified),
        "run_info": dict(run_info),
    }
    lesson = latest_lesson(campaign)
    if lesson is not None:
        _add_identified(result, campaign, lesson)
    result["verdict"] = verdict_facts(verdict(found, checks(found), result))
    return plain_dict(result)


def _cost(cost: Cost) -> dict[str, Any]:
    """The cost by name; "left" is a key that other programs read."""
    found = dataclasses.asdict(cost)
    return {"left" if key == "left_envelope" else key: value for key, value in found.items()}


def quality_facts(quality: Quality) -> dict[str, Any]:
    """What is minimised, and what counts in it.

    Args:
        quality: of a campaign.
    """
    counts = [
        {"name": state.name, "unit": state.unit, "weight": weight}
        for state, weight in zip(quality.signals.states, quality.weights.tolist(), strict=True)
        if weight != 0.0
    ]
    return {
        **{"kind": quality.kind, "unit": quality_unit(quality), "counts": counts},
        **{"effort": quality.effort, "effort_rate": quality.effort_rate},
    }


def _controller(
    campaign: Campaign, best: Test, examination: Examination, identified: bool
) -> dict[str, object]:
    bounds = campaign.family.at_bounds(best.genes)
    predicted, spread = predicted_quality(best, campaign.experiments)
    planned = examination.planned
    found: dict[str, object] = {
        "test": number_of(campaign, best),
        "gains": [
            {
                "name": gain.name,
                "value": best.parameters[gain.name],
                "unit": gain.unit,
                "low": gain.low if isinstance(gain, Gain) else None,
                "high": gain.high if isinstance(gain, Gain) else None,
                "at_bound": bounds.get(gain.name, ""),
            }
            for gain in campaign.family.law_gains
        ],
        "predicted": predicted,
        "measured": best.measured,
        "series": None
        if planned is None
        else {"t": planned.t, "commands": planned.commands, **_foretold(planned)},
    }
    if identified:
        flown = bool(examination.best_flights)
        end = "" if examination.ending is None else str(examination.ending)
        found |= {
            "spread": spread,
            "risk": best.risk,
            "why": best.reason,
            "flown": flown,
            "off_target": end or None,
        }
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
                {"predicted": expected_quality(twin, campaign.setup, run.test.quiet())} if identified else {}
            )
    return None


def _experiment(campaign: Campaign, run: Experiment, row: TestErrors, identified: bool) -> dict[str, object]:
    test = run.test
    asked = None if test is None or test.number is None else campaign.tests[test.number]
    found: dict[str, object] = {
        "test": run.number,
        "log": run.log or None,
        "gains": None if test is None else test.parameters,
        "ended": run.trajectory.ended,
        "reason": run.trajectory.reason,
        "steps": run.trajectory.steps,
        "predicted": None if test is None else test.predicted,
        "measured": run.quality if identified else run.final_distance,
        **{key: value for key, value in dataclasses.asdict(row).items() if key != "test"},
        "frozen": run.frozen,
    }
    if identified:
        found |= {
            "spread": None if test is None else test.spread,
            "predicted_minus_measured": run.miss,
            "risk": None if test is None else test.risk,
            "why": "" if test is None else test.reason,
            "excited": test is not None
            and (test.excitation is not None or (asked is not None and hidden(asked, run.trajectory))),
            "final_distance": run.final_distance,
            "normalised_before": run.normalised_before,
        }
    return found


def _series(found: Beside, foretold: Trajectory | None) -> dict[str, object]:
    """A flight, what the twin makes of it now, and what it foretold; bands where a committee stood behind it."""
    flown, simulated = found.run.trajectory, found.simulated
    return {
        "t": flown.t,
        "states": flown.states,
        "commands": flown.commands,
        "simulated": simulated.states,
        "band": simulated.band,
        **_foretold(foretold),
    }


def _foretold(run: Trajectory | None) -> dict[str, object]:
    """What a twin says of a flight that it has not learnt."""
    if run is None:
        return {"predicted": None, "predicted_band": None}
    return {"predicted": run.states, "predicted_band": run.band}


def _add_identified(result: dict[str, Any], campaign: Campaign, lesson: Lesson) -> None:
    """What only the preset `default` knows: noise, actuators, what is left, what another experiment would bring."""
    twin = campaign.twin
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
                campaign.rmse.tolist(),
                lesson.sensors,
                lesson.offsets,
                strict=True,
            )
        ],
        "actuators": [
            {
                "name": command.name,
                "lag": actuator.lag,
                "delay": actuator.delay,
                "rate": actuator.rate(command.size),
                "identified": (actuator.lag, actuator.delay, actuator.rate(command.size)) == found,
            }
            for command, actuator, found in zip(
                campaign.signals.commands,
                twin.law.actuation.actuators,
                # Lessons of earlier versions have no rates.
                zip(lesson.lags, lesson.delays, lesson.rates or (0.0,) * len(lesson.lags), strict=True),
                strict=True,
            )
        ],
        "hidden": [
            {
                "commands": [campaign.signals.command_names[i] for i in hidden.commands],
                "squared": hidden.squared,
                "rest": hidden.rest,
                "time": hidden.time,
                "states": [campaign.signals.state_names[i] for i in hidden.states],
                "settled": hidden.settled,
                "turns": hidden.turns,
                "gap": hidden.gap * campaign.signals.states[hidden.states[0]].scale if hidden.gap else 0.0,
                "damping": hidden.damping,
            }
            for hidden in lesson.hidden
        ],
        "disturbances": [dataclasses.asdict(each) for each in disturbances(twin, lesson)],
        "remarks": [
            {"code": remark.code, "severity": remark.severity, "sentence": remark.sentence}
            for remark in twin.remarks
        ],
    }
    assert campaign.advice is not None
    result["advice"] = dataclasses.asdict(campaign.advice)


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
