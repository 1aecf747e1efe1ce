"""The bars that the preset `default` must reach on plants that nobody tuned it for, each with what was measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinloop_exam.tables import Table
from twinloop_exam.zoo.campaign import Measured

SPREADS = 2.0
"""Within so many of them a flight should be."""
LOST = 1.2
"""Best flown over the optimum above which the report has to say that the twin is not believed."""


@dataclass(frozen=True)
class Found:
    """What was measured for one bar.

    Args:
        text: of it.
        met: whether the bar is; None where nothing could be measured, or there is none.
        value: the number behind it.
    """

    text: str
    met: bool | None
    value: float | None


@dataclass(frozen=True)
class Bar:
    """One bar.

    Args:
        text: what is measured.
        limit: the bar as text.
        judge: measures it on campaigns.
    """

    text: str
    limit: str
    judge: Callable[[Sequence[Measured]], Found]


def number(value: Any) -> float:
    """A number of a campaign's file: "inf" is infinite, nothing is not a number."""
    return math.nan if value is None else float(value)


def best_flown(campaign: Measured, flights: int) -> float:
    """The best quality on true states among the first flights, over that of the optimum under the same noise.

    It is infinite where no flight ran to its end.
    """
    flown = [
        number(row["flown"])
        for row in campaign["flights"][:flights]
        if row["ended"] == "completed" and row["flown"] is not None
    ]
    return min(flown, default=math.inf) / float(campaign["optimum_under_noise"])


def best_gains(campaign: Measured, flights: int) -> float:
    """The same of the gains alone and the optimum, both flown without noise, disturbances and excitation."""
    flown = [
        number(row["gains_quality"]) for row in campaign["flights"][:flights] if row["flown"] is not None
    ]
    return min(flown, default=math.inf) / float(campaign["optimum"])


def _share(hits: Iterable[bool]) -> tuple[float, int]:
    """The share of those that are true, and how many there are."""
    listed = list(hits)
    return (sum(listed) / len(listed) if listed else math.nan), len(listed)


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


_NOTHING = Found("–", None, None)


