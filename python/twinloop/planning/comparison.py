"""Comparison: candidates judged on a committee, and the one of them that is flown next."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from twinloop._experiment.envelope import outside
from twinloop._ground.arrays import Floats
from twinloop.flights import disagreements
from twinloop.planning.beyond import bears_ending
from twinloop.planning.candidates import Candidates
from twinloop.planning.failed import stand_for_failed
from twinloop.planning.halfway import beyond_halfway
from twinloop.planning.judging import Committee, Judge, Judged, expected, risk
from twinloop.planning.proposal import Flown, Proposal, Wanted
from twinloop.planning.reach import reach_of
from twinloop.planning.reasons import Why, reason
from twinloop.planning.settings import PlanningOptions
from twinloop.planning.worth import WORST, apart, gain, limit

Flags = NDArray[np.bool_]
TRIED = 128
"""Candidates at most that are flown under noise before the safest one is taken."""
TOGETHER = 4
"""Of them at once."""
ANYWHERE = 64
"""Flights by which it is asked how much of the twin is unknown."""


class Comparison:
    """Candidates on a committee: all of them without noise, and under drawn noise those that may be chosen.

    Args:
        judge: of the campaign.
        options: of the planning.
        committee: that judges.
        drafts: candidates; the first one is the tuned gains as they are.
        flown: what has flown so far.
        wanted: what the test is for.
    """

    def __init__(
        self,
        judge: Judge,
        options: PlanningOptions,
        committee: Committee,
        drafts: Candidates,
        flown: Flown,
        wanted: Wanted,
    ) -> None:
        self.judge, self.options, self.committee = judge, options, committee
        self.drafts, self.flown, self.wanted = drafts, flown, wanted
        genes, excitation, ends = drafts.genes, drafts.excitation, drafts.ends
        reach = reach_of(flown, wanted, options)
        everyone = judge.quiet(committee.members, genes, excitation, ends)
        # A member that diverges whatever is flown is no member (E-SINDy). Nor is one that goes too far whatever is
        # flown, the best gains flown among them: it would forbid all flights.
        heeded = everyone.stable & (everyone.usages[:, 0] <= reach).any(axis=1)
        heeded[0] = True
        self.members, self.quiet = list(compress(committee.members, heeded)), everyone.of(heeded)
        # Differences below these are rounding.
        smallest = np.array([1e-6 * state.scale for state in judge.signals.states])
        self.tells, self.where = disagreements(
            self.members,
            judge.flights(genes, excitation, ends),
            np.maximum(committee.sds, smallest),
            workers=judge.workers,
        )
        self.possible = self._possible()
        within = self.possible & (self.quiet.worst_usage <= reach)
        self.keeps = within & self._bears_delay() & self._near_what_was_seen() & self._halfway
        self.promised = float(self.quiet.mean[0])

    def proposal(self) -> Proposal:
        """The candidate that tells most of those that may be flown, or promises most; else the safest one."""
        found = self._trusted_choice() if self.committee.leads else None
        chosen, flights = self._safest() if found is None else found
        inside = self.quiet.worst_usage[chosen] <= 1.0 - self.options.margin
        safe = bool(inside and not outside(flights.usages).any())
        predicted, spread = expected(flights.qualities[:, :, 0])
        excitation, disagreement = self.drafts.excitation[chosen], float(self.tells[chosen])
        held = self._held_back(chosen) if self.committee.leads else 0.0
        return Proposal(
            genes=self.drafts.genes[chosen],
            initial_state=self.drafts.ends[0][chosen],
            target_state=self.drafts.ends[1][chosen],
            excitation=excitation if excitation.any() else None,
            predicted=predicted,
            spread=spread,
            risk=risk(flights.usages),
            safe=safe,
            disagreement=disagreement,
            gain=self.gain + held,
            reason=reason(self._why(chosen, safe, disagreement, held), self.judge.signals),
        )

    @cached_property
    def gain(self) -> float:
        """Quality that knowing the right member would bring, among the candidates that keep the envelope."""
        return gain(self.quiet.qualities.mean(axis=1)[:, self.keeps])

    def _trusted_choice(self) -> tuple[int, Judged] | None:
        """What a committee that can be trusted chooses, and its flights under noise; None where nothing lasts."""
        exploit, mean = self.wanted.exploit, self.quiet.mean
        most, worst, by_noise, scatter = self._allowed()
        # The tuned gains as they are tell least, and asked for once more nothing.
        others = self.keeps & (exploit | (np.arange(len(self.keeps)) > 0))
        allowed = others & (mean <= worst)
        first = [0] if exploit and allowed[0] else []
        first += _in_order(allowed, mean if self.wanted.plain else -self.tells)
        found = self._first_that_lasts(first, worst + by_noise + 2.0 * scatter)
        if found is None:
            # None that tells much lasts under noise: the one that promises most, if it is no worse than was flown. The
            # best ones are all alike; what they do not withstand may be withstood on the way back from them.
            back = _spaced(_in_order(others & (mean <= most), mean), TRIED)
            found = self._first_that_lasts(back, most + 2.0 * scatter)
        return found

    def _safest(self) -> tuple[int, Judged]:
        """The candidate that uses least of the envelope, and its flights under noise."""
        likely, repeats = self.possible, np.arange(len(self.possible)) >= self.drafts.repeats
        # What was flown and kept the envelope will again, whatever the members make of it.
        if self.flown.flies and (likely & repeats).any():
            likely = likely & repeats
        usages = np.where(likely, self.quiet.worst_usage, np.inf)
        # Where a member sees all of them diverge it tells nothing: the gains that were flown.
        lasts = np.isfinite(usages).any()
        chosen = int(np.argmin(usages)) if lasts else int(np.flatnonzero(likely)[-1])
        return chosen, self._noisy([chosen])

    def _allowed(self) -> tuple[float, float, float, float]:
        """The worst predicted quality of any flight, and of one that tells; what noise adds; how far it scatters."""
        goal = self.wanted.goal
        most = self._most()
        if goal == "model":
            return most, most, 0.0, 0.0
        scatter, by_noise = self._noise_of_tuned()
        unknown = self._unknown() if goal == "both" else 0.0
        worst = limit(self.promised, self.flown.good, self.gain, unknown, scatter, self.options)
        return most, worst, by_noise, scatter

    def _possible(self) -> Flags:
        """Candidates that are no flight that failed, or was cut, once more."""
        possible = ~stand_for_failed(self.judge, self.members, self.drafts.genes, self.flown.failed)
        possible[self.drafts.repeats :] &= self.flown.flies
        # Where all of them are, the safest of them is still the best that can be said.
        return possible if possible.any() else np.ones_like(possible)

    def _bears_delay(self) -> Flags:
        """Candidates that keep the envelope with more delay than was seen; all of them where none does."""
        drafts, bears = self.drafts, np.ones_like(self.possible)
        if self.committee.delayed:
            flights = self.judge.quiet(self.committee.delayed, drafts.genes, drafts.excitation, drafts.ends)
            bears = ~outside(flights.worst_usage)
            # Gains that have flown need not show it.
            bears[drafts.repeats :] |= self.flown.flies
        return bears if bears[: drafts.repeats].any() else np.ones_like(bears)

    def _near_what_was_seen(self) -> Flags:
        """Candidates that lead no member far beyond the states seen so far; all of them where every one does.

        Until a prediction has come true a law is known where the flights were, and nobody knows how far beyond.
        """
        drafts, seen, reach = self.drafts, self.flown.seen, self.options.reach_seen
        if seen is None or reach <= 0.0:
            return np.ones_like(self.possible)
        genes, excitation, ends = drafts.genes, drafts.excitation, drafts.ends
        bounds = seen.around(reach, self.judge.signals)
        near = ~outside(self.judge.judge_within(bounds, self.members, genes, excitation, ends).worst_usage)
        near[drafts.repeats :] |= self.flown.flies
        return near if near[: drafts.repeats].any() else np.ones_like(near)

    @cached_property
    def _halfway(self) -> Flags:
        """Candidates that lead no more than half as far from the best gains flown as flights that have disappointed."""
        flown = self.flown
        beyond = beyond_halfway(self.judge.family, self.drafts.genes, flown.best, flown.disproved)
        return np.asarray(beyond == 0.0)

    def _most(self) -> float:
        """Predicted quality that any flight may have at most; one for the model may cost as much again."""
        # Where no flight has kept the envelope, one that does may be worse than what is promised.
        good, twice = self.flown.good, 2.0 * self.promised
        most = (1.0 + self.options.worse) * good if np.isfinite(good) else twice
        return max(most, twice) if self.wanted.goal == "model" else most

    def _unknown(self) -> float:
        """How far members are apart about flights of the task under gains from anywhere in their box, as a share."""
        judge = self.judge
        stream = judge.unit.part(self.wanted.number, 1).stream("candidates")
        drawn = judge.family.from_unit(stream.uniforms(ANYWHERE, judge.family.size))
        genes = self.committee.as_flown(drawn, self.flown.best)
        return apart(judge.quiet(self.members, genes).qualities[:, 0])

    def _noise_of_tuned(self) -> tuple[float, float]:
        """Of the tuned flight: how far its quality is from that of the next, and what noise adds to a measurement."""
        genes, sds, draws = self.drafts.genes[:1], self.committee.sds, self.options.draws
        judge = self.judge.judge
        true, measured = (judge(self.members, genes, sds, draws, measured=how) for how in (False, True))
        if not np.isfinite(true.qualities).all():
            return 0.0, 0.0
        quiet = self.judge.quiet(self.members, genes)
        return float(true.qualities[0].std()), max(0.0, float(measured.mean[0] - quiet.mean[0]))

    def _noisy(self, chosen: list[int]) -> Judged:
        """Some candidates under drawn noise, as records of their flights would give them."""
        some, draws = self.drafts.some(chosen), self.options.draws
        return self.judge.judge(
            self.members, some.genes, self.committee.sds, draws, some.excitation, some.ends, measured=True
        )

    def _first_that_lasts(self, ordered: Sequence[int], worst: float) -> tuple[int, Judged] | None:
        """The first that keeps the envelope under every draw of noise, and is not worse than the worst allowed."""
        for at in range(0, min(len(ordered), TRIED), TOGETHER):
            batch = list(ordered[at : at + TOGETHER])
            flights = self._noisy(batch)
            lasts = ~outside(flights.worst_usage) & (flights.mean <= worst) & self._bears_ending(batch)
            for i in np.flatnonzero(lasts).tolist():
                if self._bears_gusts(batch[i], float(flights.mean[i])):
                    return batch[i], Judged(flights.qualities[:, :, [i]], flights.usages[:, :, [i]])
        return None

    def _bears_ending(self, chosen: list[int]) -> Flags:
        """Which of some candidates keep the envelope if what states do ends where they were seen."""
        some, margin = self.drafts.some(chosen), self.options.margin
        bears = bears_ending(self.judge, self.committee, margin, some.genes, some.excitation, some.ends)
        # Gains that have flown need not show it.
        bears[np.array(chosen) >= self.drafts.repeats] |= self.flown.flies
        return bears

    def _bears_gusts(self, candidate: int, predicted: float) -> bool:
        """Whether known disturbances drive a candidate out of the envelope no more often than the best gains flown.

        Nor may they make it far worse than the best flight was measured, in the disturbances that it met. Flights for
        the model alone may be as bad as they are.

        Args:
            candidate: its number.
            predicted: its quality without them.
        """
        drafts = self.drafts
        start, target = (states[candidate] for states in drafts.ends)
        test = self.judge.test(drafts.genes[candidate], start, target, drafts.excitation[candidate])
        moved = self.committee.moved_by_gusts(test)
        worst = float("inf") if self.wanted.goal == "model" else WORST * self.flown.good
        return moved.left <= self._left_in_gusts and predicted + moved.bias <= worst

    @cached_property
    def _left_in_gusts(self) -> int:
        """How many of the drawn flights of the best gains flown leave the envelope in known disturbances."""
        task = self.judge.task
        flown = self.judge.test(self.flown.best, task.initial_state, task.target_state)
        return self.committee.moved_by_gusts(flown).left

    def _held_back(self, chosen: int) -> float:
        """By how much the most promising candidate is better than the chosen one, and than all that may be chosen.

        Others bear that their law ends where flights have been; 0 where this one does, too. Flights that go further
        step by step may lead there, which knowing the right member alone does not.
        """
        promising = np.where(self.keeps, self.quiet.mean, np.inf)
        best, others = int(np.argmin(promising)), np.flatnonzero(self.keeps).tolist()
        if not np.isfinite(promising[best]) or self._bears_ending([best])[0]:
            return 0.0
        least = np.append(promising[others][self._bears_ending(others)], self.quiet.mean[chosen]).min()
        return max(0.0, float(least - promising[best])) if np.isfinite(least) else 0.0

    def _why(self, chosen: int, safe: bool, disagreement: float, held: float) -> Why:
        row, state, high, low = self.where[chosen].tolist()
        repeats = chosen >= self.drafts.repeats
        return Why(
            trusted=self.committee.trusted,
            gains_count=self.committee.gains_count,
            flies=self.flown.flies,
            fared=self.flown.fared,
            # Nobody knows where an excitation leads once the last one was too much, and it begins anew.
            stronger=self.flown.borne > 0 or (self.committee.leads and not self.committee.lawless),
            exploits=self.wanted.exploit and chosen == 0 and not repeats,
            plain=self.wanted.plain,
            repeats=repeats,
            excited=bool(self.drafts.excitation[chosen].any()),
            varied=self.drafts.genes[chosen].tobytes() != self.flown.best.tobytes(),
            safe=safe,
            disagreement=disagreement,
            step=row,
            state=state,
            members=(high, low),
            lawless=tuple(self.judge.signals.state_names[i] for i in self.committee.lawless),
            untunable=tuple(self.judge.family.names[i] for i in self.committee.untunable),
            halfway=bool(self._halfway[chosen]) and not self._halfway.all(),
            held=held > self.options.worse * float(self.quiet.mean[chosen]),
        )


def _in_order(those: Flags, cost: Floats) -> list[int]:
    """Numbers of those that are meant, the one of least cost first."""
    numbers: list[int] = np.flatnonzero(those)[np.argsort(cost[those], kind="stable")].tolist()
    return numbers


def _spaced(ordered: Sequence[int], most: int) -> list[int]:
    """Of ordered numbers so many at most, evenly spaced from the first one to the last."""
    some = min(len(ordered), most)
    return [ordered[place * (len(ordered) - 1) // max(1, some - 1)] for place in range(some)]
