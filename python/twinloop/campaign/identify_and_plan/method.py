"""The way of the preset `default`: identify a twin and a committee, tune the gains on them, plan the next test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.campaign import standing
from twinloop.campaign.examination.rivals import Rival
from twinloop.campaign.history import Lesson, Planned, Progress
from twinloop.campaign.identify_and_plan.calibration import (
    OF_PARTS,
    calibrated,
    factor,
    needed_factor,
    residuals_of_flights,
)
from twinloop.campaign.identify_and_plan.choice import UNKNOWN, Choice
from twinloop.campaign.identify_and_plan.diagnostics import doubts, other_commands
from twinloop.campaign.identify_and_plan.following import following, foretold, unexplained
from twinloop.campaign.identify_and_plan.selection import learnt_from
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.presets import DefaultOptions
from twinloop.campaign.setup import Setup
from twinloop.campaign.twin_errors import errors_of, free_runs
from twinloop.controllers import lqr_gains
from twinloop.controllers.state_feedback import FeedbackFamily
from twinloop.elementary import log
from twinloop.errors import InvalidInput, NotAvailable, engine_input
from twinloop.hold_back import HoldBack
from twinloop.identification.identified import Identified
from twinloop.identification.identify import UnderWay, identify_runs
from twinloop.identification.records import Run
from twinloop.identification.remarks import symbols_of
from twinloop.identification.sensors.offsets import moved
from twinloop.law.accuracy import TestErrors
from twinloop.law.twin import Twin
from twinloop.objectives import normalised_error
from twinloop.planning.gains import Scored
from twinloop.planning.judging import Committee, Task
from twinloop.planning.planner import Flown, Planner
from twinloop.records import Record, Recorded
from twinloop.steps import STEPS, Step
from twinloop.streams import Unit
from twinloop.test import Test

FEWEST = 4
"""Members of a committee that are kept in any case."""
WRONG = 0.5
"""Normalised closed-loop error on a flown test at which a member of the committee is not believed."""


@dataclass(frozen=True, eq=False)
class Learnt(Recorded, kind="learnt"):
    """What was learnt from the first experiments of a campaign.

    Args:
        told: how many they were.
        identified: the model, its committee and how they were found.
        believed: members of the committee that follow the flights, the best first.
        follows: whether the best model, flown by itself, follows at least half of them.
        needed: factors on the committees' spreads that the flights would have needed, each predicted before it was
            learnt.
        lessons: records of this identification and of those that it began with.
        gains: that were tuned on the committee when a test was asked for; None: none were.
        models: the best model of each identification, as `lessons`; what an older version wrote has none.
    """

    told: int
    identified: Identified
    believed: Sequence[_core.Model]
    follows: bool
    needed: tuple[float, ...]
    lessons: tuple[Lesson, ...]
    gains: Floats | None = None
    models: tuple[_core.Model, ...] = ()


@dataclass(frozen=True, eq=False)
class Memory(Recorded, kind="memory_of_default"):
    """What the preset `default` remembers; all of it are values that never change.

    Args:
        asked: what was known when the last test was asked for. Learning begins here, whoever looks in between.
        latest: what was learnt last; shown to whoever looks, and used by `ask` if it is of all that was told.
        gains: tuned on the latest committee, after so many experiments and failures.
        best: the controller to fly, at the revision of the logbook that it was chosen at.
        under_way: an identification that is not finished, and of how many experiments it is.
        scores: of the gains that were judged, of a tuning on the latest committee that is not finished.
    """

    VERSION = 2

    asked: Learnt | None = None
    latest: Learnt | None = None
    gains: tuple[int, Floats] | None = None
    best: tuple[int, Test] | None = None
    under_way: tuple[int, UnderWay] | None = None
    scores: tuple[int, tuple[Floats, ...]] | None = None


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
        self._told: tuple[int | None, ...] = ()
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
                book.first(learnt.told)
        self.memory = memory

    @property
    def iteration(self) -> int:
        """Number of experiments that are learnt."""
        return 0 if self.memory.latest is None else self.memory.latest.told

    def learn(self, book: Logbook, at_once: bool = False) -> None:
        """Identifies from all that was told, beginning with what was known at the last `ask`."""
        latest = self.memory.latest
        if latest is not None and (at_once or latest.told == len(book.experiments)):
            return
        self._told = tuple(run.number for run in book.experiments)
        self.memory = Memory(asked=self.memory.asked, latest=self._learnt(book))

    def _keep(self, told: int, under_way: UnderWay) -> None:
        self.memory = replace(self.memory, under_way=(told, under_way))

    def _learnt(self, book: Logbook) -> Learnt:
        asked, told = self.memory.asked, len(book.experiments)
        needed = () if asked is None else self._calibrated(asked, book)
        flights = learnt_from(book.experiments, self.options.most_readings)
        runs = [Run.of(run.trajectory.states, run.trajectory.commands) for run in flights]
        begun = self.memory.under_way
        identified = identify_runs(
            runs,
            self.setup.signals,
            self.options,
            rests=self._rests(),
            seed=self.setup.seed,
            iteration=told,
            known=None if asked is None else asked.identified,
            workers=self.workers,
            watch=self._watch,
            under_way=begun[1] if begun is not None and begun[0] == told else None,
            keep=partial(self._keep, told),
        )
        followed = following(identified.members, book.experiments, self.setup.limits, self.workers)
        free, frozen = followed.free, followed.frozen
        # A member that cannot follow the flights that it was learnt from is no member (E-SINDy's stability filter).
        wrong = (free > np.maximum(WRONG * frozen, 4.0 * free[0])).any(axis=1)
        # Where hardly any can, the ones that go wrong least still show where more must be known.
        followers = {0, *np.flatnonzero(~wrong).tolist()}
        followers |= set(
            [i for i in followed.order() if i not in followers][: max(0, FEWEST - len(followers))]
        )
        believed = [identified.members[i] for i in sorted(followers)]
        follows = self._can_follow(identified, free[0], frozen)
        errors_of_best = free_runs(identified.members[:1], book, self.workers)[0]
        noise = identified.noise(self.setup.signals)
        unit = Unit(self.setup.seed).part(told, 1)
        off = foretold(identified.members[0], book.experiments, noise, unit, self.setup.limits, self.workers)
        missed = unexplained(free[0], frozen, off)
        lesson = self._lesson(identified, follows, book, errors_of_best.tolist(), missed)
        before = () if asked is None else asked.lessons
        earlier = () if asked is None else asked.models
        models = (*earlier, identified.model)
        return Learnt(told, identified, believed, follows, needed, (*before, lesson), models=models)

    def ask(self, book: Logbook, last: bool) -> Test:
        """The next test, with what is expected of it."""
        number = len(book.tests)
        if self.options.tests != "ask":
            genes, excitation = self.planner.baseline(number, self._first_genes(book))
            test = book.new_test(genes, excitation=excitation, reason="No committee was asked.")
            plan = Planned(
                test.number, tuple(genes.tolist()), float("nan"), 0.0, 0.0, True, 0.0, 0.0, test.reason
            )
            book.asked.append((self.iteration, plan))
            self.memory = replace(self.memory, asked=self._latest(), under_way=None)
            return test
        committee, best = self._committee(), standing.best_flown(book)
        if best is None and not committee.trusted:
            raise NotAvailable(
                "Campaign.ask: expected a twin that follows the runs that it was learnt from, or a flown test, found"
                " neither; fly a controller that you trust: campaign.test(gains), then campaign.tell."
            )
        tuned = self._gains(book)
        found = self.planner.propose(
            committee,
            tuned,
            Flown(
                tuned if best is None else best.genes,
                best is not None and standing.flies(book, best.number),
                [run.usage for run in book.experiments],
                self._good(book, best),
                standing.unfit(book),
            ),
            self.setup.goal,
            number,
            self._exploits(book, tuned, last),
            last and self.options.exploit_last,
        )
        found = replace(found, spread=calibrated(found.spread, found.predicted, book.experiments))
        test = book.new_test(
            found.genes,
            excitation=found.excitation,
            predicted=found.predicted,
            spread=found.spread,
            risk=found.risk,
            reason=found.reason,
            initial_state=found.initial_state,
            target_state=found.target_state,
        )
        plan = Planned(
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
        book.asked.append((self.iteration, plan))
        self.memory = replace(self.memory, asked=replace(self._latest(), gains=tuned), under_way=None)
        return test

    def best_test(self, book: Logbook, at_once: bool = False) -> Test:
        """The gains tuned on the committee, unless it is not confident that they beat the best ones flown."""
        if self.memory.best is not None and self.memory.best[0] == book.revision:
            return self.memory.best[1]
        best = standing.best_flown(book)
        choice = Choice(self.planner, self._committee(), book, self.options.draws, self.options.confidence)
        if at_once:
            tuned, note = self._known_gains(best)
            found = choice.between(tuned, best)
            return replace(found, reason=f"{found.reason}{note}")
        answer = choice.between(self._gains(book), best)
        self.memory = replace(self.memory, best=(book.revision, answer))
        return answer

    def first_excitation(self, number: int, genes: Floats) -> tuple[Floats | None, HoldBack | None]:
        """A gentle chirp that fades out, held back by what the states do."""
        return self.planner.first_excitation(number, genes)

    def twin(self, book: Logbook) -> Twin:
        """The best model, with the committee and the sensors' noise for its band."""
        latest = self._latest()
        return self._twin(latest, book, errors_of(latest.identified.model, book, self.workers))

    def _twin(self, learnt: Learnt, book: Logbook, rows: Sequence[TestErrors]) -> Twin:
        found = learnt.identified
        noise = found.noise(self.setup.signals)
        inflation = OF_PARTS if found.of_parts else factor(learnt.needed)
        if found.exact:
            # What follows exact readings to rounding is the law: its members are too sure of nothing.
            residuals = residuals_of_flights(found.model, book.experiments[: learnt.told], self.setup.limits)
            noise, inflation = replace(noise, sensors=residuals), 1.0
        return Twin(
            found.model,
            self.setup.signals,
            rows,
            self.options.divergence_factor,
            members=learnt.believed,
            noise=noise,
            seed=self.setup.seed,
            inflation=inflation,
            remarks=learnt.lessons[-1].remarks,
            flights=[run.trajectory for run in book.experiments],
        )

    def _calibrated(self, learnt: Learnt, book: Logbook) -> tuple[float, ...]:
        """Factors that the flights told since would have needed, after those before them."""
        # A committee with parts in it says nothing of those that come after it.
        if learnt.identified.of_parts:
            return learnt.needed
        twin = self._twin(learnt, book, [])
        needed = [
            needed_factor(twin, run.replayed, run.trajectory) for run in book.experiments[learnt.told :]
        ]
        return (*learnt.needed, *(found for found in needed if found is not None))

    @property
    def asked_model(self) -> _core.Model | None:
        """The best model when the last test was asked for."""
        return None if self.memory.asked is None else self.memory.asked.identified.model

    def twins_before(self, book: Logbook) -> tuple[tuple[int, Twin], ...]:
        """Twins that have not learnt all: with bands those of the last question and of today, else models alone."""
        latest, asked, divergence = self._latest(), self.memory.asked, self.options.divergence_factor
        told = [lesson.iteration for lesson in latest.lessons[-len(latest.models) :]] if latest.models else []
        found = {
            learnt: Twin(model, self.setup.signals, (), divergence)
            for learnt, model in zip(told, latest.models, strict=True)
        }
        if asked is not None:
            found[asked.told] = self._twin(asked, book, [])
        # Of today it is where flights were told that nobody has learnt yet.
        found[latest.told] = self._twin(latest, book, [])
        return tuple((learnt, found[learnt]) for learnt in sorted(found) if learnt < len(book.experiments))

    def innovations(self, book: Logbook) -> tuple[Floats, ...] | None:
        """Whitened prediction errors of the twin's own filter; None of exact readings, which leave rounding alone."""
        latest = self._latest()
        if latest.identified.exact:
            return None
        runs = [
            Run.of(run.trajectory.states, run.trajectory.commands).continued(self.setup.signals)
            for run in book.experiments[: latest.told]
        ]
        runs = moved(runs, self.setup.signals, latest.identified.offsets)
        with engine_input():
            found = _core.predictions(
                latest.identified.model,
                self.setup.limits.engine,
                [chain.engine for chain in latest.identified.chains],
                [(run.states, run.weights, run.commands) for run in runs],
                workers=self.workers,
            )
        return None if found is None else tuple(errors for errors, _ in found)

    def rivals(self) -> tuple[Rival, ...]:
        """Subsets of terms that annealing has found nearly as good."""
        identified, signals = self._latest().identified, self.setup.signals
        symbols = symbols_of(signals)
        return tuple(
            Rival(
                signals.state_names[found.chain.states[0]],
                tuple(sorted(identified.pool.text(node, symbols) for node in subset)),
                above,
            )
            for found in identified.sums
            for subset, above in ((tuple(found.weights), 0.0), *found.others)
            if above > 0.0 or subset == tuple(found.weights)
        )

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

    def _committee(self) -> Committee:
        latest = self._latest()
        sensors = latest.identified.sensors(self.setup.signals.n_x)
        return Committee(latest.believed, sensors, latest.follows)

    def _can_follow(self, identified: Identified, free: Floats, frozen: Floats) -> bool:
        """Whether the best model, flown by itself, follows at least half of the runs that it was learnt from."""
        scales = np.array([state.scale for state in self.setup.signals.states])
        noise = float(np.square(identified.sensors(len(scales)) / scales).mean())
        lost = free - noise > WRONG * np.maximum(frozen - noise, 2.0 * noise)
        return bool(np.isfinite(identified.left)) and 2 * int(lost.sum()) <= len(lost)

    def _exploits(self, book: Logbook, tuned: Floats, last: bool) -> bool:
        """Whether the tuned gains are flown as they are, unless that is what a test that is waiting does."""
        wanted = (last and self.options.exploit_last) or (
            self.setup.goal == "control" and len(book.flown) > 1
        )
        return wanted and not any(
            test.genes.tobytes() == tuned.tobytes() and test.excitation is None for test in book.waiting()
        )

    def _first_genes(self, book: Logbook) -> Floats:
        """Of the first test that was flown; the middle of the box where none was."""
        first = standing.first_flown(book)
        if first is not None:
            return first.genes
        return self.setup.family.from_unit(np.full(self.setup.family.size, 0.5))

    def _gains(self, book: Logbook) -> Floats:
        """Gains tuned on the committee; the best ones flown where no model can be trusted."""
        told = len(book.experiments)
        if self.memory.gains is not None and self.memory.gains[0] == book.outcomes:
            return self.memory.gains[1]
        committee, asked = self._committee(), self.memory.asked
        best, first = standing.best_flown(book), self._first_genes(book)
        starts = [first if best is None else best.genes]
        if asked is not None and asked.gains is not None:
            starts.append(asked.gains)
        if first.tobytes() != starts[0].tobytes():
            starts.append(first)
        starts += self._linear_gains(committee)
        genes = starts[0]
        if committee.trusted:
            genes = self.planner.tune(committee, starts, told, self._scored(book))
        # What an interruption has left unlearnt must not show in what is tuned afterwards.
        if self._latest().told == told:
            self.memory = replace(self.memory, gains=(book.outcomes, genes), scores=None)
        return genes

    def _scored(self, book: Logbook) -> Scored:
        """Scores of a tuning that was cut; what is judged from here on is remembered."""
        outcomes, before = book.outcomes, self.memory.scores
        if self._latest().told != len(book.experiments):
            return Scored()

        def keep(scores: tuple[Floats, ...]) -> None:
            self.memory = replace(self.memory, scores=(outcomes, scores))

        return Scored(before[1] if before is not None and before[0] == outcomes else (), keep)

    def _known_gains(self, best: Test | None) -> tuple[Floats, str]:
        """Gains as they were tuned last, or the best flown where none were, and what to say of it; nothing is tuned.

        Raises:
            NotAvailable: there are neither.
        """
        if self.memory.gains is not None:
            return self.memory.gains[1], ""
        asked = self.memory.asked
        known = [] if asked is None or asked.gains is None else [asked.gains]
        known += [] if best is None else [best.genes]
        if not known:
            raise NotAvailable(f"{UNKNOWN}none has flown, and none was tuned yet. Let it learn to its end.")
        return known[0], " Nothing was tuned on this twin yet."

    def _linear_gains(self, committee: Committee) -> list[Floats]:
        """Gains of a full state feedback by LQR on the linearised twin; none for other families, or where it fails."""
        family = self.setup.family
        if not isinstance(family, FeedbackFamily) or not committee.trusted:
            return []
        try:
            return [family.genes(lqr_gains(committee.members[0], family, self.setup.final_target))]
        except (NotAvailable, InvalidInput):
            return []

    def _good(self, book: Logbook, best: Test | None) -> float:
        """Quality of the best test flown for the campaign's own task inside the envelope; infinite where none was."""
        if best is None or not (standing.flies(book, best.number) and standing.on_task(book, best)):
            return float("inf")
        measured = standing.measured(book, best.number)
        return float("inf") if measured is None else measured

    def _rests(self) -> list[Floats]:
        """Commands that the family gives when there is nothing to do: actuators may rest there before a run."""
        family, target = self.setup.family, np.atleast_2d(self.setup.target_state)[0]
        middle = np.array([0.5 * (gain.low + gain.high) for gain in family.gains])
        return [family.controller(middle).command(target, target)]

    def _lesson(
        self, identified: Identified, follows: bool, book: Logbook, free: list[float], missed: Floats
    ) -> Lesson:
        return Lesson(
            iteration=len(book.experiments),
            tests=self._told,
            form=identified.model.form,
            terms=identified.terms,
            misfit=identified.misfit,
            readings=identified.readings,
            ignored=identified.ignored,
            sensors=tuple(identified.sensors(self.setup.signals.n_x).tolist()),
            lags=tuple(actuator.lag for actuator in identified.actuation.actuators),
            delays=tuple(actuator.delay for actuator in identified.actuation.actuators),
            hidden=tuple(
                (hidden.commands, hidden.squared, hidden.rest, hidden.time)
                for hidden in identified.actuation.hidden
            ),
            offsets=tuple(identified.offsets.tolist()),
            closed_loop=tuple(free),
            normalised=tuple(
                normalised_error(error, run.frozen) for error, run in zip(free, book.experiments, strict=True)
            ),
            follows=follows,
            remarks=(
                *identified.remarks,
                *doubts(
                    book.experiments,
                    self.setup.signals,
                    follows or not np.isfinite(identified.left),  # of one that diverges it is said already
                    self.setup.steps,
                    missed.tolist() if np.isfinite(identified.left) else (),
                    () if follows else other_commands(book.experiments),
                ),
            ),
        )

    def _watch(self, step: Step) -> None:
        latest = self.memory.latest
        lesson = None if latest is None else latest.lessons[-1]
        self.report(
            Progress(
                phase=step,
                iteration=max(1, self.iteration),
                generation=STEPS.index(step) + 1,
                generations=len(STEPS),
                told=len(self._told),
                tests=() if lesson is None else lesson.tests,
                open_loop=(),
                closed_loop=() if lesson is None else lesson.closed_loop,
                archive_size=0 if latest is None else len(latest.believed),
                evaluations=0,
            )
        )