def _flown(flights: int, limit: float) -> Bar:
    def judge(campaigns: Sequence[Measured]) -> Found:
        ratios = [best_flown(one, flights) for one in campaigns if len(one["flights"]) >= flights]
        share, count = _share(ratio <= limit for ratio in ratios)
        if not count:
            return _NOTHING
        middle = sorted(ratios)[count // 2]
        alone, _ = _share(
            best_gains(one, flights) <= limit for one in campaigns if len(one["flights"]) >= flights
        )
        text = f"{_percent(share)} of {count}; median {middle:.3g}; of the gains alone {_percent(alone)}"
        return Found(text, share >= 0.8, share)

    text = f"best flown on true states, over the optimum, after {flights} flights"
    return Bar(text, f"≤ {limit} in 80 %", judge)


def believed(row: Measured) -> bool:
    """Whether nothing is said against the twin after a flight."""
    return bool(row["follows"]) and not row["serious"]


def _lost(campaigns: Sequence[Measured]) -> Found:
    lost = [one for one in campaigns if len(one["flights"]) >= 5 and best_flown(one, 5) > LOST]
    silent = [one for one in lost if believed(one["flights"][4])]
    share = len(silent) / len(lost) if lost else 0.0
    return Found(f"{len(lost)} campaigns, {len(silent)} silent", not silent, share)


def _given(campaigns: Sequence[Measured], flown: str = "gains_quality", given: str = "best_test") -> Found:
    hits: list[bool] = []
    for one in campaigns:
        best = math.inf
        for row in one["flights"]:
            if row["ended"] == "completed" and not row["left"]:
                best = min(best, number(row.get(flown)))
            if math.isfinite(best):
                hits.append(number(row[given]) <= 1.01 * best)
    share, count = _share(hits)
    return Found(f"{_percent(share)} of {count}", share >= 0.97, share) if count else _NOTHING


def _given_in_noise(campaigns: Sequence[Measured]) -> Found:
    return _given(campaigns, "gains_in_noise", "best_test_in_noise")


def _predictions(campaigns: Sequence[Measured]) -> Iterator[tuple[float, float, float]]:
    """Predicted and measured quality and the spread, from the third flight on."""
    for one in campaigns:
        for row in one["flights"][2:]:
            if row["measured"] is not None and row["predicted"] is not None and row["spread"] is not None:
                yield number(row["predicted"]), number(row["measured"]), number(row["spread"])


def _within(campaigns: Sequence[Measured]) -> Found:
    # Who foretells that a flight diverges, and sees it land, has foretold nothing.
    share, count = _share(
        math.isfinite(p) and abs(p - m) <= SPREADS * s for p, m, s in _predictions(campaigns)
    )
    return Found(f"{_percent(share)} of {count}", 0.85 <= share <= 0.98, share) if count else _NOTHING


def _bias(campaigns: Sequence[Measured]) -> Found:
    off = sorted((p - m) / m for p, m, _ in _predictions(campaigns))
    if not off:
        return _NOTHING
    middle = off[len(off) // 2]
    return Found(f"{100.0 * middle:+.2g} %", abs(middle) <= 0.005, middle)


def _learnt(one: Measured, name: str = "error") -> float:
    """A held-out error after five flights over that after two."""
    early, late = (number(one["flights"][k].get(name)) for k in (1, 4))
    if math.isinf(early):
        return 1.0 if math.isinf(late) else 0.0
    return late / early if early > 0.0 else math.nan


def _learning(campaigns: Sequence[Measured], name: str = "error") -> Found:
    ratios = sorted(
        ratio for one in campaigns if len(one["flights"]) >= 5 and not math.isnan(ratio := _learnt(one, name))
    )
    if not ratios:
        return _NOTHING
    middle = ratios[len(ratios) // 2]
    return Found(f"{middle:.2g} (median of {len(ratios)})", middle <= 0.5, middle)


def _learning_repeated(campaigns: Sequence[Measured]) -> Found:
    return _learning(campaigns, "error_repeated")


def _forgetting(campaigns: Sequence[Measured]) -> Found:
    whole = [one for one in campaigns if len(one["flights"]) >= 5]
    worse = [one["flights"][4] for one in whole if _learnt(one) > 2.0]
    # Of gains that have not flown it is said where what is learnt is still open.
    silent = sum(believed(row) and "elsewhere" not in row.get("noted", ()) for row in worse)
    return Found(f"{len(worse)} of {len(whole)}, {silent} silent", silent == 0, float(silent))


def _diverging(campaigns: Sequence[Measured]) -> Found:
    whole = [one for one in campaigns if len(one["flights"]) >= 5 and one["held_out"][0]]
    lost = sum(one["flights"][4]["diverged"] for one in whole)
    count = sum(one["held_out"][0] for one in whole)
    if not count:
        return _NOTHING
    return Found(f"{100.0 * lost / count:.1f} % of {count}", lost / count <= 0.02, lost / count)


def _rows(campaigns: Sequence[Measured]) -> list[Measured]:
    return [row for one in campaigns for row in one["flights"] if "found" in row]


def _false(campaigns: Sequence[Measured]) -> Found:
    rows = _rows(campaigns)
    if not rows:
        return _NOTHING
    share, count = _share(bool(row["false"]) for row in rows)
    kinds = {name for row in rows for name in row["false"]}
    each = ", ".join(f"{name} {sum(name in row['false'] for row in rows)}" for name in sorted(kinds))
    return Found(
        f"{_percent(share)} of {count} lessons" + (f": {each}" if each else ""), share <= 0.03, share
    )


def _empty(campaigns: Sequence[Measured]) -> Found:
    rows = _rows(campaigns)
    count = sum(bool(row["empty"]) for row in rows)
    return Found(f"{count} of {len(rows)} lessons", count == 0, float(count)) if rows else _NOTHING


def _missed(campaigns: Sequence[Measured], name: str = "missed") -> Found:
    missed, others = (
        [row for row in _rows(campaigns) if name in row and (number(row[name]) > 1.0) is off]
        for off in (True, False)
    )
    if not missed and not others:
        return _NOTHING
    share, count = _share(bool(row["serious"]) for row in missed)
    # A remark that is always made says nothing.
    falsely = sum("free-run" in row["serious"] for row in others)
    text = f"{_percent(share)} of {count}" if count else "none missed"
    return Found(f"{text}; said of {falsely} of {len(others)} that do not", share >= 0.95 or not count, share)


def _missed_repeated(campaigns: Sequence[Measured]) -> Found:
    return _missed(campaigns, "missed_repeated")


def _confident(campaigns: Sequence[Measured]) -> Found:
    bold = [
        one
        for one in campaigns
        if one.get("confident") and one["flights"] and number(one["flights"][-1]["missed"]) > 1.0
    ]
    return Found(f"{len(bold)} campaigns", not bold, float(len(bold)))


def _left(campaigns: Sequence[Measured]) -> Found:
    rows = [row for one in campaigns for row in one["flights"][1:]]
    left = sum(bool(row["left"]) for row in rows)
    return Found(f"{left} of {len(rows)} flights", left == 0, float(left)) if rows else _NOTHING


def _asks(campaigns: Sequence[Measured]) -> Found:
    seconds = [row["ask_seconds"] for row in _rows(campaigns) if "ask_seconds" in row]
    if not seconds:
        return _NOTHING
    middle, most = float(np.median(seconds)), max(seconds)
    return Found(f"median {middle:.1f} s, largest {most:.0f} s", middle <= 10.0 and most <= 60.0, middle)


BARS: tuple[Bar, ...] = (
    _flown(3, 1.05),
    _flown(5, 1.02),
    Bar(f"above {LOST} after 5: nothing said against the twin", "0", _lost),
    Bar("true quality of `best_test` at most 1.01 × the best gains flown so far", "97 %", _given),
    Bar("the same under the plant's noise and disturbances", "97 %", _given_in_noise),
    Bar("flown within two spreads of predicted, from the third flight on", "85 to 98 %", _within),
    Bar("median of (predicted − flown) / flown, from the third flight on", "± 0.5 %", _bias),
    Bar("held-out error after 5 flights over that after 2", "≤ 0.5", _learning),
    Bar("the same of flights that the plant repeats from a start that is hardly off", "≤ 0.5", _learning_repeated),
    Bar("held-out error more than doubled from 2 to 5 flights, unsaid", "0", _forgetting),
    Bar("held-out flights that the plant survives and the twin does not, after 5", "≤ 2 %", _diverging),
    Bar("lessons with an actuator, offset, hidden state or lasting disturbance where there is none", "≤ 3 %", _false),
    Bar("lessons with an empty equation of a state that moves", "0", _empty),
    Bar("free run misses its own flights: a serious remark", "95 %", _missed),
    Bar("the same of flights that the plant repeats: a serious remark", "95 %", _missed_repeated),
    Bar("free run misses, and the report says that models agree", "0", _confident),
    Bar("flights that left the envelope, after the first", "0", _left),
    Bar("CPU time of one ask", "median ≤ 10 s, largest ≤ 60 s", _asks),
)  # fmt: skip


def judged(campaigns: Sequence[Measured]) -> list[dict[str, Any]]:
    """Every bar as plain values.

    Args:
        campaigns: as `campaign.fly` gives them; those that failed count with the flights that they made.
    """
    found = [(bar, bar.judge(campaigns)) for bar in BARS]
    return [
        {"measure": bar.text, "bar": bar.limit, "measured": one.text, "value": one.value, "met": one.met}
        for bar, one in found
    ]


def worst(campaigns: Sequence[Measured], count: int = 3) -> list[Measured]:
    """The campaigns that end furthest from the optimum; among equals, those whose twin is the furthest off."""

    def rank(one: Measured) -> tuple[float, float]:
        error = number(one["flights"][-1].get("error")) if one["flights"] else math.inf
        return best_flown(one, len(one["flights"])), math.inf if math.isnan(error) else error

    return sorted(campaigns, key=rank, reverse=True)[:count]


def tables(title: str, campaigns: Sequence[Measured]) -> list[Table]:
    """The bars, the worst campaigns, and one line a plant.

    Args:
        title: of the first table.
        campaigns: as `campaign.fly` gives them.
    """
    verdicts = {True: "met", False: "not met", None: "–"}
    # Files of earlier versions lack an error: its column is there where it has no gaps.
    errors = [name for name in _ERRORS if all(name in row for row in _rows(campaigns))]
    bars = [[one["measure"], one["bar"], one["measured"], verdicts[one["met"]]] for one in judged(campaigns)]
    return [
        Table(title, ["measure", "bar", "measured", ""], bars),
        _of_campaigns("The three worst campaigns", worst(campaigns), errors),
        _of_campaigns("Every campaign", campaigns, errors),
    ]


_ERRORS = {
    "error": "held-out error after 2, 5",
    "error_inside": "inside the envelope",
    "error_repeated": "that the plant repeats",
}
"""Held-out errors of a campaign's file, with the heads of their columns."""


def _of_campaigns(title: str, campaigns: Sequence[Measured], errors: Sequence[str]) -> Table:
    head = [
        "campaign", "flown / optimum after 1, 3, 5", *(_ERRORS[name] for name in errors), "diverged", "free run",
        "falsely found", "serious remarks",
    ]  # fmt: skip
    return Table(title, head, [_line(one, errors) for one in campaigns])


def _line(one: Measured, errors: Sequence[str]) -> list[str]:
    flights = one["flights"]
    if not flights:
        return [f"{one['plant']}, seed {one['seed']}", *["–"] * (4 + len(errors)), str(one["failure"])]
    last = flights[-1]
    return [
        f"{one['plant']}, seed {one['seed']}",
        ", ".join(f"{best_flown(one, k):.3f}" for k in (1, 3, 5) if k <= len(flights)),
        *(
            ", ".join(f"{number(flights[k].get(name)):.2g}" for k in (1, 4) if k < len(flights))
            for name in errors
        ),
        f"{last.get('diverged', '–')} of {one['held_out'][0]}",
        f"{number(last.get('missed')):.2g}",
        ", ".join(last.get("false", [])),
        ", ".join(last.get("serious", [])) + (f"; {one['failure']}" if one["failure"] else ""),
    ]
