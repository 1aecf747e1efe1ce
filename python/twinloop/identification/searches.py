"""Searches: from each start one proposal after another, and which of what they have found is believed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from twinloop.identification.context import Context
from twinloop.identification.evidence import ANEW, LATENESS, SLIGHT, by_evidence
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.late import unread
from twinloop.identification.proposals.apart import apart
from twinloop.identification.proposals.at_once import at_once
from twinloop.identification.proposals.bare import bare
from twinloop.identification.proposals.contacts import contacts
from twinloop.identification.proposals.delays import delays
from twinloop.identification.proposals.exponentials import exponentials
from twinloop.identification.proposals.friction import friction
from twinloop.identification.proposals.gaps import gaps
from twinloop.identification.proposals.hidden import hidden
from twinloop.identification.proposals.lags import lags
from twinloop.identification.proposals.parts import parts
from twinloop.identification.proposals.second_look import second_look
from twinloop.identification.proposals.storage import storage
from twinloop.identification.proposals.terms import terms
from twinloop.identification.proposals.undisturbed import undisturbed
from twinloop.law.reports import late_in
from twinloop.records import Record, Recorded

Proposal = Callable[[Context, Hypothesis], Iterable[Hypothesis]]
"""Takes a hypothesis and gives changed ones, or none."""
PROPOSALS: tuple[Proposal, ...] = (
    lags, hidden, terms, undisturbed, apart, storage, friction, exponentials, contacts, gaps, second_look, delays,
    parts, bare, at_once,
)  # fmt: skip
"""In the order in which they are made."""
BEHIND = 100.0
"""Units of χ² by which readings of other ages, once they are fitted, may be described at more length than those of the
ages that were known: a sensor that is late shows by then, and what is found afterwards is found of both."""


@dataclass(frozen=True, eq=False)
class Found(Recorded, kind="found"):
    """What a search has found so far.

    Args:
        best: what is believed.
        rivals: what else was proposed on the way and lasts on the runs, in order; from other starts, too.
        made: how many proposals were made.
        first: length of the description of the first hypothesis that was fitted, in units of χ²; None before.
    """

    best: Hypothesis
    rivals: tuple[Hypothesis, ...] = ()
    made: int = 0
    first: float | None = None

    VERSION = 2

    def behind(self, other: Found) -> bool:
        """Whether what was fitted first is clearly a longer description than what another search fitted first."""
        return self.first is not None and other.first is not None and self.first > other.first + BEHIND

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of the first version, which did not know what was fitted first."""
        return {"first": None, **super().renewed(record)}


Searches = tuple[Found, ...]
"""What was found from each start, in their order."""


@dataclass(frozen=True, eq=False)
class Reading:
    """What was found of the runs, read in time or later.

    Args:
        context: with the runs.
        searches: one for each start, in their order; the first is the search anew.
    """

    context: Context
    searches: Searches

    @property
    def known(self) -> list[Hypothesis]:
        """What was made of the law known before; none where nothing was known."""
        return [found for other in self.searches[1:] for found in (other.best, *other.rivals)]

    @cached_property
    def found(self) -> Found:
        """What is believed of all searches."""
        first = self.searches[0]
        return decided(first, self.known, ahead=self.owed(first.best))

    def owed(self, one: Hypothesis) -> float:
        """What a hypothesis has to be ahead of what was known before by, in units of χ²."""
        known = self.known
        anew = self.context.options.steady and not any(one is each for each in known)
        return lead(one, known) if anew else 0.0

    def paid(self, one: Hypothesis) -> float:
        """What late sensors pay under a hypothesis, and what readings would have that are older than their runs."""
        ages = late_in(self.context.reports, self.context.signals.n_x)
        observer = one.driven if one.fit is None else one.fit.observer
        each = LATENESS + SLIGHT * (0 if one.fit is None else one.fit.readings)
        return each * len(set(ages) - {0}) + unread(self.context, observer)


def likelier(several: Sequence[Reading]) -> Reading:
    """The first reading of the runs, or one of other ages that is ahead of it, with what each age pays."""
    first, *others = several
    best = first.found.best
    for other in others:
        tried = other.found.best
        worth = first.owed(tried) + other.paid(tried) - first.paid(best)
        if tried.evidence.less(worth) > best.evidence:
            return other
    return first


def explored(
    context: Context,
    every: Sequence[Callable[[], Hypothesis]],
    before: Sequence[Found],
    kept: Callable[[Sequence[Found]], None],
    other: Found | None = None,
) -> Searches:
    """What is found from each start, one proposal after another.

    Args:
        context: of the identification.
        every: starts.
        before: of these searches, those that were made before; it may go on with others.
        kept: called with all of these after each start and each proposal.
        other: what was found of the same readings of other ages; from a search that is behind it nothing further is
            proposed.
    """
    searches = list(before[: len(every)])
    for number, start in enumerate(every):
        if number == len(searches):
            context.watch("noise")
            searches.append(Found(start()))
            kept(searches)
        for propose in PROPOSALS[searches[number].made :] if goes_on(context, searches, number) else ():
            if other is not None and searches[number].behind(other):
                break
            searches[number] = decided(searches[number], propose(context, searches[number].best))
            kept(searches)
    return tuple(searches)


def goes_on(context: Context, searches: Sequence[Found], number: int) -> bool:
    """Whether proposals are made from a start: not from a law known before that those found anew are ahead of.

    What is hidden they may have missed, so from such a law they are made in any case. None where only what is known is
    tuned.
    """
    if context.earlier is not None and not context.options.anew:
        return False
    own = searches[number].best
    known = own.fit is not None and not own.actuation.hidden
    return not (known and any(other.best.evidence > own.evidence for other in searches[:number]))


def lead(anew: Hypothesis, known: Sequence[Hypothesis]) -> float:
    """What a law that was found anew has to be ahead of the one known before by, in units of χ².

    Args:
        anew: the law.
        known: what was made of the one known before; none where nothing was known.
    """
    if not known:
        return 0.0
    return ANEW * max(0, anew.terms - max(known, key=by_evidence).terms)


def decided(found: Found, proposed: Iterable[Hypothesis], ahead: float = 0.0) -> Found:
    """What is believed after one more proposal, and its rivals: those that last and are not believed.

    Args:
        found: before it.
        proposed: the hypotheses that it gives.
        ahead: what the believed one has to be ahead of all of them by, in units of χ².
    """
    before, several = found.best, [found.best, *proposed]
    best = max(several, key=lambda one: one.evidence.less(ahead) if one is before else one.evidence)
    others = (other for other in several[1:] if other is not best and other.evidence.stable)
    # What is drawn from here on is nothing that one of those that are not believed has drawn.
    drawn = max(other.searches for other in several if other.start == best.start)
    rivals, first = (*found.rivals, *others), found.first
    if first is None and best.evidence.fitted and best.evidence.stable:
        first = best.evidence.length
    return replace(found, best=replace(best, searches=drawn), rivals=rivals, made=found.made + 1, first=first)
