"""The way of the preset `default`: identify a twin and a committee, tune the gains on them, plan the next test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from twinloop import _core
from twinloop._experiment.envelope import usages_of
from twinloop._experiment.hold_back import HoldBack
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop._ground.steps import STEPS, Step
from twinloop._ground.streams import Unit
from twinloop._ground.texts import enumerated
from twinloop.campaign import standing
from twinloop.campaign.history import Lesson, Planned, Progress
from twinloop.campaign.identify_and_plan.alone import best_alone
from twinloop.campaign.identify_and_plan.calibration import calibrated
from twinloop.campaign.identify_and_plan.choice import Choice
from twinloop.campaign.identify_and_plan.disproved import disproved
from twinloop.campaign.identify_and_plan.inside import inside
from twinloop.campaign.identify_and_plan.knowledge import Knowledge
from twinloop.campaign.identify_and_plan.learning import Learner, is_rough, stands_in
from twinloop.campaign.identify_and_plan.memory import Learnt, Memory
from twinloop.campaign.identify_and_plan.starts import first_genes, known_gains, starts_of
from twinloop.campaign.identify_and_plan.track_record import nearly_confirmed_in_a_row, unproven_risk
from twinloop.campaign.identify_and_plan.unmoved import lawless_states
from twinloop.campaign.identify_and_plan.wrong_readings import without_wrong_readings
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.presets import DefaultOptions
from twinloop.campaign.setup import Setup
from twinloop.errors import NotAvailable
from twinloop.identification.identify import UnderWay
from twinloop.law.actuation import delayed
from twinloop.law.ending import ending
from twinloop.planning.effect import gains_count, untunable_gains
from twinloop.planning.gusts import Gusts
from twinloop.planning.judging import Committee, Task
from twinloop.planning.planner import Planner
from twinloop.planning.proposal import Fared, Flown, Proposal
from twinloop.planning.reasons import them
from twinloop.planning.scored import Scored
from twinloop.planning.seen import Seen
from twinloop.planning.worth import in_vain
from twinloop.records import Record
from twinloop.test import Test

TOLERATED = 0.5
"""Share that is left of the delay that gains have to tolerate, after each prediction that came true."""
TUNED_WITH = 0.25
"""The same of the delay with which they are tuned: to fly well with it costs quality without it."""
AS_FAR_AGAIN = 1.0
"""Times as far as a single flight moved each state, beyond it and the task, up to which its law is believed not to end.
With nothing a heater is tuned a flight later; with 2 a car that lost its grip in its second flight loses it still."""


class IdentifyAndPlan:
    """Learns by identification, asks by planning.

    Args:
        setup: of the campaign.
        options: of the preset.
        workers: how the work is carried out.
        report: called with a `Progress` at every step.
    """

    def __init__(
        self,
        setup: Setup,
        options: DefaultOptions,
        workers: _core.Workers,
        report: Callable[[Progress], None],
    ) -> None:
        self.setup = setup
        self.options = options
        self.workers = workers
        self.report = report
        self.memory = Memory()
        self.learner = Learner(setup, options, workers, self._watch)
        self._known_gusts: tuple[Learnt, int, Gusts] | None = None
        self._tests: tuple[int | None, ...] = ()
        task = Task(setup.initial_state, setup.target_state, setup.steps)
        self.planner = Planner(
            setup.family,
            task,
            setup.quality,
            options,
            limits=setup.limits,
            seed=setup.seed,
            workers=workers,
            watch=self._watch,
        )

    def to_record(self) -> Record:
        """What is remembered, as plain values."""
        return self.memory.to_record()

    def restore(self, record: object, book: Logbook) -> None:
        """Remembers what a record holds."""
        memory = Memory.from_record(record, self.setup.signals, self.setup.family)
        for learnt in (memory.asked, memory.latest):
            if learnt is not None:
                book.check_known(learnt.experiments)
        self.memory = memory

    @property
    def iteration(self) -> int:
        """Number of experiments that are learnt."""
        return 0 if self.memory.latest is None else self.memory.latest.experiments

    def learnt_by(self, iteration: int) -> int:
        """The number of an identification is that of its experiments."""
        return iteration

    def forget(self, book: Logbook, asked_since: bool) -> None:
        """Back to the last `ask`, or to nothing if that had learnt the flight."""
        asked = None if asked_since else self.memory.asked
        latest = None if asked is None else replace(asked, gains=None)
        self.memory = Memory(asked=asked, latest=latest)
        if asked is not None:
            self._keep_gains(book, book.when_asked(asked.experiments, book.asked[-1][1].test))

    def learn(self, book: Logbook, at_once: bool = False) -> None:
        """Identifies from all that was told, beginning with what was known at the last `ask`."""

        def from_all_in(book: Logbook) -> None:
            latest, experiments = self.memory.latest, len(book.experiments)
            # Also of what is known already something may be asked that takes a while.
            self._tests = tuple(run.number for run in book.experiments)
            if latest is not None and (at_once or latest.experiments == experiments):
                return
            asked, begun = self.memory.asked, self.memory.under_way
            under_way = begun[1] if begun is not None and begun[0] == experiments else None
            learnt = self.learner.learnt(book, asked, under_way, partial(self._keep, experiments))
            self.memory = Memory(asked=asked, latest=learnt)

        asked = self.memory.asked
        again = [] if at_once else book.to_learn_again(0 if asked is None else asked.experiments)
        for past in again:
            # What was learnt when a test was asked for, from what is left.
            from_all_in(past)
            gains = self._gains(past) if self.options.tests == "ask" else None
            self.memory = replace(self.memory, asked=replace(self._latest(), gains=gains), under_way=None)
        if again:
            self._keep_gains(book, again[-1])
        from_all_in(book)

    def _keep_gains(self, book: Logbook, asked: Logbook) -> None:
        """The gains of the last `ask` are those of now if nothing was told since."""
        known = self.memory.asked
        if known is not None and known.gains is not None and book.same_flights(asked):
            self.memory = replace(self.memory, gains=(book.outcomes, known.gains))

    def _keep(self, experiments: int, under_way: UnderWay) -> None:
        self.memory = replace(self.memory, under_way=(experiments, under_way))

    def ask(self, book: Logbook, last: bool) -> Test:
        """The next test, with what is expected of it."""
        if self.options.tests != "ask":
            return self._asked_of_nobody(book)
        committee, best = self._committee(book), standing.best_flown(book)
        if best is None and committee.lawless:
            states = [self.setup.signals.state_names[i] for i in committee.lawless]
            raise NotAvailable(
                f"Campaign.ask: expected a flown test, or a twin with a law of {enumerated(states)}, found neither:"
                f" gains that answer to {them(states)} cannot be tuned. Fly a controller that you trust:"
                " campaign.test(gains), then campaign.tell."
            )
        if best is None and not committee.trusted:
            raise NotAvailable(
                "Campaign.ask: expected a twin that follows the runs that it was learnt from, or a flown test, found"
                " neither; fly a controller that you trust: campaign.test(gains), then campaign.tell."
            )
        tuned = self._gains(book)
        waits = self._last_of(book, tuned) is not None
        final = last and self.options.exploit_last and not waits
        flown = self._flown(book, best, tuned, committee)
        # Of what has no law nothing would be learnt without an excitation.
        exploits = self.setup.goal == "control" and not self.planner.excites(committee)
        found = self.planner.propose(
            committee,
            tuned,
            flown,
            self.setup.goal,
            len(book.tests),
            final or (exploits and len(book.flown) > 1 and not waits),
            final,
        )
        found = self._expected(book, committee, found)
        if final and flown.flies and in_vain(found.predicted, found.spread, flown.good):
            found = self._expected(book, committee, self.planner.again(committee, flown, len(book.tests)))
        test = book.new_test(
            found.genes,
            excitation=found.excitation,
            predicted=found.predicted,
            spread=found.spread,
            risk=found.risk,
            reason=found.reason,
            initial_state=found.initial_state,
            target_state=found.target_state,
            hold_back=found.hold_back,
        )
        book.asked.append((self.iteration, _planned(test, found)))
        self.memory = replace(self.memory, asked=replace(self._latest(), gains=tuned), under_way=None)
        return test

    def _expected(self, book: Logbook, committee: Committee, found: Proposal) -> Proposal:
        """A proposal with what holding back, known disturbances and the record of earlier predictions make of it."""
        hold_back = self._held_back(book, committee, found)
        if hold_back is not None:
            found = self.planner.held(committee, found, hold_back)
        gusts = committee.moved_by_gusts(self._as_test(book, found))
        predicted, spread = gusts.added_to(found.predicted, found.spread)
        spread = calibrated(spread, predicted, book.experiments, self._latest().misses)
        own = standing.fared(book, found.genes, found.excitation is not None)
        unproven = unproven_risk(book.experiments, own, self.setup.signals, committee.explains)
        risk = max(found.risk, own.risk, gusts.risk, unproven)
        return replace(found, predicted=predicted, spread=spread, risk=risk)

    def waiting_last(self, book: Logbook) -> Test | None:
        """The waiting test that is the last; the first that waits where `ask` plans none as the last."""
        if self.options.tests != "ask" or not self.options.exploit_last:
            return next(iter(book.waiting()), None)
        return self._last_of(book, self._gains(book))

    def _last_of(self, book: Logbook, tuned: Floats) -> Test | None:
        """The test that is waiting and flies the tuned gains as they are, if there is one: then that one is the last.

        So is one of the best gains flown, if the twin of today has planned it.
        """
        best, now = standing.best_flown(book), self.iteration
        planned = {entry.test for iteration, entry in book.asked if iteration == now}

        def is_last(test: Test) -> bool:
            again = (
                best is not None and test.number in planned and test.genes.tobytes() == best.genes.tobytes()
            )
            return test.excitation is None and (again or test.genes.tobytes() == tuned.tobytes())

        return next(filter(is_last, book.waiting()), None)

    def _held_back(self, book: Logbook, committee: Committee, found: Proposal) -> HoldBack | None:
        """What holds back the excitation of a test: states of which a committee cannot say where it leads them."""
        if found.excitation is None or (committee.leads and not committee.lawless):
            return None
        reached = standing.reached(book, found.genes)
        by = committee.lawless if committee.leads else None
        return self.planner.held_back(found.initial_state, found.target_state, reached, by)

    def _as_test(self, book: Logbook, found: Proposal) -> Test:
        """The test that a proposal would become."""
        return replace(
            book.of_task(found.genes, len(book.tests)),
            initial_state=found.initial_state, target_state=found.target_state, excitation=found.excitation,
            hold_back=found.hold_back,
        )  # fmt: skip

    def _asked_of_nobody(self, book: Logbook) -> Test:
        """A test that no committee chose."""
        genes, excitation = self.planner.baseline(len(book.tests), first_genes(self.setup, book))
        test = book.new_test(genes, excitation=excitation, reason="Chosen without a committee.")
        plan = Planned(
            test.number, tuple(genes.tolist()), predicted=None, spread=None, risk=None, safe=None, bits=None,
            gain=None, reason=test.reason,
        )  # fmt: skip
        book.asked.append((self.iteration, plan))
        self.memory = replace(self.memory, asked=self._latest(), under_way=None)
        return test

    def _flown(self, book: Logbook, best: Test | None, tuned: Floats, committee: Committee) -> Flown:
        """What the planner has to know of the flights so far."""
        known = best is not None and standing.flies(book, best.number)
        good = standing.measured_on_task(book, best) if best is not None and known else None
        # One wrong reading is no place where a flight has been.
        flights = without_wrong_readings(book.experiments, self.setup.signals)
        return Flown(
            tuned if best is None else best.genes,
            known,
            [run.usage for run in flights if run.kept_envelope] or [run.usage for run in flights],
            float("inf") if good is None else good,
            standing.unfit(book),
            times=1 if best is None else standing.times_flown(book, best.genes),
            fared=Fared(0, 0) if best is None else standing.fared(book, best.genes, excited=True),
            borne=standing.borne(book),
            seen=None if nearly_confirmed_in_a_row(book.experiments) else self._seen(book),
            begins=float(usages_of(self.setup.signals, self.setup.initial_state[np.newaxis]).max()),
            disproved=() if good is None else disproved(self.planner, committee, book, good),
        )

    def _seen(self, book: Logbook) -> Seen:
        """Where the flights have been, and where the task leads."""
        setup = self.setup
        ends = np.concatenate([setup.initial_state[np.newaxis], np.atleast_2d(setup.target_state)])
        every = without_wrong_readings(book.experiments, setup.signals)
        # Where one has left is no place where flights are known to be well.
        flights = [run for run in every if not standing.was_lost(run)]
        return Seen(
            standing.read_in(book, flights or inside(every)), np.stack([ends.min(axis=0), ends.max(axis=0)])
        )

    def best_test(self, book: Logbook, at_once: bool = False) -> Test:
        """The gains tuned on the committee, unless it is not confident that they beat the best ones flown."""
        if self.memory.best is not None and self.memory.best[0] == book.revision:
            return self.memory.best[1]
        committee = self._committee(book)
        best = best_alone(self.planner, committee, book, self.options.draws)
        choice = Choice(
            self.planner,
            committee,
            book,
            self.options.draws,
            self.options.confidence,
            self._latest().misses,
            is_rough(self._latest().identified),
        )
        if at_once:
            tuned, note = known_gains(self.memory, best)
            # They may be of a twin that still had a law of what this one has none of.
            found = choice.between(tuned if best is None else committee.as_flown(tuned, best.genes), best)
            return replace(found, reason=f"{found.reason}{note}")
        answer = choice.between(self._within_reach(committee, self._gains(book), book), best)
        self.memory = replace(self.memory, best=(book.revision, answer))
        return answer

    def _within_reach(self, committee: Committee, tuned: Floats, book: Logbook) -> Floats:
        """Tuned gains; only those that the next flight may be flown with where they may lead too far.

        So they may as long as no prediction has come true, and where they lead further than flights have.
        """
        if not committee.predicts_limits:
            return tuned
        best = standing.best_flown(book)
        flown = self._flown(book, best, tuned, committee)
        if flown.seen is None and self.planner.is_near(committee, tuned, flown):
            return tuned
        goal, number = self.setup.goal, len(book.tests)
        found = self.planner.propose(committee, tuned, flown, goal, number, exploit=True, last=True)
        # What may not be tried is not recommended either.
        return found.genes if found.safe or best is not None else tuned

    def first_excitation(self, number: int, genes: Floats) -> tuple[Floats | None, HoldBack | None]:
        """A gentle chirp that fades out, held back by what the states do."""
        return self.planner.first_excitation(number, genes)

    def knowledge(self, book: Logbook) -> Knowledge:
        """What was learnt last, beside all that was told."""
        assert self.memory.latest is not None
        return Knowledge(self.setup, book, self.memory.latest, self.memory.asked)

    @property
    def asked_model(self) -> _core.Model | None:
        """The best model when the last test was asked for."""
        return None if self.memory.asked is None else self.memory.asked.identified.model

    def history(self, book: Logbook) -> tuple[Lesson, ...]:
        """One record for each identification."""
        return () if self.memory.latest is None else standing.with_asked(book, self.memory.latest.lessons)

    def committee(self) -> Sequence[_core.Model]:
        """Members that follow the flown tests, the best first."""
        return self._latest().believed

    # Inside

    def _latest(self) -> Learnt:
        assert self.memory.latest is not None
        return self.memory.latest

    def _committee(self, book: Logbook) -> Committee:
        latest = self._latest()
        sensors = latest.identified.sensors(self.setup.signals.n_x)
        # Gains that tolerate a delay and fly as predicted say little of gains that do not: a part of it is left. One
        # that nobody knew of would make flights worse than predicted.
        true = nearly_confirmed_in_a_row(book.experiments, or_better=True)
        # The lag of a linear twin that stands for what no law explains is such a margin already.
        wanted = self.options.delay_margin and not stands_in(latest.identified)
        tolerated, tuned_with = (
            max(share**true, self.options.delay_least) for share in (TOLERATED, TUNED_WITH)
        )

        def slower(periods: float) -> list[_core.Model]:
            return [delayed(latest.believed[0], self.setup.signals, periods)] if wanted else []

        borne = slower(tolerated)
        flights = without_wrong_readings(latest.flights(book.experiments), self.setup.signals)
        lawless = lawless_states(latest.identified, flights, self.setup)
        best = standing.best_flown(book)
        flown = None if best is None else best.genes
        untunable = untunable_gains(self.planner, latest.believed, lawless, flown)
        return Committee(
            latest.believed,
            sensors,
            latest.follows,
            delayed=borne,
            explains=latest.explained,
            gusts=self._gusts(latest, len(book.experiments)),
            tuned_delayed=borne if tuned_with == tolerated else slower(tuned_with),
            foretells=latest.explained and nearly_confirmed_in_a_row(book.experiments) > 0,
            ending=self._ending(latest, book),
            gains_count=gains_count(self.planner, latest.believed[:1], untunable),
            lawless=lawless,
            untunable=untunable,
        )

    def _ending(self, latest: Learnt, book: Logbook) -> _core.Model | None:
        """The best law where what states do ends where flights and the task have been; None where that is off.

        After a single flight, as far again: that one is gentle, and gains that do better lead where it has not been.
        """
        if not self.options.ends:
            return None
        seen, signals = self._seen(book), self.setup.signals
        bounds = seen.both if len(book.experiments) > 1 else seen.around(AS_FAR_AGAIN, signals)
        return ending(latest.believed[0], signals, bounds)

    def _gusts(self, latest: Learnt, experiments: int) -> Gusts:
        """Disturbances that are known, drawn once for each lesson; none that are known to be a model error."""
        known = self._known_gusts
        if known is not None and known[0] is latest and known[1] == experiments:
            return known[2]
        setup, lesson = self.setup, latest.lessons[-1]
        errors = [i for i, name in enumerate(setup.signals.state_names) if lesson.cause(name) == "law"]
        noise = latest.identified.noise(setup.signals).without(errors)
        unit = Unit(setup.seed).part(experiments, 3)
        gusts = Gusts(latest.identified.model, noise, setup.quality, unit, setup.limits, self.workers)
        self._known_gusts = (latest, experiments, gusts)
        return gusts

    def _gains(self, book: Logbook) -> Floats:
        """Gains tuned on the committee; the best ones flown where that cannot say where they lead."""
        experiments = len(book.experiments)
        if self.memory.gains is not None and self.memory.gains[0] == book.outcomes:
            return self.memory.gains[1]
        committee, asked = self._committee(book), self.memory.asked
        starts = starts_of(self.setup, book, committee, None if asked is None else asked.gains)
        genes = starts[0]
        if committee.leads:
            genes = self.planner.tune(committee, starts, experiments, self._scored(book))
        # What an interruption has left unlearnt must not show in what is tuned afterwards.
        if self._latest().experiments == experiments:
            self.memory = replace(self.memory, gains=(book.outcomes, genes), scores=None)
        return genes

    def _scored(self, book: Logbook) -> Scored:
        """Scores of a tuning that was cut; what is judged from here on is remembered."""
        outcomes, before = book.outcomes, self.memory.scores
        if self._latest().experiments != len(book.experiments):
            return Scored()

        def keep(scores: tuple[Floats, ...]) -> None:
            self.memory = replace(self.memory, scores=(outcomes, scores))

        return Scored(before[1] if before is not None and before[0] == outcomes else (), keep)

    def _watch(self, step: Step) -> None:
        latest = self.memory.latest
        lesson = None if latest is None else latest.lessons[-1]
        self.report(
            Progress(
                phase=step,
                iteration=max(1, self.iteration),
                generation=STEPS.index(step) + 1,
                generations=len(STEPS),
                experiments=len(self._tests),
                tests=() if lesson is None else lesson.tests,
                open_loop=(),
                closed_loop=() if lesson is None else lesson.closed_loop,
                archive_size=0 if latest is None else len(latest.believed),
                evaluations=0,
            )
        )


def _planned(test: Test, found: Proposal) -> Planned:
    """The record of a proposal that became a test."""
    return Planned(
        test=test.number,
        genes=tuple(found.genes.tolist()),
        predicted=found.predicted,
        spread=found.spread,
        risk=found.risk,
        safe=found.safe,
        bits=found.disagreement / float(log(2.0)),
        gain=found.gain,
        reason=found.reason,
    )
