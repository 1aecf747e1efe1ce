"""Picks the next test: on which the committee disagrees, near the task, inside the envelope on every member."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.controllers import Family
from twinloop.flights import disagreements
from twinloop.planning.excitation import binary, chirps
from twinloop.planning.gains import from_unit, to_unit, tune_gains
from twinloop.planning.judging import DIVERGED, Committee, Ends, Judge, Judged, Task, expected
from twinloop.planning.quality import Quality
from twinloop.planning.settings import PlanningOptions

Flags = NDArray[np.bool_]
GOALS = ("both", "model", "control")
TRIED = 128
"""Candidates at most that are flown under noise before the safest one is taken."""
TOGETHER = 4
"""Of them at once."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A test that is proposed.

    Args:
        genes: its gains (size,).
        initial_state: where it starts (n_x,).
        target_state: where it leads (n_x,).
        excitation: (n, n_u), or None.
        predicted: mean quality over members and draws, as a record of the flight would give it; infinite if any
            diverges.
        spread: standard deviation of the members' means; infinite likewise.
        risk: share of predicted flights that leave the envelope, with half a flight added on either side.
        safe: whether every member keeps the margin, and the envelope under every draw of the sensors' noise.
        disagreement: of the committee, log det.
        gain: quality that knowing the right member would bring, by the committee's own estimate.
        reason: for a person.
    """

    genes: Floats
    initial_state: Floats
    target_state: Floats
    excitation: Floats | None
    predicted: float
    spread: float
    risk: float
    safe: bool
    disagreement: float
    gain: float
    reason: str


class Planner(Judge):
    """Tunes gains on a committee, and picks flights that tell it apart.

    Args:
        family: of the controllers.
        task: of the flights.
        quality: what is minimised.
        options: of the planning.
        divergence_factor: multiple of a state's scale beyond which a flight counts as diverged.
        seed: of the campaign.
        workers: how the work is carried out.
        watch: called now and then, with what is being done and how far it is (0 to 1).
    """

    def __init__(
        self,
        family: Family,
        task: Task,
        quality: Quality,
        options: PlanningOptions,
        *,
        divergence_factor: float,
        seed: int,
        workers: _core.Workers,
        watch: Callable[[str, float], None] = lambda step, share: None,
    ) -> None:
        super().__init__(
            family, task, quality, divergence_factor=divergence_factor, seed=seed, workers=workers
        )
        self.options = options
        self.watch = watch

    def tune(self, committee: Committee, starts: Sequence[Floats], number: int) -> tuple[Floats, float]:
        """Gains of the best quality on the committee, inside the envelope with its margin.

        Args:
            committee: that judges.
            starts: genes to start from.
            number: of the call, for its stream.

        Returns:
            The genes and their score, quality plus what is paid for leaving the margin.
        """
        options = self.options
        stream = self.stream(2, number)
        places = np.clip(to_unit(self.family, np.stack(starts)), 0.0, 1.0)
        all_starts = list(starts)
        while len(all_starts) < options.tuning_starts:
            # The middle between what is known and anywhere: basins that no flight has seen.
            other = 0.5 * places[0] + 0.5 * stream.random(self.family.size)
            all_starts.append(from_unit(self.family, other))
        best, _ = self._searched(committee.members[:1], committee.sds, 1, all_starts, 0.5, 0.2, number)
        members = committee.members[: max(1, options.tuning_members)]
        fine = [best, *starts[:1]]
        return self._searched(members, committee.sds, options.draws, fine[:2], 0.5, 0.08, number + 1)

    def _searched(
        self,
        members: Sequence[_core.Model],
        sds: Floats,
        draws: int,
        starts: Sequence[Floats],
        share: float,
        spread: float,
        number: int,
    ) -> tuple[Floats, float]:
        options = self.options
        done = 0

        def score(genes: Floats) -> Floats:
            nonlocal done
            done += len(genes)
            judged = self.judge(members, genes, sds, draws)
            excess = np.maximum(0.0, judged.worst_usage - (1.0 - options.margin))
            return judged.mean * (1.0 + 10.0 * excess) + np.where(excess > 0.0, excess, 0.0)

        total = share * options.evaluations
        return tune_gains(
            self.family, score, starts, evaluations=int(total), spread=spread, seed=self.seed * 1009 + number,
            watch=lambda: self.watch("gains", min(1.0, done / total)),
        )  # fmt: skip

    # Proposing

    def first_excitation(self, number: int) -> Floats | None:
        """The gentle excitation of a test with gains of the user's own; None where it is switched off."""
        options = self.options
        if options.excitation <= 0.0:
            return None
        stream = self.stream(3, number)
        return chirps(self.signals, self.task.steps, options.excitation, options.fade, stream)

    def baseline(self, number: int, first: Floats) -> tuple[Floats, Floats | None]:
        """Genes and excitation of a test that no committee chose."""
        options = self.options
        stream = self.stream(4, number)
        steps, most, fade = self.task.steps, options.excitation_most, options.fade
        if options.tests == "random":
            genes = from_unit(self.family, stream.random(self.family.size))
            return genes, chirps(self.signals, steps, options.excitation, fade, stream)
        make = chirps if options.tests == "chirp" else binary
        return first, make(self.signals, steps, most, fade, stream)

    def propose(
        self,
        committee: Committee,
        tuned: Floats,
        flown: Floats,
        goal: str,
        number: int,
        told: int,
        first_quality: float,
        used: Sequence[float],
        kept: bool,
        exploit: bool,
    ) -> Proposal:
        """The next test.

        Args:
            committee: that judges.
            tuned: gains that are best on it.
            flown: the best gains flown.
            goal: "both", "model" or "control".
            number: of the test, for its stream.
            told: experiments so far.
            first_quality: of the first controller, as flown or predicted; infinite where it left the envelope: a
                flight that keeps it may then be worse.
            used: largest usage of the envelope in each flight so far.
            kept: whether the best gains flown kept the envelope.
            exploit: whether the tuned gains are flown as they are.

        Returns:
            The proposal; not `safe` where no candidate keeps the margin on every member.
        """
        genes, excitation = self._candidates(tuned, flown, goal, number)
        ends = self._ends(number, len(genes))
        self.watch("candidates", 0.0)
        # A member that blows up whatever is flown is no member (E-SINDy).
        members = self.lasting(committee.members, genes, excitation, ends)
        judged = self.judge(members, genes, committee.sds, 1, excitation, ends)
        flights = self.flights(genes, excitation, ends)
        values, where = disagreements(
            members, flights, np.maximum(committee.sds, self._smallest()), workers=self.workers
        )
        self.watch("candidates", 1.0)
        per_member = judged.qualities.mean(axis=1)
        mean = per_member.mean(axis=0)
        keeps = judged.worst_usage <= self._reach(goal, used)
        scatter = 0.0 if goal == "model" else self._scatter(committee, tuned)
        first = first_quality if np.isfinite(first_quality) else 2.0 * float(mean[0])
        limit = self._limit(float(mean[0]), goal, told, first, scatter)
        allowed = keeps & (mean <= limit)
        repeats = len(genes) - self._repeats(len(genes))

        def drawn(chosen: Sequence[int]) -> Judged:
            of_each = (ends[0][chosen], ends[1][chosen])
            draws = self.options.draws
            return self.judge(
                members, genes[chosen], committee.sds, draws, excitation[chosen], of_each, measured=True
            )

        order = _order(values, mean, allowed, keeps & (mean <= first), exploit) if committee.trusted else []
        found = _first_that_lasts(order, drawn, max(limit, first_quality + 2.0 * scatter))
        if found is None:
            # What was flown and kept the envelope will again, whatever the members make of it. Where no model is to be
            # trusted, nothing is known but that these gains have flown: again, with another excitation.
            known = repeats if kept or not committee.trusted else 0
            chosen = known + int(np.argmin(judged.worst_usage[known:]))
            found = chosen, drawn([chosen])
        chosen, noisy = found
        # What knowing the right member would bring: each one's own best against the best for all of them.
        choices = per_member[:, keeps]
        gain = float(choices.mean(axis=0).min() - choices.min(axis=1).mean()) if keeps.any() else 0.0
        row, state, high, low = (int(i) for i in where[chosen])
        inside = judged.worst_usage[chosen] <= 1.0 - self.options.margin and noisy.usages.max() <= 1.0
        safe = bool(inside and (kept or chosen < repeats))
        left = int((noisy.usages > 1.0).sum())
        predicted, spread = expected(noisy.qualities.mean(axis=(1, 2)))
        return Proposal(
            genes=genes[chosen],
            initial_state=ends[0][chosen],
            target_state=ends[1][chosen],
            excitation=excitation[chosen] if excitation[chosen].any() else None,
            predicted=predicted,
            spread=spread,
            risk=(left + 0.5) / (noisy.usages.size + 1.0),
            safe=safe,
            disagreement=float(values[chosen]),
            gain=max(0.0, gain),
            reason=self._reason(
                exploit and chosen == 0,
                chosen >= repeats,
                kept,
                safe,
                float(values[chosen]),
                row,
                state,
                (high, low),
            ),
        )

    # Inside

    def _repeats(self, count: int) -> int:
        """Candidates, the last ones, that fly the best gains flown with another excitation."""
        return max(1, count // 16)

    def _candidates(self, tuned: Floats, flown: Floats, goal: str, number: int) -> tuple[Floats, Floats]:
        """Genes (K, size) and excitations (K, n, n_u); the first candidate is the tuned one as it is."""
        options = self.options
        stream = self.stream(5, number)
        count = max(2, options.candidates)
        place = to_unit(self.family, tuned)
        places = place + options.nearness * stream.standard_normal((count, self.family.size))
        places[: count // 4] = place
        if goal == "model":
            places[count // 2 :] = stream.random((count - count // 2, self.family.size))
        genes = from_unit(self.family, np.clip(places, 0.0, 1.0))
        genes[0] = tuned
        again = self._repeats(count)
        genes[count - again :] = flown
        if options.excitation <= 0.0:
            # The same flight once more would tell nothing: gains close by.
            near = to_unit(self.family, flown) + 0.3 * options.nearness * stream.standard_normal(
                (again, self.family.size)
            )
            genes[count - again :] = from_unit(self.family, np.clip(near, 0.0, 1.0))
        excitation = np.zeros((count, self.task.steps, self.signals.n_u))
        most = options.excitation_most
        if most > 0.0 and options.excitation > 0.0:
            # Gains that have flown bear more of it than at first, and once more the same would tell little.
            stronger = min(2.0 * options.excitation, most)
            for i in range(1, count):
                amplitude = stronger if i >= count - again else most * stream.random()
                excitation[i] = chirps(self.signals, self.task.steps, amplitude, options.fade, stream)
        return genes, excitation

    def _reach(self, goal: str, used: Sequence[float]) -> float:
        """Usage of the envelope that a proposal may have, where that of each flight so far is known."""
        options = self.options
        first, most = used[0] if used else 0.0, max(used, default=0.0)
        # A model is believed near what was flown: each flight may go somewhat further than those before it.
        near = max(options.reach_first, options.reach_growth * most)
        # With gains far from any that were flown it may be wrong in ways that no member shows, and the more so the
        # further a flight goes: what is small on the first flight, and in no term, is not small then.
        far = max(min(options.reach_far, options.reach_growth * first), options.reach_least, most)
        return min(1.0 - options.margin, far if goal == "model" else near)

    def _scatter(self, committee: Committee, tuned: Floats) -> float:
        """How far the quality of one flight is from that of the next, by the sensors' noise alone."""
        flights = self.judge(committee.members[:1], tuned[np.newaxis], committee.sds, self.options.draws)
        scatter = float(flights.qualities.std())
        return scatter if scatter < DIVERGED else 0.0

    def _limit(self, tuned: float, goal: str, told: int, first: float, scatter: float) -> float:
        """Predicted quality that a test may have at most."""
        if goal == "model":
            return max(first, 2.0 * tuned)
        given = self.options.share ** max(1, told) * max(0.0, first - tuned)
        # What is lost in the scatter of the flights costs nothing.
        given = 0.1 * given if goal == "control" else max(scatter, given)
        # Where the tuned gains promise less than the first ones gave, the committee knows too little to lead anywhere.
        return min(tuned + given, first + scatter)

    def _smallest(self) -> Floats:
        """Differences below this are rounding (n_x,)."""
        return np.array([1e-6 * state.scale for state in self.signals.states])

    def _ends(self, number: int, count: int) -> Ends:
        """Start and target of each candidate (K, n_x); those of the campaign for the first one."""
        stream = self.stream(6, number)
        ends = []
        for middle, reach in (
            (self.task.initial_state, self.options.initial_range),
            (self.task.target_state, self.options.target_range),
        ):
            states = np.tile(middle, (count, 1))
            if any(reach):
                states[1:] += np.array(reach) * stream.uniform(-1.0, 1.0, (count - 1, len(middle)))
            ends.append(states)
        return ends[0], ends[1]

    def _reason(
        self,
        exploits: bool,
        repeats: bool,
        kept: bool,
        safe: bool,
        value: float,
        row: int,
        state: int,
        pair: tuple[int, int],
    ) -> str:
        sentences = []
        if repeats:
            change = "a stronger excitation" if self.options.excitation > 0.0 else "a small variation"
            known = "they are known to fly" if kept else "they left the envelope when they flew"
            sentences.append(f"The best gains flown, again, with {change}: {known}.")
        if exploits:
            sentences.append("The best gains that the twin knows, flown as they are.")
        elif value > 0.0 and pair[0] != pair[1]:
            sentences.append(
                f"Models {pair[0]} and {pair[1]} disagree most on {self.signals.state_names[state]},"
                f" {row * self.signals.dt:.2g} s after the start; the flight tells {value / np.log(2):.3g} bits."
            )
        else:
            sentences.append("All models agree: the flight confirms what is known.")
        if not safe:
            sentences.append(
                "No candidate keeps the envelope with its margin, or lasts at all, on every model and under the noise"
                " of the sensors: this is the safest that is known. Fly it with a hand on the switch, or not at all."
            )
        return " ".join(sentences)


def _order(values: Floats, mean: Floats, allowed: Flags, better: Flags, exploit: bool) -> list[int]:
    """Candidates, the most wanted first: what tells most among those allowed, then what flies best among the better."""
    first = [0] if exploit and allowed[0] else []
    telling = np.flatnonzero(allowed)[np.argsort(-values[allowed], kind="stable")]
    flying = np.flatnonzero(better)[np.argsort(mean[better], kind="stable")]
    return [*first, *telling.tolist(), *flying.tolist()]


def _first_that_lasts(
    order: Sequence[int], drawn: Callable[[Sequence[int]], Judged], worst: float
) -> tuple[int, Judged] | None:
    """The first candidate that keeps the envelope under every draw of noise and is not worse than the worst allowed."""
    for at in range(0, min(len(order), TRIED), TOGETHER):
        batch = order[at : at + TOGETHER]
        noisy = drawn(batch)
        lasts = np.flatnonzero((noisy.worst_usage <= 1.0) & (noisy.mean <= worst))
        if len(lasts):
            i = int(lasts[0])
            return batch[i], Judged(noisy.qualities[:, :, [i]], noisy.usages[:, :, [i]])
    return None
