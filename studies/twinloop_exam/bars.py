"""The bars that the preset `default` must reach, each with what was measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop_exam.measures import number
from twinloop_exam.results import Results, spread

Verdict = tuple[str, bool] | None
"""What was measured and whether the bar is met; None if it was not measured."""
OURS = "ours"
GOALS = (OURS, "ours-model", "ours-control")
"""Ours, for whatever its flights are."""
QUADROTORS = ("quadrotor-0", "quadrotor", "quadrotor-noisy", "quadrotor-harsh")


@dataclass(frozen=True)
class Bar:
    """One bar.

    Args:
        system: name.
        text: what is measured, and after how many experiments.
        limit: the bar as text.
        judge: measures it.
    """

    system: str
    text: str
    limit: str
    judge: Callable[[Results], Verdict]


def held_out(system: str, k: int, median: float, tail: float | None = None, learner: str = OURS) -> Bar:
    """Held-out normalised error after Υ0 + k, median over seeds of the per-seed median (and 90th percentile).

    Args:
        system: name.
        k: experiments after Υ0.
        median: limit of the median.
        tail: limit of the 90th percentile; None: there is none.
        learner: name.
    """

    def judge(results: Results) -> Verdict:
        middle = spread(results.values(system, learner, "error_median", k))
        upper = spread(results.values(system, learner, "error_p90", k))
        if middle is None or upper is None:
            return None
        met = middle.median <= median and (tail is None or upper.median <= tail)
        text = number(middle.median, 2) + ("" if tail is None else f" / {number(upper.median, 2)}")
        return f"{text} ({middle.seeds} seeds)", met

    limit = f"≤ {median:.0e}" + ("" if tail is None else f" / {tail:.0e}")
    return Bar(system, f"held-out error of {learner} after Υ0 + {k}", limit, judge)


def no_forgetting(system: str) -> Bar:
    """From Υ0 + 2 on: never above max(2 × best so far, 1e-5) for the median, 1e-4 for any seed."""

    def judge(results: Results) -> Verdict:
        ks = [k for k in results.experiments(system, OURS) if k >= 2]
        best, worst_ratio, worst_seed = np.inf, 0.0, 0.0
        for k in ks:
            found = spread(results.values(system, OURS, "error_median", k))
            if found is None:
                continue
            if np.isfinite(best):
                worst_ratio = max(worst_ratio, found.median / max(2.0 * best, 1e-5))
            best, worst_seed = min(best, found.median), max(worst_seed, found.most)
        if len(ks) < 2:
            return None
        ratio = f"{worst_ratio:.2g} of the bar" if np.isfinite(worst_ratio) else "diverges"
        text = f"{ratio}, worst seed {number(worst_seed, 2)} (to k = {ks[-1]})"
        return text, worst_ratio <= 1.0 and worst_seed <= 1e-4

    return Bar(
        system,
        "from Υ0 + 2 to Υ0 + 20: median over seeds; any seed",
        "max(2 × best so far, 1e-5); 1e-4",
        judge,
    )


def near_optimum(system: str, k: int, factor: float, share: float) -> Bar:
    """True quality of the controller to fly, against CMA-ES on the true system, in a share of the seeds."""

    def judge(results: Results) -> Verdict:
        bar = results.values(system, "optimum", "quality")
        found = list(results.values(system, OURS, "quality", k).values())
        if not bar or not found:
            return None
        ratios = np.array(found) / next(iter(bar.values()))
        met = float(np.mean(ratios <= factor))
        return f"{100 * met:.0f} % of {len(found)} seeds, median {np.median(ratios):.3g} ×", met >= share

    return Bar(
        system,
        f"controller to fly after Υ0 + {k}, over that of CMA-ES on the true plant",
        f"≤ {factor:g} × in {100 * share:.0f} %",
        judge,
    )


def flown_near_optimum(system: str, k: int, factor: float, worst: float) -> Bar:
    """The best flight so far, against the optimum: median and worst seed."""

    def judge(results: Results) -> Verdict:
        bar = results.values(system, "optimum", "quality")
        flown = [results.values(system, OURS, "flown_quality", number) for number in range(k + 1)]
        if not bar or not flown[-1]:
            return None
        best = [min(run[seed] for run in flown if seed in run) for seed in flown[-1]]
        ratios = np.array(best) / next(iter(bar.values()))
        met = float(np.median(ratios)) <= factor and float(ratios.max()) <= worst
        return f"{np.median(ratios):.3g} ×, worst seed {ratios.max():.3g} × ({len(best)} seeds)", met

    return Bar(
        system,
        f"best flown up to Υ0 + {k}, over the best of CMA-ES with 500 flights",
        f"≤ {factor:g} ×, worst seed ≤ {worst:g} ×",
        judge,
    )


def better_than_first(system: str) -> Bar:
    """Every flight after Υ0 at least as good as Υ0's."""

    def judge(results: Results) -> Verdict:
        first = results.values(system, OURS, "flown_quality", 0)
        worse = total = 0
        for row in results.rows(system, OURS):
            value = row.measures.get("flown_quality")
            if row.k and value is not None and row.address.seed in first:
                total, worse = total + 1, worse + (value > first[row.address.seed])
        return None if total == 0 else (f"{worse} of {total} worse", worse == 0)

    return Bar(system, "flights after Υ0 worse than C0's", "0", judge)


