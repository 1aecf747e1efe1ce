"""Table II: the error of the best trade-off on the first test, by iteration; it shows the forgetting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from twinloop.faces.result import Result, plain_dict
from twinloop.faces.text import table
from twinloop.reproduce.paper import ITERATIONS, TABLE_2, TABLE_2_REMARKS
from twinloop.reproduce.study import Setting, described, deviation, finished_runs, headed, mean

FORGOTTEN_FACTOR, FORGOTTEN_ERROR = 5.0, 0.1
FORGOTTEN = (
    f"a run forgot from the first iteration whose error on the first test is more than {FORGOTTEN_FACTOR:g}"
    f" times its best since iteration 1 and above {FORGOTTEN_ERROR:g}"
)


def compute(setting: Setting) -> Result:
    """Runs the study.

    Args:
        setting: of the study.

    Returns:
        Lists by iteration from 0: mean, std, normalised_mean, normalised_std; the paper's; each run's.
    """
    runs: list[Result] = []
    interrupted = False
    try:
        for run in finished_runs(setting):
            runs.append(described(run))
    except KeyboardInterrupt:
        interrupted = True
    return summarised(setting, runs, interrupted)


def summarised(setting: Setting, runs: Sequence[Mapping[str, Any]], interrupted: bool) -> Result:
    """Statistics over runs.

    Args:
        setting: of the study.
        runs: as `described`.
        interrupted: whether Ctrl-C ended the study.

    Returns:
        A plain dictionary.
    """
    iterations = range(ITERATIONS + 1)
    raw = [[run["closed_loop"][i] for run in runs] for i in iterations]
    normalised = [[run["normalised"][i] for run in runs] for i in iterations]
    forgot = [forgot_from(run["closed_loop"]) for run in runs]
    return plain_dict(
        {
            **headed(setting, len(runs), interrupted),
            "iterations": list(iterations),
            "mean": [mean(values) for values in raw],
            "std": [deviation(values) for values in raw],
            "normalised_mean": [mean(values) for values in normalised],
            "normalised_std": [deviation(values) for values in normalised],
            "paper": {**TABLE_2, "remarks": TABLE_2_REMARKS},
            "intron_share": mean([share for run in runs for share in run["intron_share"][1:]]),
            "forgot": {
                "definition": FORGOTTEN,
                "runs": sum(iteration is not None for iteration in forgot),
                "from_iteration": forgot,
            },
            "capped_generations": sum(sum(run["capped_generations"]) for run in runs),
            "runs": runs,
        }
    )


def forgot_from(errors: Sequence[float]) -> int | None:
    """The iteration from which a run forgot the first test.

    Args:
        errors: closed-loop errors on the first test, by iteration from 0.

    Returns:
        The iteration; None if it never forgot.
    """
    for iteration in range(2, len(errors)):
        error = errors[iteration]
        if error > FORGOTTEN_ERROR and error > FORGOTTEN_FACTOR * min(errors[1:iteration]):
            return iteration
    return None


def render(result: Mapping[str, Any]) -> str:
    """The table as text.

    Args:
        result: of `compute`.

    Returns:
        Text.
    """
    columns = [str(i) for i in result["iterations"]]
    rows = [
        ["paper, mean", *result["paper"]["mean"]],
        ["paper, st. dev.", *result["paper"]["std"]],
        ["ours, mean", *result["mean"]],
        ["ours, st. dev.", *result["std"]],
        ["ours, normalised mean", *result["normalised_mean"]],
        ["ours, normalised st. dev.", *result["normalised_std"]],
        *[[f"run {run['run']}", *run["closed_loop"]] for run in result["runs"]],
    ]
    forgot, finished = result["forgot"], result["runs_finished"]
    when = ", ".join("never" if i is None else f"from iteration {i}" for i in forgot["from_iteration"])
    introns = result["intron_share"]
    lines = [
        "Table II: closed-loop error on the first test of the best trade-off, by iteration",
        "",
        table(["iteration", *columns], rows),
        "",
        "Normalised: over the error of the model that never moves on the same flight; 1 is useless.",
        f"Forgetting: {forgot['runs']} of {finished} runs ({when}); {forgot['definition']}.",
        (
            f"Introns: {'–' if introns is None else f'{100 * introns:.0f} %'} of the code, mean over"
            " iterations and runs."
        ),
        f"Generations with the non-dominated set at its cap: {result['capped_generations']}.",
        *[f"The paper: {remark}." for remark in result["paper"]["remarks"]],
    ]
    return "\n".join(lines)
