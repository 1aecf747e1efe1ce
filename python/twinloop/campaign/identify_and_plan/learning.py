"""Learning: from all flights that were told to a twin, the members of its committee that follow, and their record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.campaign.history import Lesson
from twinloop.campaign.identify_and_plan.diagnostics import diagnostics_of, in_pulses, other_commands
from twinloop.campaign.identify_and_plan.following import (
    Following,
    expected_misses,
    following,
    in_pieces,
    unexplained,
)
from twinloop.campaign.identify_and_plan.knowledge import Knowledge
from twinloop.campaign.identify_and_plan.memory import Learnt
from twinloop.campaign.identify_and_plan.recurring import recurring_states
from twinloop.campaign.identify_and_plan.selection import learnt_from
from twinloop.campaign.identify_and_plan.unmoved import unmoved_states
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.presets import DefaultOptions
from twinloop.campaign.setup import Setup
from twinloop.identification.identified import Identified
from twinloop.identification.identify import UnderWay, identify_runs
from twinloop.identification.records import Run
from twinloop.objectives import closed_loop, normalised_error
from twinloop.remarks import Remark, note, serious
from twinloop.steps import Watch
from twinloop.streams import Unit

FEWEST = 4
"""Members of a committee that are kept in any case."""
PLAIN = 1_000_000
"""Added to the number of an identification whose law may be linear only, so that it draws from streams of its own."""
ROUGH = serious(
    "rough",
    "No law with other than linear terms follows the flights as well when it is flown by itself. The twin has linear"
    " terms only: it follows them roughly, which may do to tune gains, and is no simulator.",
)
"""What is said of a twin that is linear because no other one follows."""
BEFORE = note(
    "known-before",
    "What all flights teach misses some of them, flown by itself; what was known before the last of them misses none."
    " The twin is the one of before.",
)
"""What is said of a twin that has not learnt all flights and follows them, where the one that has does not."""
WRONG = 0.5
"""Normalised closed-loop error on a flown test at which a member of the committee is not believed."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What was identified, beside the flights that it was learnt from.

    Args:
        identified: a model and a committee.
        followed: free runs of the members.
        follows: whether the best of them follows at least half of the flights.
        recurring: states that an error of the law moves, and no disturbance.
        unmoved: states that move, and nothing moves them by the law.
        missed: times further from each flight than noise and disturbances explain that the best one is; 0 where they
            do.
    """

    identified: Identified
    followed: Following
    follows: bool
    recurring: Sequence[int]
    unmoved: Sequence[int]
    missed: Sequence[float]

    @property
    def worst(self) -> float:
        """Mean square of the best member on the flight that it misses most, over that of the model that never moves."""
        return self.followed.worst(0)

    @property
    def explained(self) -> bool:
        """Whether it follows the flights, and noise and disturbances explain what its free runs miss."""
        return self.follows and not any(self.missed)


@dataclass(frozen=True)
class Learner:
    """Learns from a logbook.

    Args:
        setup: of the campaign.
        options: of the preset.
        workers: how the work is carried out.
        watch: called with each step that begins.
    """

    setup: Setup
    options: DefaultOptions
    workers: _core.Workers
    watch: Watch

    def learnt(
        self,
        book: Logbook,
        asked: Learnt | None,
        under_way: UnderWay | None,
        keep: Callable[[UnderWay], None],
    ) -> Learnt:
        """What all that was told teaches.

        Args:
            book: with at least one experiment.
            asked: what was known when the last test was asked for; None: nothing.
            under_way: the identification of the same experiments, as far as it had come; None: it begins.
            keep: called with the identification wherever it may go on from later.
        """
        told, knowledge = len(book.experiments), Knowledge(self.setup, self.options, book)
        needed = () if asked is None else knowledge.needed_factors(asked)
        flights = learnt_from(book.experiments, self.options.most_readings)
        identified_from = partial(
            identify_runs,
            [Run.of(run.trajectory.states, run.trajectory.commands) for run in flights],
            self.setup.signals,
            rests=self._rests(),
            seed=self.setup.seed,
            workers=self.workers,
            watch=self.watch,
        )
        identified = identified_from(
            self.options,
            iteration=told,
            earlier=None if asked is None else asked.identified,
            under_way=under_way,
            keep=keep,
        )
        answer = self._flown(identified, book)
        if not answer.explained and asked is not None:
            # It has not learnt the flights since: where it explains all of them, it knows more.
            known = self._flown(as_known_before(asked.identified), book)
            answer = known if known.explained else answer
        if not answer.explained and self.options.plain != self.options:
            # What is too coarse for a simulator may still tell better gains from worse.
            plain = identified_from(self.options.plain, iteration=PLAIN + told)
            rough = self._flown(with_remark(plain, ROUGH), book)
            if rough.follows and (not answer.follows or rough.worst < answer.worst):
                answer = rough
        identified, follows = answer.identified, answer.follows
        believed = [identified.members[i] for i in believed_members(answer.followed)]
        lesson = self._lesson(answer, book)
        before, models, ensembles = (
            ((), (), ()) if asked is None else (asked.lessons, asked.models, asked.ensembles)
        )
        learnt = Learnt(
            told, identified, believed, follows, needed, (*before, lesson), models=(*models, identified.model)
        )
        return replace(learnt, ensembles=(*ensembles, knowledge.ensemble(learnt)))

    def _rests(self) -> list[Floats]:
        """Commands that the family gives when there is nothing to do: actuators may rest there before a run."""
        family, target = self.setup.family, np.atleast_2d(self.setup.target_state)[0]
        middle = np.array([0.5 * (gain.low + gain.high) for gain in family.gains])
        return [family.controller(middle).command(target, target)]

    def _flown(self, identified: Identified, book: Logbook) -> Answer:
        """What was identified, with how it follows the flights when it is flown by itself."""
        followed, follows = self._following(identified, book)
        recurring = self._recurring(identified, book)
        missed = self._unexplained(identified, book, followed, recurring)
        unmoved = unmoved_states(identified, book.experiments, self.setup)
        return Answer(identified, followed, follows, recurring, unmoved, missed)

    def _following(self, identified: Identified, book: Logbook) -> tuple[Following, bool]:
        """How members follow the flights, and whether the best one, flown by itself, follows at least half of them.

        Where commands were sent in pulses, under those.
        """
        followed = following(identified.members, book.experiments, self.setup.limits, self.workers)
        if not np.isfinite(identified.chi_squared):
            return followed, False
        scales = np.array([state.scale for state in self.setup.signals.states])
        noise = float(np.square(identified.sensors(len(scales)) / scales).mean())
        free, frozen = followed.free[0], followed.frozen
        lost = free - noise > WRONG * np.maximum(frozen - noise, 2.0 * noise)
        flights, numbers = book.experiments, np.flatnonzero(lost)
        pulsed = in_pulses([flights[j] for j in numbers])
        again = [j for j in numbers if flights[j].number in pulsed]
        if again:
            model, limits = identified.members[0], self.setup.limits
            lost[again] = in_pieces(model, [flights[j] for j in again], limits, self.workers) > WRONG
        return followed, 2 * int(lost.sum()) <= len(lost)

    def _recurring(self, identified: Identified, book: Logbook) -> list[int]:
        """States that an error of the law moves, and no disturbance; none are known where the best model diverges."""
        if not np.isfinite(identified.chi_squared):
            return []
        setup = self.setup
        return recurring_states(identified, book.experiments, setup.signals, setup.limits, self.workers)

    def _unexplained(
        self, identified: Identified, book: Logbook, followed: Following, recurring: Sequence[int]
    ) -> list[float]:
        """By how much more than noise and disturbances the best model misses each flight; none where it diverges.

        Nothing of what recurs is a disturbance. Under the commands of a flight that were sent in pulses it is judged
        elsewhere, piece by piece.
        """
        if not np.isfinite(identified.chi_squared):
            return []
        noise = identified.noise(self.setup.signals)
        noise = replace(
            noise, correlated=tuple(each for each in noise.correlated if each.states[0] not in recurring)
        )
        unit = Unit(self.setup.seed).part(len(book.experiments), 1)
        model, limits, flights = identified.members[0], self.setup.limits, book.experiments
        expected = expected_misses(model, flights, noise, unit, limits, self.workers)
        steered = np.array([run.test is not None for run in flights])
        missed = unexplained(followed.free[0], followed.frozen, expected, steered)
        pulsed = in_pulses([flight for flight, off in zip(flights, missed, strict=True) if off])
        return [
            0.0 if run.number in pulsed else off for run, off in zip(flights, missed.tolist(), strict=True)
        ]

    def _lesson(self, answer: Answer, book: Logbook) -> Lesson:
        identified, follows = answer.identified, answer.follows
        free = closed_loop(identified.members[:1], book.selected, self.workers)[0].tolist()
        recurring = [self.setup.signals.state_names[state] for state in answer.recurring]
        return Lesson(
            iteration=len(book.experiments),
            tests=tuple(run.number for run in book.experiments),
            form=identified.model.form,
            terms=identified.terms,
            misfit=identified.misfit,
            readings=identified.readings,
            ignored=identified.outliers,
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
                *diagnostics_of(
                    book.experiments,
                    self.setup.signals,
                    follows
                    or not np.isfinite(identified.chi_squared),  # of one that diverges it is said already
                    self.setup.steps,
                    answer.missed,
                    () if follows else other_commands(book.experiments),
                    recurring,
                    [self.setup.signals.state_names[state] for state in answer.unmoved],
                ),
            ),
            recurring=tuple(recurring),
        )


def as_known_before(identified: Identified) -> Identified:
    """What was known before the last flights, which says so."""
    known = replace(identified, remarks=[each for each in identified.remarks if each.code != BEFORE.code])
    return with_remark(known, BEFORE)


def with_remark(identified: Identified, remark: Remark) -> Identified:
    """The same with a remark more."""
    return replace(identified, remarks=[*identified.remarks, remark])


def believed_members(followed: Following) -> list[int]:
    """Members of a committee that follow the flights that they were learnt from, and the best one in any case.

    One that cannot is no member (E-SINDy's stability filter).

    Args:
        followed: free runs of the members, the best first.

    Returns:
        Their numbers, in order.
    """
    free = followed.free
    wrong = (free > np.maximum(WRONG * followed.frozen, 4.0 * free[0])).any(axis=1)
    believed = {0, *np.flatnonzero(~wrong).tolist()}
    # Where hardly any can, the ones that go wrong least still show where more must be known.
    others = [i for i in followed.order() if i not in believed]
    return sorted(believed | set(others[: max(0, FEWEST - len(believed))]))
