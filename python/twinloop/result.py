"""A campaign as one plain dictionary: what every face shows, and what `--json` and `--output` write."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping

import numpy as np

from twinloop.campaign import Campaign

Value = None | bool | int | float | str | list["Value"] | dict[str, "Value"]
Result = dict[str, Value]


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
    twin, best = campaign.twin, campaign.best_test
    experiments = [
        {
            "test": run.test.number,
            "gains": run.test.parameters,
            "ended": run.trajectory.ended,
            "reason": run.trajectory.reason,
            "steps": run.trajectory.steps,
            "predicted": run.test.predicted,
            "measured": run.final_distance,
            **{key: value for key, value in dataclasses.asdict(row).items() if key != "test"},
            "frozen": run.frozen,
        }
        for run, row in zip(campaign.experiments, twin.errors, strict=True)
    ]
    first = campaign.experiments[0].test
    result = {
        "system": dict(system),
        "preset": campaign.setup.preset,
        "options": dataclasses.asdict(campaign.options),
        "seed": campaign.setup.seed,
        "interrupted": campaign.interrupted,
        "task": {
            "initial_state": campaign.setup.initial_state.tolist(),
            "target_state": campaign.setup.target_state.tolist(),
            "steps": campaign.setup.steps,
            "dt": campaign.signals.dt,
            "distance": float(np.linalg.norm(campaign.setup.target_state - campaign.setup.initial_state)),
        },
        "signals": {
            "states": [dataclasses.asdict(state) for state in campaign.signals.states],
            "commands": [dataclasses.asdict(command) for command in campaign.signals.commands],
        },
        "experiments": experiments,
        "iterations": [dataclasses.asdict(iteration) for iteration in campaign.history],
        "twin": {
            "form": twin.model.form,
            "equations": twin.equations().splitlines(),
            "exact_equations": twin.equations(digits=17).splitlines(),
            "program": str(twin.model.program).splitlines(),
            "intron_share": twin.model.program.intron_share,
        },
        "controller": {
            "test": best.number,
            "gains": [
                {"name": gain.name, "value": value, "unit": gain.unit, "low": gain.low, "high": gain.high}
                for gain, value in zip(campaign.family.gains, best.genes.tolist(), strict=True)
            ],
            "predicted": best.predicted,
            "measured": best.measured,
        },
        "first_controller": {
            "test": first.number,
            "gains": first.parameters,
            "measured": campaign.experiments[0].final_distance,
        },
        "run_info": dict(run_info),
    }
    return plain_dict(result)


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


def to_json(result: Mapping[str, object]) -> str:
    """One JSON object, two spaces deep, with a last line break.

    Args:
        result: a plain dictionary.

    Returns:
        The text.
    """
    return json.dumps(plain_dict(result), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
