"""The checks of a campaign: whether its twin can be trusted, and its controller flown."""

from __future__ import annotations

import math
from collections.abc import Iterator

from twinloop._experiment.envelope import is_bounded, outside, usages_of
from twinloop._ground.texts import two_digits
from twinloop._ground.times import shown_time
from twinloop.campaign.data.readings import ONLY_NOISE, still
from twinloop.campaign.examination.check import Check, Checks
from twinloop.campaign.examination.delay_borne import MOST
from twinloop.campaign.examination.examination import Examination
from twinloop.campaign.examination.reaching import REACHED, Ending
from twinloop.campaign.examination.unseen import LEFT
from twinloop.law.linear.margins import LoopMargins
from twinloop.planning.leaving import risk_words
from twinloop.planning.proposal import Fared
from twinloop.test import Test

INSIDE = 0.75
"""Share of the readings of such a flight that are asked for inside the 90 % band."""
MISSES = 4.0
"""Spreads by which the last quality that was predicted may have missed."""
COLOURED = 0.1
"""Share of correlation coefficients that may lie beyond their 99 % limits."""
MOVED = 10.0
"""Standard deviations of its sensor that each state is to have moved by in some flight."""
SENSITIVITY = 2.0
"""Ms up to which a loop is taken for well damped (Åström and Murray 2008, section 12.2)."""
FRAGILE = 4.0
"""Ms above which a controller is not to be flown: a gain margin of 2.5 dB and 14° of phase are all that it promises."""
PERIODS = 1.0
"""Delay, in periods, that the loops have to bear beside their own: clocks, buses and schedulers are late by as much."""
RISK = 0.05
"""Probability of leaving the envelope up to which a controller is flown."""


def checks(found: Examination) -> Checks:
    """All checks of a campaign.

    Args:
        found: its examination.

    Returns:
        Those of the twin, then those of the controller.
    """
    return Checks((*_of_twin(found), *_of_controller(found)))


def _of_twin(found: Examination) -> Iterator[Check]:
    twin = found.twin
    yield _of_following(found)
    grave = [remark for remark in twin.remarks if remark.serious]
    yield Check(
        "remarks", "twin", float(len(grave)), 0.0, not grave, True,
        "There are no serious remarks on the data or the twin." if not grave else " ".join(str(each) for each in grave),
    )  # fmt: skip
    if found.movement is not None:
        state, most = found.movement
        yield Check(
            "movement", "twin", most, MOVED, most >= MOVED, False,
            f"The state that moved least in all flights, {state}, moved by {most:.3g} standard deviations"
            f" of its sensor's noise; below {MOVED:g} little can be learnt about it.",
        )  # fmt: skip
    yield from _of_unseen(found)
    yield from _of_innovations(found)


def _of_following(found: Examination) -> Check:
    """Whether the twin follows what it was learnt from; in noise, or at rest, there is nothing to follow."""
    twin, runs = found.twin, found.learnt
    rows = twin.errors[:runs]
    # A run that stays exactly where the readings stay has no error, whatever it is divided by.
    off = [0.0 if row.closed_loop == 0.0 else row.normalised for row in rows]
    worst = max(off, default=math.inf)
    learnt = f"the {runs} experiment{'s' * (runs != 1)} that it was learnt from"

    def check(passed: bool, sentence: str) -> Check:
        return Check("follows", "twin", worst, None, passed, True, sentence)

    if worst == 0.0 and all(still(each.trajectory) for each in found.experiments[:runs]):
        if twin.follows:
            return check(
                True,
                f"Nothing moves in {learnt}: the twin stays where the readings stay, and nothing can be learnt from"
                " them.",
            )
        return check(
            False,
            f"No reading moves in {learnt}, though commands do: there is nothing that a twin could follow.",
        )
    error = f"{_error(worst)} (0 is perfect, 1 a model that never moves)"
    if twin.follows and any(remark.code == ONLY_NOISE for remark in twin.remarks):
        return check(
            False, f"There is no motion beside noise that the twin could follow in {learnt}: {error}."
        )
    if twin.follows and 2 * sum(each >= 1.0 for each in off) > len(off):
        return check(
            False, f"In free run the twin follows {learnt} no better than a model that never moves: {error}."
        )
    return check(twin.follows, f"In free run the twin {_follows(twin.follows, worst)} {learnt}: {error}.")


