"""Hidden states that motion fills: the twist of a joint, the heat of a wall, the pressure behind a piston; and servos.

Looked for where a model leaves more than noise. One state fills such a storage or, beside it and with the same time, a
group of commands or another state does: all that a first-order storage holds of them is a sum of the two. Which one
shows by linear terms; what it moves is chosen among all terms, as for a hidden state that commands fill.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from twinloop._ground.elementary import power
from twinloop.identification.context import Context
from twinloop.identification.evidence import by_evidence
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.fit.predictions import smoothed
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.proposals.lags import without_lags
from twinloop.identification.search.noise import disturbed, first_noise, lasts, still
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.screen import FURTHER, Screen, Sources
from twinloop.identification.search.selection import from_both_sides
from twinloop.law.actuation import HiddenState, alike_commands
from twinloop.law.forms import DERIVATIVES

TIMES = (0.02, 0.1, 0.5)
"""Times that are tried, in lengths of the longest run."""
SWINGS = 7
"""Frequencies of a pair that turns that are tried, from one swing in the longest run to one in a few periods."""
FEWEST_PERIODS = 5.0
"""Periods of the fastest of them."""
FADING = (3.0, 20.0)
"""Times in which such a pair fades, in those in which it turns by one radian."""
SWINGING = 4.0
"""Times in which a pair turns by one radian that it lasts at least, where a state drives it."""
SERVO_FADING = (0.8, 2.0, 5.0, 20.0)
"""As `FADING`, where commands drive such a pair: a servo may be damped so well that it hardly swings."""
SERVO = 0.5
"""As `SWINGING`, where commands drive it: they are known, and nothing that disturbs foretells them."""
LEFT = 0.25
"""Share of a sensor's variance that may disturb in a period behind one that fades before it has turned by a radian."""
FINER_SWINGS = (1.4, 1.15, 1.05)
"""Factors between frequencies, and between times, where a pair has shown."""
FINER = (2.0, 1.25)
"""Factors between times that are tried where a storage has shown."""
STEPS = 4
"""Such factors at most, one after the other."""
NEAR = 2
"""Single states, the best ones, beside which another source is tried."""
FEW = 2
"""Kinds of storage that are followed up where they are looked for as if nothing disturbed."""
SEARCHES = 2
"""Of all terms, that each kind of storage is searched by: with the noise from below, and from above."""


