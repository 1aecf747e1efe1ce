"""What ideas buy: campaigns with one idea switched off beside the whole preset's, on the same plants and seeds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinloop_exam.ablations import ABLATIONS
from twinloop_exam.tables import Table
from twinloop_exam.zoo.bars import best_flown, number
from twinloop_exam.zoo.campaign import Measured

BY_LUCK = 0.05
"""Chance of as one-sided a count, if the idea did nothing, up to which it is believed to do something."""
Pair = tuple[Measured, Measured]
"""A campaign of the whole preset, and the same without the idea."""


@dataclass(frozen=True)
class Measure:
    """What is compared; lower is better.

    Args:
        name: a word for it, in JSON.
        text: what it is.
        of: measures it on a campaign; not a number where it cannot be.
        alike: share by which two campaigns may differ and count as alike.
    """

    name: str
    text: str
    of: Callable[[Measured], float]
    alike: float


def _flown(campaign: Measured) -> float:
    """Best flown after three flights, over the optimum; of a campaign that failed, of those that it made."""
    return best_flown(campaign, 3) if campaign["flights_asked"] >= 3 else math.nan


def _error(campaign: Measured) -> float:
    """Held-out error after five flights; infinite where the campaign failed before."""
    if len(campaign["flights"]) < 5:
        failed = campaign["failure"] is not None and campaign["flights_asked"] >= 5
        return math.inf if failed else math.nan
    return number(campaign["flights"][4].get("error"))


def _seconds(campaign: Measured) -> float:
    """CPU time of an ask, mean of a campaign."""
    asked = [row["ask_seconds"] for row in campaign["flights"] if "ask_seconds" in row]
    return float(np.mean(asked)) if asked else math.nan


MEASURES = (
    Measure("flown", "best flown after 3", _flown, alike=0.001),
    Measure("error", "held-out error after 5", _error, alike=0.01),
    Measure("seconds", "CPU of an ask", _seconds, alike=0.1),
)


@dataclass(frozen=True)
class Bought:
    """How a measure differs between campaigns without an idea and with it.

    Args:
        ratio: median of without over with; not a number where nothing was measured.
        better: pairs that are better with the idea.
        worse: pairs that are worse with it.
        pairs: in which it was measured.
    """

    ratio: float
    better: int
    worse: int
    pairs: int

    @property
    def chance(self) -> float:
        """Of at least as one-sided a count if the idea did nothing."""
        return sign_test(self.better, self.worse)

    @property
    def verdict(self) -> str:
        """What the paired sign test says."""
        if self.chance > BY_LUCK:
            return "no difference seen"
        return "buys" if self.better > self.worse else "costs"


def sign_test(better: int, worse: int) -> float:
    """Two-sided chance that at least as many of some pairs fall to one side as the larger number, each by a fair coin.

    Args:
        better: pairs on one side; those that are alike count on neither.
        worse: on the other.
    """
    pairs = better + worse
    tail = sum(math.comb(pairs, k) for k in range(min(better, worse) + 1))
    return min(1.0, 2.0 * tail / 2.0**pairs)


def bought(pairs: Iterable[Pair], measure: Measure) -> Bought:
    """How campaigns differ without an idea.

    Args:
        pairs: of campaigns on the same plant with the same seed.
        measure: what is compared.
    """
    ratios = [ratio for pair in pairs if not math.isnan(ratio := ratio_of(pair, measure))]
    better = sum(ratio > 1.0 + measure.alike for ratio in ratios)
    worse = sum(ratio * (1.0 + measure.alike) < 1.0 for ratio in ratios)
    return Bought(float(np.median(ratios)) if ratios else math.nan, better, worse, len(ratios))


def ratio_of(pair: Pair, measure: Measure) -> float:
    """Without over with; 1 where both are infinite or nothing, not a number where one was not measured.

    Args:
        pair: of campaigns on the same plant with the same seed.
        measure: what is compared.
    """
    whole, without = (measure.of(campaign) for campaign in pair)
    if math.isnan(whole) or math.isnan(without):
        return math.nan
    if whole == without:
        return 1.0
    return without / whole if whole > 0.0 else math.inf


def pairs_of(name: str, campaigns: Sequence[Measured]) -> list[Pair]:
    """Campaigns without an idea, each behind that of the whole preset with as many flights, where there are both.

    Args:
        name: of the ablation.
        campaigns: as `campaign.fly` gives them, in any order.
    """

    def place(campaign: Measured) -> tuple[str, int, int]:
        return campaign["plant"], campaign["seed"], campaign["flights_asked"]

    whole = {place(one): one for one in campaigns if not one.get("without")}
    return [
        (whole[place(one)], one) for one in campaigns if one.get("without") == name and place(one) in whole
    ]


def compared(names: Iterable[str], campaigns: Sequence[Measured]) -> list[dict[str, Any]]:
    """Every comparison as plain values; infinite ratios as "inf".

    Args:
        names: of ablations.
        campaigns: with them and without.
    """
    return [_row(name, pairs_of(name, campaigns)) for name in names]


def _row(name: str, pairs: Sequence[Pair]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "ablation": name,
        "campaigns": len(pairs),
        "changed": sum(_flights(whole) != _flights(without) for whole, without in pairs),
        "missed_most_on": missed_most_on(pairs),
    }
    for measure in MEASURES:
        found = bought(pairs, measure)
        row[measure.name] = {
            "ratio": _plain(found.ratio),
            "better": found.better,
            "worse": found.worse,
            "pairs": found.pairs,
            "chance": found.chance,
            "verdict": found.verdict if found.pairs else None,
        }
    return row


def _flights(campaign: Measured) -> list[Any]:
    """What was flown and how well the twin knew it, without the time that it took."""
    return [(row.get("gains"), row["flown"], row.get("error")) for row in campaign["flights"]]


def missed_most_on(pairs: Sequence[Pair]) -> str | None:
    """The plant on which flights are the worst without an idea, in the median over seeds; None where none are worse.

    Args:
        pairs: of campaigns.
    """
    flown = MEASURES[0]
    of_plants = {plant: bought((pair for pair in pairs if pair[0]["plant"] == plant), flown).ratio
                 for plant in dict.fromkeys(whole["plant"] for whole, _ in pairs)}  # fmt: skip
    worse = {plant: ratio for plant, ratio in of_plants.items() if ratio > 1.0 + flown.alike}
    return max(worse, key=lambda plant: worse[plant]) if worse else None


def _plain(ratio: float) -> float | str | None:
    return None if math.isnan(ratio) else "inf" if math.isinf(ratio) else ratio


def table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """One line an ablation.

    Args:
        title: of the table.
        rows: as `compared` gives them.
    """
    head = ["without", "campaigns"]
    for measure in MEASURES:
        head += [f"{measure.text}, without / with", ""]
    lines = []
    for row in rows:
        cells = [
            f"{row['ablation']}: {ABLATIONS[row['ablation']].without}",
            f"{row['campaigns']}, {row['changed']} changed",
        ]
        for measure in MEASURES:
            cells += shown(row[measure.name])
        lines.append([*cells, row["missed_most_on"] or "–"])
    margins = ", ".join(f"{100.0 * measure.alike:g} %" for measure in MEASURES)
    notes = (
        "Medians over campaigns on the same plants with the same seeds; above 1 the idea is missed. Then the shares of"
        f" campaigns that are better and worse with it, by more than {margins}.",
        f"Verdicts: paired sign test, two-sided, at {100.0 * BY_LUCK:g} %. Of twenty ideas that do nothing one may"
        " seem to do something.",
    )
    return Table(title, [*head, "missed most on"], lines, notes)


def shown(found: Mapping[str, Any]) -> list[str]:
    """Ratio with shares, and verdict, of one measure of a row that `compared` gives."""
    if not found["pairs"]:
        return ["–", "–"]
    better, worse = (f"{100.0 * found[side] / found['pairs']:.0f} %" for side in ("better", "worse"))
    return [f"{number(found['ratio']):.3g}; {better} better, {worse} worse", found["verdict"]]
