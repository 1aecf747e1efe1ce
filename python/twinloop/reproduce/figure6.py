"""Figure 6: the most successful run, one line for each selected test under the successive best trade-offs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twinloop.faces.plots import iterations_picture
from twinloop.faces.result import Result, plain_dict
from twinloop.faces.text import table
from twinloop.reproduce.study import Run, Setting, described, finished_runs, headed


def compute(setting: Setting) -> Result:
    """Runs the study and keeps its most successful run.

    Args:
        setting: of the study.

    Returns:
        The closed-loop errors of that run by iteration, one list for each iteration; the others in short.

    Raises:
        KeyboardInterrupt: before the first run was finished.
    """
    runs: list[Result] = []
    best: Run | None = None
    interrupted = False
    try:
        for run in finished_runs(setting):
            runs.append({**described(run), "score": score(run)})
            if best is None or score(run) < score(best):
                best = run
    except KeyboardInterrupt:
        interrupted = True
        if best is None:
            raise
    assert best is not None
    return plain_dict(
        {
            **headed(setting, len(runs), interrupted),
            "most_successful": best.number,
            "definition": "lowest mean normalised closed-loop error over all its tests and iterations",
            "iterations": [
                {
                    "iteration": record.iteration,
                    "tests": record.tests,
                    "closed_loop": record.closed_loop,
                    "normalised": record.normalised,
                }
                for record in best.campaign.history
            ],
            "runs": runs,
        }
    )


def score(run: Run) -> float:
    """Mean normalised closed-loop error over all tests and iterations, the random population left out.

    Args:
        run: a finished run.

    Returns:
        The mean; smaller is more successful.
    """
    errors = [error for record in run.campaign.history[1:] for error in record.normalised]
    return math.fsum(errors) / len(errors)


def draw(result: Mapping[str, Any], path: Path) -> None:
    """The picture.

    Args:
        result: of `compute`.
        path: where to write.

    Raises:
        OSError: the file cannot be written.
    """
    lines: dict[int, list[tuple[float, float]]] = {}
    for record in result["iterations"]:
        for test, error in zip(record["tests"], record["closed_loop"], strict=True):
            if error is not None:
                lines.setdefault(test, []).append((float(record["iteration"]), error))
    title = f"Closed-loop error of the best trade-off on each selected test (run {result['most_successful']})"
    iterations_picture(lines, title, path)


def render(result: Mapping[str, Any]) -> str:
    """The figure's numbers as text.

    Args:
        result: of `compute`.

    Returns:
        Text.
    """
    records = result["iterations"]
    tests = records[-1]["tests"]
    rows = [
        [
            f"test {test}",
            *[
                record["closed_loop"][record["tests"].index(test)] if test in record["tests"] else ""
                for record in records
            ],
        ]
        for test in tests
    ]
    lines = [
        (
            f"Figure 6: run {result['most_successful']} of {result['runs_finished']}, the most successful "
            f"({result['definition']})"
        ),
        "",
        "Closed-loop error of the best trade-off on each selected test, by iteration",
        "",
        table(["iteration", *[str(record["iteration"]) for record in records]], rows),
    ]
    return "\n".join(lines)
