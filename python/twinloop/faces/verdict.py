"""The verdict on a twin, its controller and what comes next: the one that report, terminal and JSON all give."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinloop._ground.texts import in_unit
from twinloop.campaign.examination.check import Check, Checks
from twinloop.campaign.examination.checking import COLOURED
from twinloop.campaign.examination.examination import Examination
from twinloop.campaign.identify_and_plan.track_record import SURE
from twinloop.faces import answers
from twinloop.faces.figures.units import words
from twinloop.faces.report.tables.table import shown_spread, shown_value
from twinloop.faces.text.words import every, flown_words, quality_words

ALL_CHECKS = ("checks", "all checks")
"""Where all checks stand, and what to call it."""
EVIDENCE = {
    "follows": "flights",
    "unseen-flight": "unseen",
    "band": "unseen",
    "quality": "qualities",
    "whiteness": "autocorrelation",
    "commands": "crosscorrelation",
    "remarks": "remarks",
    "movement": "data",
    "controller": "gains-table",
    "stable": "margins",
    "sensitivity": "margins",
    "delay": "margins",
    "envelope": "envelope",
    "flown": "step",
    "target": "step",
}
"""Where on the page each check can be looked at."""


def evidence(found: Examination) -> dict[str, str]:
    """Where on the page of a campaign each check can be looked at.

    Args:
        found: its examination; where it has no margins, there is no table of them.
    """
    return {
        name: place for name, place in EVIDENCE.items() if place != "margins" or found.margins is not None
    }


@dataclass(frozen=True)
class Sentence:
    """One sentence of the verdict.

    Args:
        subject: "Twin", "Controller" or "Next".
        answer: in a word or two.
        good: whether it says yes; None where it says neither.
        text: with its numbers.
        links: where the evidence stands, and what to call it.
        reasons: against the subject, a sentence each, the strongest first.
    """

    subject: str
    answer: str
    good: bool | None
    text: str
    links: tuple[tuple[str, str], ...]
    reasons: tuple[str, ...] = ()


def verdict(
    found: Examination, checks: Checks, result: Mapping[str, Any]
) -> tuple[Sentence, Sentence, Sentence]:
    """Of a campaign.

    Args:
        found: its examination.
        checks: of it.
        result: its `twinloop.faces.result.summary`.
    """
    return _of_twin(found, checks), _of_controller(found, checks, result), of_next(found, checks, result)


def verdict_facts(sentences: Sequence[Sentence]) -> dict[str, object]:
    """A verdict for programs, and for those who word it in less space than a page has.

    Args:
        sentences: of a `verdict`.

    Returns:
        By subject: `answer`, `good`, `reasons`.
    """
    return {
        each.subject.lower(): {"answer": each.answer, "good": each.good, "reasons": list(each.reasons)}
        for each in sentences
    }


PLAIN = {
    "follows": "in free run it does not follow the experiments that it was learnt from",
    "remarks": "its remarks are serious",
    "unseen-flight": "it did not predict the last unseen flight",
    "band": "too many readings of the last unseen flight were outside its band",
    "quality": "the last quality that it predicted was far off",
    "whiteness": "its residuals are correlated in time",
    "commands": "its residuals are correlated with the commands",
}
"""What each check of the twin means where it fails."""


def _of_twin(found: Examination, checks: Checks) -> Sentence:
    failed = [check for check in checks.failed if check.subject == "twin"]
    unseen = _unseen(found)
    if failed:
        lacks = [check for check in failed if check.name in ("whiteness", "commands")]
        text = "; ".join(
            "it has not predicted an unseen flight yet"
            if check.name == "unseen-flight" and not found.unseen
            else PLAIN[check.name]
            for check in failed
        )
        if lacks:
            share = max(check.value or 0.0 for check in lacks)
            text += (
                f" (up to {100.0 * share:.0f} % of the correlations are beyond their 99 % limits): it lacks"
            )
            text += " an effect"
        return Sentence(
            "Twin", answers.DO_NOT_TRUST, False, f"{_capital(text)}.{unseen}{_foretold(found)}", _links(found, failed),
            _against_twin(found, failed),
        )  # fmt: skip
    text = unseen.strip()
    own, causes = found.autocorrelation, found.crosscorrelation
    if own is not None and causes is not None:
        text += (
            f" Its residuals are hardly correlated: {100.0 * own.outside:.0f} % of the correlations in time and"
            f" {100.0 * causes.outside:.0f} % of those with the commands are beyond their 99 % limits, where"
            f" {100.0 * COLOURED:.0f} % are allowed."
        )
    return Sentence(
        "Twin", answers.TRUST, True, f"{text} {_scope(found)}".strip(),
        (("unseen", "unseen flight"), ("ranges", "flown range"), ("crosscorrelation", "residuals"),
         ALL_CHECKS),
    )  # fmt: skip


def _against_twin(found: Examination, failed: Sequence[Check]) -> tuple[str, ...]:
    """Each serious remark, which says what to do, then each other check that fails, in the order of the checks."""
    remarks = [str(remark) for remark in found.twin.remarks if remark.serious]
    known = [check for check in failed if check.name == "remarks"]
    return (*(remarks if known else ()), *(check.sentence for check in failed if check not in known))


def _scope(found: Examination) -> str:
    """For what the twin may be trusted: as long and as far as was flown."""
    longest = max(float(run.trajectory.t[-1] - run.trajectory.t[0]) for run in found.experiments)
    length = f"{longest:.3g}" if longest < 1000.0 else f"{longest:.0f}"
    held = f"This holds within the flown range, for flights of up to {length} s"
    if found.beyond is None:
        return f"{held}."
    share = f"{100.0 * found.beyond:.0f}"
    leaves = "stays inside" if share == "0" else f"leaves it for {share} % of its time"
    return f"{held}; the task under the controller to fly {leaves}."


def _unseen(found: Examination) -> str:
    """How well it predicted the last flight before learning it."""
    if not found.unseen:
        return ""
    last = found.unseen[-1]
    which = f"For {found.names[last.place]}, which it had not learnt from,"
    if not np.isfinite(last.rmse).all():
        return f" {which} its free run diverged."
    fits = np.where(np.isfinite(last.fit), last.fit, np.inf)
    worst = int(np.argmin(fits))
    if not np.isfinite(fits[worst]):
        return ""
    inside = (
        ""
        if last.inside is None
        else f"; {100.0 * last.inside:.0f} % of the readings were inside its 90 % band"
    )
    state = words(found.signals.state_names[worst])
    pieces = ""
    if last.piece < last.flown.steps:
        pieces = f", begun again at a reading {every([last.piece * found.signals.dt])},"
    return f" {which} the lowest FIT of its free run{pieces} is {fits[worst]:.3g} %, for {state}{inside}."


def _foretold(found: Examination) -> str:
    """How often a quality came out as it was predicted, which a twin may be good for that fails elsewhere."""
    misses = found.quality_misses
    if not misses:
        return ""
    near = sum(abs(miss) <= SURE for miss in misses)
    if len(misses) == 1:
        came = "came" if near else "did not come"
        return f" The only quality that it predicted {came} within {SURE:g} of its spreads."
    return f" Of the {len(misses)} qualities that it predicted, {near} came within {SURE:g} of their spreads."


def _of_controller(found: Examination, checks: Checks, result: Mapping[str, Any]) -> Sentence:
    best, first = result["controller"], result["first_controller"]
    failed = [check for check in checks.failed if check.subject == "controller"]
    if best is None or found.best is None:
        return Sentence(
            "Controller", answers.NONE_TO_FLY, False, found.no_controller, (ALL_CHECKS,),
            (found.no_controller,),
        )  # fmt: skip
    measure = result["quality"]
    quality = quality_words(measure["kind"], measure["unit"]).rstrip(")")
    worth = f"{quality}{'; ' if measure['unit'] else ' ('}lower is better): {_predicted(found, best)}"
    worth += (
        f", {flown_words(found)}" if best["measured"] is None else f", {shown_value(best['measured'])} flown"
    )
    if first is not None and first["measured"] is not None:
        worth += f"; the first gains had {shown_value(first['measured'])}"
    margins = _margins(found)
    if failed:
        return Sentence(
            "Controller",
            answers.DO_NOT_FLY,
            False,
            f"{failed[0].sentence} {_capital(worth)}.{_off_target(found)}",
            _links(found, failed),
            tuple(check.sentence for check in failed),
        )
    if not checks.twin_passed:
        rests = "The prediction rests on a twin that is not to be trusted: rely on what was flown."
        text = f"{_capital(worth)}. {rests}"
        return Sentence(
            "Controller",
            answers.UNRELIABLE_PREDICTION,
            False,
            text,
            (("step", "step"), ("qualities", "flights")),
            (rests,),
        )
    off = _off_target(found)
    answer = answers.FLY if best["measured"] is None else answers.KEEP
    return Sentence(
        "Controller", f"{answer}{answers.MISSING_ITS_TARGET}" if off else answer, None if off else True,
        f"{_capital(worth)}.{off}{margins}",
        (("step", "step"), ("margins", "margins"), ("gains-table", "gains")),
    )  # fmt: skip


def _off_target(found: Examination) -> str:
    return f" {found.ending}" if found.ending is not None and found.ending.misses else ""


def _predicted(found: Examination, best: Mapping[str, Any]) -> str:
    if best["predicted"] is None:
        return "not predicted, as the twin diverges under these gains"
    if not found.twin.follows:
        return "not predicted, as the twin does not follow its flights"
    spread = best.get("spread")  # the preset paper gives none
    return (
        f"{shown_value(best['predicted'])}{'' if spread is None else f' ± {shown_spread(spread)}'} predicted"
    )


def _margins(found: Examination) -> str:
    if found.margins is None or not all(loop.stable for loop in found.margins.worst):
        return ""
    gain = min(loop.gain for loop in found.margins.worst)
    phase = math.degrees(min(loop.phase for loop in found.margins.worst))
    gain_words = (
        f"a gain margin of {20.0 * math.log10(gain):.0f} dB" if math.isfinite(gain) else "any gain margin"
    )
    phase_words = f"{phase:.0f}° of phase" if math.isfinite(phase) else "any phase"
    return (
        f" The worst of all loops over {found.margins.members} models keeps {gain_words} and {phase_words}."
    )


def of_next(found: Examination, checks: Checks, result: Mapping[str, Any]) -> Sentence:
    """What to do now.

    Args:
        found: the examination of the campaign.
        checks: of it.
        result: its `twinloop.faces.result.summary`.
    """
    advice, off = result.get("advice"), _off_target(found)
    if found.best is None:
        text = "There is no controller to fly: look into the checks that fail, and fly one that you trust."
        return _next(answers.FLY_ANOTHER_CONTROLLER, text, ALL_CHECKS, good=False)
    if advice is None:
        return _next(answers.YOU_DECIDE, "The preset paper does not say what another test would bring.")
    if not checks.twin_passed:
        text = (
            "Look into the checks that fail, then fly again where they point: the twin's estimate of what"
            " another flight would bring is no better than the twin."
        )
        return _next(answers.FIND_OUT, text, ALL_CHECKS, good=False)
    if advice["gain"] is not None and advice["stop"] is None and not advice["trusted"]:
        text = (
            "The twin cannot say what another flight would bring, since it did not follow its runs when that was"
            " estimated, or no command acts in it: look into the remarks, then fly another test."
        )
        return _next(answers.FLY_ANOTHER, text, ("remarks", "remarks"))
    failed = [check for check in checks.failed if check.subject == "controller"]
    if failed and (advice["stop"] or advice["gain"] == 0.0):
        return _next_of_failed(found, failed, off)
    if advice["gain"] is None:
        return _next(answers.ASK, "No flight was planned yet; ask for one to see what it would bring.")
    return _next_of_gain(advice, result["quality"]["unit"], off)


def _next_of_failed(found: Examination, failed: list[Check], off: str) -> Sentence:
    """What to do where the twin knows enough and its controller is not to be flown."""
    knows = "The twin knows enough: another flight would hardly improve the quality."
    links = _links(found, failed)
    if found.margins is None:
        text = f"{knows} But its controller could not be checked.{off} {found.no_margins}"
        return _next(answers.OTHER_TASK, text, *links)
    text = (
        f"{knows} What fails is the controller: {failed[0].name}. Begin again from these flights with {answers.CALMER}."
        f"{off}"
    )
    return _next(answers.CALMER_CONTROLLER, text, *links)


def _next_of_gain(advice: Mapping[str, Any], unit: str, off: str) -> Sentence:
    """What to do by how much another flight would improve the quality."""
    stop, good = (answers.STOP_OR_OTHER_TASK, None) if off else (answers.STOP, True)
    if advice["gain"] == 0.0:
        text = f"The models agree on what to fly: another flight would not improve the quality.{off}"
        return _next(stop, text, good=good)
    gain, scatter = (in_unit(_number(advice[name]), unit) for name in ("gain", "scatter"))
    if advice["stop"]:
        text = f"Another flight would improve the quality by {gain}; the same flight repeated scatters by {scatter}."
        return _next(stop, f"{text}{off}", good=good)
    text = f"Another flight may improve the quality by {gain}; one measurement scatters by {scatter}."
    return _next(answers.FLY_ANOTHER, text)


def _next(answer: str, text: str, *links: tuple[str, str], good: bool | None = None) -> Sentence:
    return Sentence("Next", answer, good, text, (*links, ("next", "next experiment")))


def _links(found: Examination, failed: list[Check]) -> tuple[tuple[str, str], ...]:
    places = evidence(found)
    links = [
        (places[check.name], check.name.replace("-", " ")) for check in failed[:3] if check.name in places
    ]
    return (*links, ALL_CHECKS)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