def _follows(follows: bool, worst: float) -> str:
    if not follows:
        return "does not follow"
    return "follows" if worst <= 1.0 else "follows at least half of"


def _error(worst: float) -> str:
    return f"error at most {two_digits(worst)}" if math.isfinite(worst) else "on at least one it diverges"


def _of_unseen(found: Examination) -> Iterator[Check]:
    if not found.unseen:
        yield Check(
            "unseen-flight", "twin", None, LEFT, False, True,
            "There is no experiment that the twin has not learnt from, so its error on a new"
            " one is unknown. Fly one more that is planned on what was learnt of those before.",
        )  # fmt: skip
        return
    last = found.unseen[-1]
    which = found.names[last.place]
    good = last.predicted_well
    yield Check(
        "unseen-flight", "twin", last.error, LEFT, good, True,
        f"Before learning it, the twin {'predicted' if good else 'did not predict'} {which}:"
        f" {last.error_words}.",
    )  # fmt: skip
    if last.inside is not None:
        wide = last.inside >= INSIDE
        yield Check(
            "band", "twin", last.inside, INSIDE, wide, True,
            f"{100.0 * last.inside:.0f} % of the readings of {which} were inside the band predicted for 90 % of"
            f" them; at least {100.0 * INSIDE:.0f} % are required.",
        )  # fmt: skip
    miss = found.last_miss
    if miss is not None:
        near = abs(miss) <= MISSES
        missed = (
            f"The last quality that was predicted differs from what was flown by {two_digits(abs(miss))} of its"
            f" standard deviations; at most {MISSES:g} are allowed."
        )
        diverged = "No quality was predicted for the last flight: the twin diverged under its gains."
        yield Check(
            "quality", "twin", abs(miss), MISSES, near, True, missed if math.isfinite(miss) else diverged,
        )  # fmt: skip


def _of_innovations(found: Examination) -> Iterator[Check]:
    own, causes = found.autocorrelation, found.crosscorrelation
    if own is None or causes is None:
        return
    for name, these, words in (
        ("whiteness", own, "of the innovations with their own past"),
        ("commands", causes, "of the innovations with earlier commands"),
    ):
        white = these.outside <= COLOURED
        shows = "would show" if white else "shows"
        yield Check(
            name, "twin", these.outside, COLOURED, white, True,
            f"{100.0 * these.outside:.3g} % of the correlations {words} are beyond their 99 % limits; more than"
            f" {100.0 * COLOURED:.0f} % {shows} an effect that the twin lacks.",
        )  # fmt: skip


def _damping(worst: LoopMargins) -> Check:
    return Check(
        "sensitivity", "controller", worst.sensitivity, SENSITIVITY, worst.sensitivity <= SENSITIVITY,
        worst.sensitivity > FRAGILE,
        f"The largest sensitivity over loops and committee is {worst.sensitivity:.2f}, of {worst.loop}; up to"
        f" {SENSITIVITY:g} is usual; do not fly above {FRAGILE:g}.",
    )  # fmt: skip


def _delay(worst: LoopMargins, dt: float, flown: int, bounded: bool) -> Check:
    """The delay that both the loops around the target bear, for small departures, and the flight of the task."""
    periods = worst.delay / dt
    slides = ", as dry friction slides," if worst.friction == "sliding" else ""
    borne = (
        f"The loop with the smallest delay margin, {worst.loop}, stays stable{slides} with up to"
        f" {shown_time(worst.delay)} more, {periods:.3g} period{'s' * (f'{periods:.3g}' != '1')}"
        if math.isfinite(periods)
        else "No delay makes any loop unstable"
    )
    keeps = "stays in the envelope" if bounded else "does not diverge"
    flight = (
        f"the flight of the task {keeps} with up to {flown} period{'s' * (flown != 1)} more, of {MOST} that were"
        " tried, on each model that flies it at all"
        if flown
        else "the flight of the task bears not one period more"
    )
    found = min(periods, float(flown))
    return Check(
        "delay", "controller", found, PERIODS, found >= PERIODS, True,
        f"{borne}; {flight}. At least {PERIODS:g} is required of both, since a command may be that late.",
    )  # fmt: skip


def _without_margins(why: str) -> Iterator[Check]:
    """A check that binds and that could not be made does not hold."""
    for name, limit, what in (
        ("stable", None, f"whether the loops around the target are stable. {why}"),
        ("sensitivity", SENSITIVITY, "the largest sensitivity, of loops around the target."),
        ("delay", PERIODS, "the smallest delay margin, of loops around the target."),
    ):
        yield Check(name, "controller", None, limit, False, True, f"Not made: {what}")


