"""Picks the next test: on which the committee disagrees, near the task, inside the envelope on every member."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.controllers import Family
from twinloop.elementary import log
from twinloop.envelope import outside
from twinloop.flights import disagreements
from twinloop.hold_back import HoldBack
from twinloop.limits import Limits
from twinloop.planning.candidates import Candidates, candidates
from twinloop.planning.excitation import binary, chirps, first_chirps
from twinloop.planning.gains import Scored, nearby, tune_gains
from twinloop.planning.judging import Committee, Judge, Judged, Task, expected, risk
from twinloop.planning.quality import Quality
from twinloop.planning.settings import PlanningOptions
from twinloop.planning.worth import apart, gain, limit
from twinloop.steps import Watch, unwatched
from twinloop.streams import Purpose

Flags = NDArray[np.bool_]
GOALS = ("both", "model", "control")
TRIED = 128
"""Candidates at most that are flown under noise before the safest one is taken."""
TOGETHER = 4
"""Of them at once."""
ANYWHERE = 64
"""Flights by which it is asked how much of the twin is unknown."""


@dataclass(frozen=True, eq=False)
class Flown:
    """What has flown so far.

    Args:
        best: genes of the best flight; those tuned where no test was flown.
        kept: whether they are known to fly: to the end, and inside the envelope.
        usages: largest usage of the envelope in each flight.
        good: quality of the best flight that kept the envelope; infinite where none has: one that keeps it may then be
            worse.
        failed: genes of tests that failed on the system, or were cut.
    """

    best: Floats
    kept: bool
    usages: Sequence[float]
    good: float
    failed: Sequence[Floats] = ()


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
        spread: standard deviation of it over members and noise; infinite likewise.
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
            starts: genes to start from.
            number: of runs told, for its streams.
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
        best = self._searched(
            committee.members[:1], committee.sds, 1, all_starts, 0.2, number, "gains", scored
        )
        members = committee.members[: max(1, options.tuning_members)]
        fine = [best, starts[0]]
        return self._searched(members, committee.sds, options.draws, fine, 0.08, number, "fine_gains", scored)

    def _searched(
        self,
        members: Sequence[_core.Model],
        sds: Floats,
        draws: int,
        starts: Sequence[Floats],
        spread: float,
        number: int,
        purpose: Purpose,
        scored: Scored,
    ) -> Floats:
        """One of two searches, with half of the evaluations."""
        options = self.options

        first = float(self.judge(members, starts[0][np.newaxis], sds, draws).mean[0])
        unit = first if np.isfinite(first) else 0.0

        def score(genes: Floats) -> Floats:
            judged = self.judge(members, genes, sds, draws)
            lasts = judged.lasting
            mean = lasts.qualities.sum(axis=(0, 1)) / np.maximum(
                1, np.isfinite(judged.qualities).sum(axis=(0, 1))
            )
            excess = np.maximum(0.0, lasts.worst_usage - (1.0 - options.margin))
            return np.stack([judged.lost, mean + excess * (10.0 * mean + unit)], axis=1)

        return tune_gains(
            self.family, scored(score), starts, evaluations=options.evaluations // 2, spread=spread,
            unit=self.unit.part(number), purpose=purpose, watch=lambda: self.watch("gains"),
        )  # fmt: skip

    # Proposing

    def first_excitation(self, number: int, genes: Floats) -> tuple[Floats | None, HoldBack | None]:
        """The gentle excitation of a test with gains of the user's own (size,), and what holds it back.

        None where they are switched off.
        """
        options = self.options
        if options.excitation <= 0.0:
            return None, None
        stream = self.unit.part(number).stream("excitation")
        target = np.atleast_2d(self.task.target_state)[0]
        added = first_chirps(
            self.family, genes, target, self.task.steps, options.excitation, options.fade, stream
        )
        if not options.hold_back:
            return added, None
        return added, HoldBack.between(self.signals, self.task.initial_state, self.task.target_state)

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
                without excitation.

        Returns:
            The proposal; not `safe` where no candidate keeps the margin on every member.
        """
        drafts = candidates(self, self.options, tuned, flown.best, goal, number)
        self.watch("candidates")
        found = self._best_of(drafts, committee, tuned, flown, goal, number, exploit)
        if last and found.genes.tobytes() != tuned.tobytes():
            return self._best_of(drafts.quiet(), committee, tuned, flown, goal, number, exploit, plain=True)
        return found

    def _best_of(
        self,
        drafts: Candidates,
        committee: Committee,
        tuned: Floats,
        flown: Flown,
        goal: str,
        number: int,
        exploit: bool,
        plain: bool = False,
    ) -> Proposal:
        """The draft that tells most of those that may be flown; `plain`: the one that promises most."""
        # A member that blows up whatever is flown is no member (E-SINDy).
        members = self.lasting(committee.members, drafts.genes, drafts.excitation, drafts.ends)
        quiet = self.judge(members, drafts.genes, committee.sds, 1, drafts.excitation, drafts.ends)
        tells, where = disagreements(
            members,
            self.flights(drafts.genes, drafts.excitation, drafts.ends),
            np.maximum(committee.sds, self._smallest()),
            workers=self.workers,
        )
        possible = self._possible(drafts, flown)
        keeps = possible & (quiet.worst_usage <= self._reach(goal, flown.usages))
        choices, promised = quiet.qualities.mean(axis=1)[:, keeps], float(quiet.mean[0])
        scatter, by_noise = (0.0, 0.0) if goal == "model" else self._noise_of(members, committee.sds, tuned)
        most = self._most(promised, flown.good, goal)
        worst = most
        if goal != "model":
            unknown = self._unknown(members, number) if goal == "both" else 0.0
            worst = limit(promised, flown.good, gain(choices), unknown, scatter, self.options)

        def noisy(chosen: list[int]) -> Judged:
            some = drafts.some(chosen)
            return self.judge(
                members,
                some.genes,
                committee.sds,
                self.options.draws,
                some.excitation,
                some.ends,
                measured=True,
            )

        found = None
        if committee.trusted:
            # The tuned gains as they are tell least, and asked for once more nothing.
            others = keeps & (exploit | (np.arange(len(keeps)) > 0))
            allowed = others & (quiet.mean <= worst)
            wanted = [0] if exploit and allowed[0] else []
            wanted += _first(allowed, quiet.mean if plain else -tells)
            found = _first_that_lasts(wanted, noisy, worst + by_noise + 2.0 * scatter)
            if found is None:
                # None that tells much lasts under noise: the one that promises most, if it is no worse than was flown.
                found = _first_that_lasts(
                    _first(others & (quiet.mean <= most), quiet.mean), noisy, most + 2.0 * scatter
                )
        if found is None:
            # What was flown and kept the envelope will again, whatever the members make of it.
            likely = possible & (np.arange(len(possible)) >= drafts.repeats) if flown.kept else possible
            chosen = int(np.argmin(np.where(likely, quiet.worst_usage, np.inf)))
            found = chosen, noisy([chosen])
        chosen, flights = found
        repeats = chosen >= drafts.repeats
        inside = quiet.worst_usage[chosen] <= 1.0 - self.options.margin and not outside(flights.usages).any()
        safe = bool(inside)
        predicted, spread = expected(flights.qualities[:, :, 0])
        excitation, disagreement = drafts.excitation[chosen], float(tells[chosen])
        return Proposal(
            genes=drafts.genes[chosen],
            initial_state=drafts.ends[0][chosen],
            target_state=drafts.ends[1][chosen],
            excitation=excitation if excitation.any() else None,
            predicted=predicted,
            spread=spread,
            risk=risk(flights.usages),
            safe=safe,
            disagreement=disagreement,
            gain=gain(choices),
            reason=self._reason(
                committee.trusted,
                flown.kept,
                exploit and chosen == 0,
                plain,
                repeats,
                safe,
                disagreement,
                where[chosen].tolist(),
            ),
        )

    # Inside

    def _possible(self, drafts: Candidates, flown: Flown) -> Flags:
        """Candidates that are no flight that failed, or was cut, once more."""
        possible = ~nearby(self.family, drafts.genes, flown.failed)
        possible[drafts.repeats :] &= flown.kept
        # Where all of them are, the safest of them is still the best that can be said.
        return possible if possible.any() else np.ones_like(possible)

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

    def _unknown(self, members: Sequence[_core.Model], number: int) -> float:
        """How far members are apart about flights of the task under gains from anywhere in their box, as a share."""
        stream = self.unit.part(number, 1).stream("candidates")
        genes = self.family.from_unit(stream.uniforms(ANYWHERE, self.family.size))
        return apart(self.judge(members, genes, np.zeros(self.signals.n_x), 1).qualities[:, 0])

    def _noise_of(self, members: Sequence[_core.Model], sds: Floats, tuned: Floats) -> tuple[float, float]:
        """Of the tuned flight: how far its quality is from that of the next, and what noise adds to a measurement."""
        genes, draws = tuned[np.newaxis], self.options.draws
        true, measured = (self.judge(members, genes, sds, draws, measured=how) for how in (False, True))
        if not np.isfinite(true.qualities).all():
            return 0.0, 0.0
        quiet = self.judge(members, genes, sds, 1)
        scatter = float(true.qualities[0].std())
        return scatter, max(0.0, float(measured.mean[0] - quiet.mean[0]))

    def _most(self, promised: float, good: float, goal: str) -> float:
        """Predicted quality that any flight may have at most; one for the model may cost as much again."""
        # Where no flight has kept the envelope, one that does may be worse than what is promised.
        most = (1.0 + self.options.worse) * good if np.isfinite(good) else 2.0 * promised
        return max(most, 2.0 * promised) if goal == "model" else most

    def _smallest(self) -> Floats:
        """Differences below this are rounding (n_x,)."""
        return np.array([1e-6 * state.scale for state in self.signals.states])

    def _reason(
        self,
        trusted: bool,
        known: bool,
        exploits: bool,
        plain: bool,
        repeats: bool,
        safe: bool,
        value: float,
        where: Sequence[int],
    ) -> str:
        """Why this test; `where`: step, state and the two members that are the furthest apart."""
        row, state, high, low = where
        sentences = []
        if repeats and plain:
            sentences.append(f"The best gains flown, again{': they are known to fly' * known}.")
        elif repeats:
            change = "a stronger excitation" if self.options.excitation > 0.0 else "a small variation"
            sentences.append(
                f"The best gains flown, again, with {change}{': they are known to fly' * known}."
            )
        if not trusted:
            sentences.append(
                "The twin does not follow the flights so far: it cannot say what this one will tell."
            )
        elif exploits:
            sentences.append("The best gains that the twin knows, flown as they are.")
        elif plain:
            promise = "The gains that promise most of those that may be flown, as they are."
            sentences += [] if repeats else [promise]
        elif value > 0.0 and high != low:
            sentences.append(
                f"Models {high} and {low} disagree most on {self.signals.state_names[state]},"
                f" {row * self.signals.dt:.2g} s after the start; the flight tells {value / float(log(2.0)):.3g} bits."
            )
        else:
            sentences.append("The models predict the same of it: the flight tests what they have in common.")
        if not safe:
            sentences.append(
                "No candidate keeps the envelope with its margin, or lasts at all, on every model and under the noise"
                " of the sensors: this is the safest that is known. Fly it with a hand on the switch, or not at all."
            )
        return " ".join(sentences)


def _first(those: Flags, cost: Floats) -> list[int]:
    """Numbers of those that are meant, the one of least cost first."""
    numbers: list[int] = np.flatnonzero(those)[np.argsort(cost[those], kind="stable")].tolist()
    return numbers


def _first_that_lasts(
    wanted: Sequence[int], noisy: Callable[[list[int]], Judged], worst: float
) -> tuple[int, Judged] | None:
    """The first that keeps the envelope under every draw of noise and is not worse than the worst allowed."""
    for at in range(0, min(len(wanted), TRIED), TOGETHER):
        batch = list(wanted[at : at + TOGETHER])
        flights = noisy(batch)
        lasts = np.flatnonzero(~outside(flights.worst_usage) & (flights.mean <= worst))
        if len(lasts):
            i = int(lasts[0])
            return batch[i], Judged(flights.qualities[:, :, [i]], flights.usages[:, :, [i]])
    return None
