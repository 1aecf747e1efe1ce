"""Picks the next test: on which the committee disagrees, near the task, inside the envelope on every member."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop._experiment.envelope import outside
from twinloop._experiment.hold_back import HoldBack
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop._ground.steps import Watch, unwatched
from twinloop._ground.streams import Purpose
from twinloop.controllers import Family
from twinloop.planning.beyond import bears_ending
from twinloop.planning.candidates import Candidates, candidates, directions_of, unknown_excitation
from twinloop.planning.comparison import Comparison
from twinloop.planning.excitation import binary, chirps, swing_of
from twinloop.planning.gains import scores_of, tune_gains
from twinloop.planning.judging import Committee, Judge, Task, expected, risk
from twinloop.planning.proposal import Flown, Proposal, Wanted
from twinloop.planning.quality import Quality
from twinloop.planning.reach import bounds_of, reach_of
from twinloop.planning.scored import Score, Scored
from twinloop.planning.settings import PlanningOptions
from twinloop.planning.within import tune_within

GOALS = ("both", "model", "control")


class Search(NamedTuple):
    """How gains are searched.

    Args:
        spread: standard deviation of the first steps, in ranges of the gains.
        purpose: of its random numbers.
        patience: generations after which one from a further start ends that has found nothing better than those before.
    """

    spread: float
    purpose: Purpose
    patience: int | None = None


COARSE, FINE = Search(0.2, "gains"), Search(0.08, "fine_gains", 16)
"""From several starts on the best model alone; from the best of them, on several members under drawn noise."""


class Planner(Judge):
    """Tunes gains on a committee, and picks flights that tell it apart.

    Args:
        family: of the controllers.
        task: of the flights.
        quality: what is minimised.
        options: of the planning.
        limits: where a flight counts as diverged.
        seed: of the campaign.
        workers: how the work is carried out.
        watch: called now and then, with the step that is under way.
    """

    def __init__(
        self,
        family: Family,
        task: Task,
        quality: Quality,
        options: PlanningOptions,
        *,
        limits: Limits,
        seed: int,
        workers: _core.Workers,
        watch: Watch = unwatched,
    ) -> None:
        super().__init__(family, task, quality, limits=limits, seed=seed, workers=workers)
        self.options = options
        self.watch = watch

    def tune(
        self, committee: Committee, starts: Sequence[Floats], number: int, scored: Scored | None = None
    ) -> Floats:
        """Genes of the best quality on the committee, inside the envelope with its margin.

        Args:
            committee: that judges.
            starts: genes to start from, the best flown first: gains that cannot be tuned stay as there.
            number: of runs, for its streams.
            scored: what was judged of the same before it was cut, and who keeps what is judged; None: it begins.
        """
        options = self.options
        stream = self.unit.part(number).stream("starts")
        places = np.clip(self.family.to_unit(np.stack(starts)), 0.0, 1.0)
        all_starts = list(starts)
        while len(all_starts) < options.tuning_starts:
            # The middle between what is known and anywhere: basins that no flight has seen.
            other = 0.5 * places[0] + 0.5 * stream.uniforms(self.family.size)
            all_starts.append(self.family.from_unit(other))
        scored = scored or Scored()
        delayed = list(committee.tuned_delayed)
        first = [*committee.members[:1], *delayed]
        members = [*committee.members[: max(1, options.tuning_members - len(delayed))], *delayed]
        known = all_starts[0]
        all_starts = [committee.as_flown(start, known) for start in all_starts]
        coarse = scored(self._score(committee, first, 1, known))
        best = committee.as_flown(self._searched(coarse, all_starts, number, COARSE), known)
        # Noise and other members may rank basins anew, so what was known is refined, too.
        fine = scored(self._score(committee, members, options.draws, known))
        return committee.as_flown(self._searched(fine, [best, known], number, FINE), known)

    def _searched(self, score: Score, starts: Sequence[Floats], number: int, search: Search) -> Floats:
        """One of two searches, with half of the evaluations."""
        return tune_gains(
            self.family, score, starts, evaluations=self.options.evaluations // 2, spread=search.spread,
            unit=self.unit.part(number), purpose=search.purpose, patience=search.patience,
            watch=lambda: self.watch("gains"),
        )  # fmt: skip

    def _score(
        self, committee: Committee, members: Sequence[_core.Model], draws: int, known: Floats
    ) -> Score:
        """The score of genes on members under draws of noise, in units of how well known genes do."""
        options, sds = self.options, committee.sds
        limiting = [model for model in committee.delayed if model not in committee.tuned_delayed]
        of_each = max(1, draws // len(members))

        # What is wanted is the best mean in the disturbances that flights meet, not in calm.
        met = self.disturbances(committee, draws)

        first = float(self.judge_in_turn(members, known[np.newaxis], sds, draws, met).mean[0])
        unit = first if np.isfinite(first) else 0.0

        def score(asked: Floats) -> Floats:
            genes = committee.as_flown(asked, known)
            judged = self.judge_in_turn(members, genes, sds, draws, met)
            lost, usage = judged.lost, judged.finite.worst_usage
            if limiting:
                delayed = self.judge(limiting, genes, sds, of_each)
                lost, usage = lost + delayed.lost, np.maximum(usage, delayed.finite.worst_usage)
            excess = np.maximum(0.0, usage - (1.0 - options.margin))
            return scores_of(lost, judged.mean_of_finite, excess, unit)

        return score

    def disturbances(self, committee: Committee, draws: int) -> Floats | None:
        """Draws of the disturbances in which gains are tuned and compared (draws, n, n_x); None: in calm."""
        return committee.disturbances(draws, self.task.steps) if self.options.tuned_in_gusts else None

    def is_near(self, committee: Committee, genes: Floats, flown: Flown) -> bool:
        """Whether gains (size,) lead hardly further than flights have, and bear that what states do ends there.

        Args:
            committee: that judges.
            genes: without excitation.
            flown: so far.
        """
        one, options = genes[np.newaxis], self.options
        usage = self.quiet(committee.members, one).worst_usage
        reach = reach_of(flown, Wanted("control", 0, exploit=True, last=True), options)
        return bool((usage <= reach).all() and bears_ending(self, committee, options.margin, one).all())

    # Proposing

    def first_excitation(self, number: int, genes: Floats) -> tuple[Floats | None, HoldBack | None]:
        """The excitation of a test with gains of the user's own (size,), and what holds it back.

        None where they are switched off.
        """
        if self.options.excitation <= 0.0:
            return None, None
        stream = self.unit.part(number).stream("excitation")
        added = unknown_excitation(self, self.options, directions_of(self, genes), 0, stream)
        return added, self.held_back(self.task.initial_state, self.task.target_state)

    def held_back(
        self, start: Floats, target: Floats, reached: Floats | None = None, by: Sequence[int] | None = None
    ) -> HoldBack | None:
        """What holds back an excitation of which no model can say where it leads; None where that is off.

        Args:
            start: of the flight (n_x,).
            target: of it, (n_x,) or a row for each state.
            reached: smallest and largest value of each state under the same gains (2, n_x); None: they have not flown.
            by: states that hold it back, if any of them has a limit; None, or none that has one: all.
        """
        if not self.options.hold_back:
            return None
        swing = swing_of(self.task.steps * self.signals.dt)
        found = HoldBack.between(self.signals, start, target, swing, reached, by)
        return HoldBack.between(self.signals, start, target, swing, reached) if found is None else found

    def held(self, committee: Committee, found: Proposal, hold_back: HoldBack) -> Proposal:
        """A proposal with what is predicted of it while its excitation is held back.

        Args:
            committee: that judges.
            found: with an excitation.
            hold_back: what holds it back.
        """
        test = self.test(found.genes, found.initial_state, found.target_state, found.excitation)
        test = replace(test, hold_back=hold_back)
        members, flights = self.as_flown(committee.members, test, committee.sds, self.options.draws)
        predicted, spread = expected(flights.qualities[:, :, 0])
        inside = self.quiet_test(members, test).worst_usage[0] <= 1.0 - self.options.margin
        safe = bool(inside and not outside(flights.usages).any())
        return replace(
            found,
            predicted=predicted,
            spread=spread,
            risk=risk(flights.usages),
            safe=safe,
            hold_back=hold_back,
        )

    def excites(self, committee: Committee) -> bool:
        """Whether flights excite the commands that answer to states of which a committee knows no law, held back."""
        options = self.options
        some = options.excitation > 0.0 and options.excitation_most > 0.0
        held_back = self.held_back(self.task.initial_state, self.task.target_state)
        return bool(committee.leads and committee.lawless) and some and held_back is not None

    def baseline(self, number: int, first: Floats) -> tuple[Floats, Floats | None]:
        """Genes and excitation of a test that no committee chose."""
        options = self.options
        stream = self.unit.part(number).stream("baseline")
        steps, most, fade = self.task.steps, options.excitation_most, options.fade
        if options.tests == "random":
            genes = self.family.from_unit(stream.uniforms(self.family.size))
            return genes, chirps(self.signals, steps, options.excitation, fade, stream)
        make = chirps if options.tests == "chirp" else binary
        return first, make(self.signals, steps, most, fade, stream)

    def propose(
        self,
        committee: Committee,
        tuned: Floats,
        flown: Flown,
        goal: str,
        number: int,
        exploit: bool,
        last: bool = False,
    ) -> Proposal:
        """The next test.

        Args:
            committee: that judges.
            tuned: gains that are best on it.
            flown: so far.
            goal: "both", "model" or "control".
            number: of the test, for its stream.
            exploit: whether the tuned gains are flown as they are.
            last: whether nothing else is: where the tuned gains cannot be, those that promise most of all that can,
                without excitation. They lead hardly further than flights have.

        Returns:
            The proposal; not `safe` where no candidate keeps the margin on every member.
        """
        wanted = Wanted(goal, number, exploit, last=last)
        found = self._compared(committee, tuned, flown, wanted)
        self.watch("candidates")
        if self.options.within and committee.predicts_limits and found.possible[0] and not found.keeps[0]:
            found = self._within(found)
        proposal = found.proposal()
        as_wanted = proposal.excitation is None and proposal.genes.tobytes() == tuned.tobytes()
        if last and not found.wanted.plain and not as_wanted:
            return self._compared(committee, tuned, flown, replace(wanted, plain=True)).proposal()
        return proposal

    def again(self, committee: Committee, flown: Flown, number: int) -> Proposal:
        """The best gains flown, once more, without excitation.

        Args:
            committee: that judges.
            flown: so far; its best gains are known to fly.
            number: of the test, for its streams.
        """
        drafts = Candidates.of_best(self, flown)
        wanted = Wanted("control", number, exploit=True, plain=True, last=True)
        return Comparison(self, self.options, committee, drafts, flown, wanted).proposal()

    def _compared(self, committee: Committee, genes: Floats, flown: Flown, wanted: Wanted) -> Comparison:
        """Candidates around some genes, without excitation where the one that promises most is wanted."""
        excited = self.excites(committee)
        drafts = candidates(
            self, self.options, genes, flown, wanted.goal, wanted.number, committee.leads,
            committee.lawless if excited else (), committee.untunable,
        )  # fmt: skip
        drafts = drafts.quiet() if wanted.plain else drafts
        return Comparison(self, self.options, committee, drafts, flown, wanted)

    def _within(self, far: Comparison) -> Comparison:
        """Candidates around the best gains within the limits of the next flight; those that there are if none are."""
        committee, flown, wanted = far.committee, far.flown, far.wanted
        bounds = bounds_of(flown, wanted, self.signals, self.options)
        promising = np.where(far.keeps, far.quiet.mean, np.inf)
        starts = [flown.best, far.drafts.genes[int(np.argmin(promising))]]
        genes = tune_within(
            self, self.options, committee, far.members, bounds, starts, wanted.number,
            lambda: self.watch("candidates"), flown.disproved,
        )  # fmt: skip
        found = self._compared(committee, genes, flown, replace(wanted, exploit=False, plain=wanted.exploit))
        return found if found.keeps[0] else far