def _of_controller(found: Examination) -> Iterator[Check]:
    best = found.best
    why = found.no_controller if best is None else f"There is a controller to fly. {best.reason}".strip()
    yield Check(
        "controller", "controller", None, None, best is not None, True, why,
    )  # fmt: skip
    if best is None:
        return
    # Loops around a twin that does not follow its own flights say nothing of the system's, and `follows` binds already.
    margins, bounded = found.margins if found.twin.follows else None, is_bounded(found.signals)
    if margins is None and found.twin.follows:
        yield from _without_margins(found.no_margins)
    if margins is not None:
        stable = all(loop.stable for loop in margins.worst)
        yield Check(
            "stable", "controller", None, None, stable, True,
            f"Around the target all loops are {'stable on each' if stable else 'unstable on at least one'} of the"
            f" {margins.members} models of the committee.",
        )  # fmt: skip
        if stable:  # of a loop that is not, a sensitivity says nothing
            yield _damping(max(margins.worst, key=lambda loop: loop.sensitivity))
            least = min(margins.worst, key=lambda loop: loop.delay)
            yield _delay(least, found.signals.dt, found.delay_borne, bounded)
    if not bounded:
        yield Check(
            "no-envelope", "controller", None, None, False, False,
            "No envelope is declared: whether a flight stays where it is safe was not checked.",
        )  # fmt: skip
    yield from _of_leaving(found, best, bounded)
    kept = any(run.kept_envelope for run in found.best_flights)
    completed = f"completed a flight{' within the envelope' * bounded}"
    not_kept = f"not {completed}" if found.best_flights else "not flown yet"
    yield Check(
        "flown", "controller", None, None, kept, bool(found.best_flights),
        f"These gains have {completed if kept else not_kept}.",
    )  # fmt: skip
    if found.ending is not None:
        yield _of_target(found.ending)


def _of_leaving(found: Examination, best: Test, bounded: bool) -> Iterator[Check]:
    if best.risk is not None:
        name, happens = ("envelope", "leaves the envelope") if bounded else ("divergence", "diverges")
        yield Check(
            name, "controller", best.risk, RISK, best.risk <= RISK, True,
            f"The probability that it {happens} is"
            f" {risk_words(best.risk, found.setup.predicted_flights, bounded)} according to the committee, to gusts as"
            f" the flights felt them and to flights of these gains; at most {100.0 * RISK:g} % is allowed.",
        )  # fmt: skip
    elif bounded:
        yield _by_flights(found.fared, _predicted_to_leave(found))


def _predicted_to_leave(found: Examination) -> bool:
    flight = found.planned
    return flight is not None and bool(outside(usages_of(found.signals, flight.states)).any())


def _by_flights(fared: Fared, predicted_to_leave: bool) -> Check:
    """Without a committee flights of the same gains have to speak for them; none may leave, on the twin neither."""
    unknown = "Not made: the probability that it leaves the envelope. No committee has judged it, and"
    each = "their only flight" if fared.flights == 1 else f"each of their {fared.flights} flights"
    if not fared.flights:
        sentence = f"{unknown} these gains have not flown: fly them."
    elif fared.left:
        sentence = f"{unknown} in {fared} these gains did not keep the envelope to the end."
    elif predicted_to_leave:
        sentence = f"{unknown} the twin predicts that these gains leave it, which kept it in {each}."
    else:
        sentence = f"These gains have kept the envelope in {each}. No committee has judged how probably they leave it."
    kept = fared.flights > 0 and not fared.left and not predicted_to_leave
    return Check("envelope", "controller", None, RISK, kept, True, sentence)


def _of_target(end: Ending) -> Check:
    """Whether the target is reached: a target may be meant to lie beyond reach, so that this does not bind."""
    worst = max((miss.share for miss in end.misses), default=0.0)
    there = "Each state that counts ends within a tenth of its way of its target, or as near as noise allows."
    missed = (
        f"{end} That is more than a tenth of the way, and more than noise explains. It forbids nothing: a target may be"
        " out of reach on purpose."
    )
    return Check(
        "target", "controller", worst, REACHED, not end.misses, False, missed if end.misses else there,
    )  # fmt: skip