def storage(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with the best hidden states that motion fills, fitted; none where only noise is left."""
    if not context.may_store or hypothesis.fit is None or hypothesis.form not in DERIVATIVES:
        return
    problem = Problem(context, hypothesis)
    quiet = still(problem, (found.chain for found in hypothesis.sums))
    # A storage would evade the bounds of what fills it.
    if problem.priors.bounds or (quiet and hypothesis.fit.stable) or hypothesis.actuation.stored:
        return
    context.watch("hidden")
    # Behind a short memory of noisy readings their noise would explain itself.
    bare = smoothed(context, hypothesis) or replace(hypothesis, fit=None)
    better, numbers = False, _Numbers(itertools.count(), itertools.count(bare.searches, SEARCHES))
    for stored in _with_storage(context, bare, numbers):
        better |= stored.evidence > hypothesis.evidence
        yield stored
    if not better:
        for variant in _undisturbed(context, bare):
            yield from _with_storage(context, variant, numbers, brief=True)


class _Numbers(NamedTuple):
    """Numbers by which what is drawn is told apart.

    Args:
        screens: of the screens.
        searches: of the searches of all terms, as a hypothesis counts them.
    """

    screens: Iterator[int]
    searches: Iterator[int]


def _with_storage(
    context: Context, bare: Hypothesis, numbers: _Numbers, brief: bool = False
) -> Iterator[Hypothesis]:
    """A hypothesis with the best hidden states that motion fills, beside its lags and in their place, fitted.

    Args:
        context: of the identification.
        bare: without such states.
        numbers: the next ones.
        brief: as for `filled_by_motion`.
    """
    screens = [
        Screen.of(context, variant, next(numbers.screens)) for variant in (bare, *without_lags(context, bare))
    ]
    for screen in screens:
        for found in filled_by_motion(screen, brief):
            # What is stored in place of a lag describes more than the lag alone, or all that is fitted is in vain.
            if screen is not screens[0] and not found.evidence > screens[0].plain.evidence:
                continue
            found = replace(found, searches=next(numbers.searches))
            stored = fitted(context, from_both_sides(context, found, found.sums))
            # What readings cannot show is no law, but has drawn what nothing else may.
            shown = shows(stored.actuation.hidden, context.signals.dt) and not _stands_in(context, stored)
            if stored.fit is not None and not shown:
                stored = replace(stored, fit=replace(stored.fit, chi_squared=math.inf))
            yield stored


def _stands_in(context: Context, stored: Hypothesis) -> bool:
    """Whether a pair that commands drive hardly swings and leaves more than noise: it stands in for what states do.

    A law that states feed back answers to commands for as long as a servo does, but under other gains it answers
    otherwise. What is left tells the two apart: behind a servo everything is explained. What swings
    shows itself.
    """
    if not any(one.commands and one.time < one.turns for one in stored.actuation.hidden):
        return False
    problem = Problem(context, stored)
    return any(disturbed(problem, found.chain, LEFT) for found in stored.sums)


def shows(hidden: Sequence[HiddenState], period: float) -> bool:
    """Whether readings can show what motion fills: not what has emptied before the next of them.

    A pair has to swing, too: two that fade sooner stand in for what is no spring. Less what fills it, such a state is
    the slope of that over a period. Where one gust moves two states, the slope of the one foretells the other, and
    would be taken for a law.

    Args:
        hidden: states, with their tuned times.
        period: of the readings, s.
    """
    by_states = any(one.states for one in hidden)
    least = SWINGING if by_states else SERVO
    return all(one.time >= max(period, least * one.turns) for one in hidden if one.integrated)


def filled_by_motion(screen: Screen, brief: bool = False) -> Iterator[Hypothesis]:
    """The hypothesis of a screen, not fitted, with the best storage of each kind; none that does not pay at all.

    Kinds are what one state fills, empty or settled at the start, what two fill, and pairs that turn into each other,
    which a state drives, or commands, such as a servo.

    Args:
        screen: of a hypothesis with sums to begin with, and without such states.
        brief: whether no pairs are tried that turn into each other, and of the other kinds only the few that show best.
    """
    context = screen.context
    longest = context.signals.dt * max(len(run.commands) for run in screen.hypothesis.runs)
    times = [share * longest for share in TIMES]
    singles = {
        begins: [max(screen(_single(place, begins, times)), key=by_evidence) for place in _sources(context)]
        for begins in (False, True)
    }
    best = [max(pair, key=by_evidence) for pair in zip(*singles.values(), strict=True)]
    near, without = sorted(best, key=lambda one: one.evidence.length)[:NEAR], screen.without
    others = [one.actuation.hidden[0].states[0] for one in near]
    kinds: list[tuple[Screen, list[Hypothesis], Sequence[float]]]
    kinds = [(screen, found, FINER) for found in singles.values()]
    pairs = screen(pair for time in times for one in near for pair in _pairs(context, one, others, time))
    kinds.append((screen, pairs, ()))
    swings = screen.beside()
    swinging = (
        pair
        for begins in (False, True)
        for place in _sources(context)
        for pair in _swinging(place, begins, longest, context.signals.dt)
    )
    kinds.append((swings, [] if brief else swings(swinging), FINER_SWINGS))
    if not brief and screen.hypothesis.form == "acceleration":
        driven = screen.beside(FURTHER)
        commanded = driven(
            pair
            for group in alike_commands(context.signals)
            for pair in _commanded(group, longest, context.signals.dt)
        )
        kinds.append((driven, commanded, FINER_SWINGS))
    showing = [
        (of_kind, found, factors)
        for of_kind, found, factors in (
            (each, max(several, key=by_evidence), factors) for each, several, factors in kinds if several
        )
        if found.evidence > without.evidence
    ]
    if brief:
        showing = sorted(showing, key=lambda kind: kind[1].evidence.length)[:FEW]
    # Which one shows on the terms that there are; whether there is one, when all may change.
    for of_kind, found, factors in showing:
        plain, grown = screen.plain, of_kind.with_all_terms(_timed(of_kind, found, factors))
        if grown.evidence > plain.evidence:
            yield grown


def _undisturbed(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The same with the noise of a fit without lasting disturbances, if there are any: they hide what is stored."""
    problem, terms = Problem(context, hypothesis), hypothesis.candidates.ladder[0]
    if any(lasts(problem, found.chain) for found in hypothesis.sums):
        chains = first_noise(problem, [found.chain for found in hypothesis.sums], terms, gusts=False)
        sums = zip(hypothesis.sums, chains, strict=True)
        yield replace(hypothesis, sums=tuple(replace(found, chain=chain) for found, chain in sums))


def _timed(screen: Screen, best: Hypothesis, factors: Sequence[float]) -> Hypothesis:
    """The hypothesis with hidden states of the time that is best near theirs."""
    for factor in factors:
        for _ in range(STEPS):
            hidden = best.actuation.hidden
            by = (1.0 / factor, factor)
            beside = [tuple(one._replace(time=one.time * share) for one in hidden) for share in by]
            if all(one.turns for one in hidden):
                beside += [tuple(one._replace(turns=one.turns * share) for one in hidden) for share in by]
            found = max([best, *screen(beside)], key=by_evidence)
            if found is best:
                break
            best = found
    return best


def _single(place: int, settled: bool, times: Sequence[float]) -> Iterator[Sources]:
    """One state that fills a storage, which is empty at the start or settled."""
    for time in times:
        yield (HiddenState((), False, 0.0, time, (place,), settled),)


def _pairs(context: Context, alone: Hypothesis, others: Sequence[int], time: float) -> Iterator[Sources]:
    """What one state fills, beside what a group of commands or another state does in the same time."""
    (by_state,) = alone.actuation.hidden
    # Empty at the start, or settled but for what the law's constants hold.
    for settled, rest in ((False, 0.0), (True, None)):
        first = by_state._replace(time=time, settled=settled)
        for group in alike_commands(context.signals):
            yield HiddenState(tuple(group), False, rest, time), first
        for place in others:
            if place > by_state.states[0]:
                yield first, first._replace(states=(place,))


def _swinging(place: int, settled: bool, longest: float, period: float) -> Iterator[Sources]:
    """Pairs that turn into each other while one state drives them, at rest or in steady state at the start."""
    for turns in _turns(longest, period):
        for fading in FADING:
            one = HiddenState((), False, 0.0, fading * turns, (place,), settled, turns)
            yield one, one


def _commanded(group: Sequence[int], longest: float, period: float) -> Iterator[Sources]:
    """Pairs that turn into each other while some commands drive them, at rest at the start."""
    for turns in _turns(longest, period):
        for fading in SERVO_FADING:
            one = HiddenState(tuple(group), False, 0.0, fading * turns, turns=turns)
            yield one, one


def _turns(longest: float, period: float) -> Iterator[float]:
    """Times in which pairs turn by a radian that are tried."""
    slowest, fastest = longest / (2.0 * np.pi), FEWEST_PERIODS * period / (2.0 * np.pi)
    for number in range(SWINGS):
        yield slowest * float(power(fastest / slowest, number / (SWINGS - 1)))


def _sources(context: Context) -> list[int]:
    """States that may fill a storage: not those that wrap, for a turn more is no other angle."""
    return [i for i, state in enumerate(context.signals.states) if state.period is None]
