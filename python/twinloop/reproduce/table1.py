"""Table I: the settings, the paper's beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twinloop.campaign.presets import Options, options_of
from twinloop.faces.result import Result, plain_dict
from twinloop.faces.text import table
from twinloop.reproduce.paper import ITERATIONS, TABLE_1
from twinloop.reproduce.study import Setting, headed


def compute(setting: Setting) -> Result:
    """Every row of Table I, and what it leaves open.

    Args:
        setting: of the study; only its generations matter.

    Returns:
        A plain dictionary.
    """
    ours = _ours(setting)
    rows = [
        {"setting": name, "paper": paper, "ours": ours[key], "option": key} for name, paper, key in TABLE_1
    ]
    return plain_dict({**headed(setting, 0, False), "rows": rows})


def render(result: Mapping[str, Any]) -> str:
    """The table as text.

    Args:
        result: of `compute`.

    Returns:
        Text.
    """
    rows = [[row["setting"], row["paper"], row["ours"]] for row in result["rows"]]
    return "Table I: settings\n\n" + table(["setting", "paper", "ours"], rows)


def _ours(setting: Setting) -> dict[str, str]:
    options: Options = setting.options
    three = options_of("paper", {"model_generations": setting.generations, "control_quality": True})
    computed = {
        "iterations": str(ITERATIONS),
        "generations_of_tests": str(options.generations_of_tests),
        "generations_of_tests_3": str(three.generations_of_tests),
        "operations": " ".join({"-": "−", "*": "×", "/": "÷"}.get(name, name) for name in options.operations),
        "tradeoff": "nearest to the ideal point" + ("" if options.tradeoff == "raw" else ", normalised"),
        "constants": f"{options.constant_low:g} to {options.constant_high:g}, log-uniform, random sign",
        "shares": f"{options.mutation_share:g}, {options.crossover_share:g}, {options.reproduction_share:g}",
        "committee_size": f"at most {options.committee_size}, spread by crowding",
        "mutants": f"{options.mutants}, steps of {100 * options.mutant_step:g} % of a range",
        "task": "2 s, 20 ms",
    }
    return {key: computed[key] if key in computed else str(getattr(options, key)) for _, _, key in TABLE_1}