def growth(system: str) -> Bar:
    """Number of terms from Υ0 + 2 to Υ0 + 10."""

    def judge(results: Results) -> Verdict:
        before = results.values(system, OURS, "terms", 2)
        after = results.values(system, OURS, "terms", 10)
        ratios = [after[seed] / max(1.0, before[seed]) for seed in after if seed in before]
        found = spread(ratios)
        return None if found is None else (f"{found.median:.3g} × ({found.seeds} seeds)", found.median <= 1.2)

    return Bar(system, "terms after Υ0 + 10 over those after Υ0 + 2", "≤ 1.2 ×", judge)


def safe(system: str) -> Bar:
    """Experiments that left the envelope, whatever the flights were for."""

    def judge(results: Results) -> Verdict:
        found = [left for who in GOALS for left in results.all_values(system, who, "violated")]
        return None if not found else (f"{sum(found):.0f} of {len(found)}", sum(found) == 0.0)

    return Bar(system, "experiments that left the envelope, for any goal", "0", judge)


def quick(system: str) -> Bar:
    """The slowest `ask`."""
    limit = 10.0 if system in QUADROTORS else 60.0

    def judge(results: Results) -> Verdict:
        found = results.all_values(system, OURS, "ask_seconds")
        return None if not found else (f"{max(found):.3g} s", max(found) <= limit)

    return Bar(system, "slowest ask", f"≤ {limit:g} s", judge)


def calibrated(system: str) -> Bar:
    """Share of the next flight's samples inside the band that was foretold."""

    def judge(results: Results) -> Verdict:
        found = results.all_values(system, OURS, "coverage")
        share = float(np.mean(found)) if found else np.nan
        return None if not found else (f"{100 * share:.0f} % ({len(found)} flights)", 0.80 <= share <= 0.97)

    return Bar(system, "samples inside the 90 % band, of flights not learnt yet", "80 to 97 %", judge)


def _all(systems: Sequence[str]) -> list[Bar]:
    of_each = [[growth(name), safe(name), quick(name), calibrated(name)] for name in systems]
    return [bar for bars in of_each for bar in bars]


def _vehicle(system: str) -> list[Bar]:
    return [
        flown_near_optimum(system, 2, 1.15, 1.5),
        flown_near_optimum(system, 4, 1.05, 1.5),
        held_out(system, 4, 1e-3, learner="ours-model"),
        held_out(system, 4, 1e-2, learner="ours-control"),
    ]


BARS: tuple[Bar, ...] = (
    held_out("quadrotor", 1, 1e-4, 1e-3),
    held_out("quadrotor", 2, 1e-5, 1e-4),
    no_forgetting("quadrotor"),
    near_optimum("quadrotor", 1, 1.3, 0.9),
    better_than_first("quadrotor"),
    held_out("quadrotor-noisy", 4, 1e-4, 1e-3),
    held_out("quadrotor", 4, 1e-3, learner="ours-no-prior"),
    *_vehicle("rotorpy"),
    *_vehicle("quadrotor-harsh"),
    *_all((*QUADROTORS, "rotorpy")),
)
"""All bars, in the order in which they were set."""
