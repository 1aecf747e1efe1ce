"""Learning: from all flights that were told to a twin and a committee that follow them, and their record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.steps import Watch
from twinloop._ground.streams import Unit
from twinloop.campaign.data.levels import levels_of
from twinloop.campaign.data.odd_one_out import Odd
from twinloop.campaign.data.reports import reports_in
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.answer import Answer
from twinloop.campaign.identify_and_plan.contradicting import is_made_for, odd_log, righted
from twinloop.campaign.identify_and_plan.elsewhere import DRAWN, drawn_controllers, lasting_under
from twinloop.campaign.identify_and_plan.inside import enough_inside, inside
from twinloop.campaign.identify_and_plan.knowledge import Knowledge
from twinloop.campaign.identify_and_plan.known_before import (
    or_foretold,
    or_known_again,
    or_known_before,
    or_lasted_before,
    with_remark,
)
from twinloop.campaign.identify_and_plan.lessons import lesson_of
from twinloop.campaign.identify_and_plan.memory import Ensemble, Learnt
from twinloop.campaign.identify_and_plan.rests import resting_commands
from twinloop.campaign.identify_and_plan.selection import Selected, learnt_from
from twinloop.campaign.identify_and_plan.tame import TAME, Lasting, follows_nearly, is_wilder
from twinloop.campaign.identify_and_plan.two_laws import Kind, TwoLaws, better_foretold
from twinloop.campaign.identify_and_plan.wrong_readings import without_wrong_readings
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.presets import DefaultOptions
from twinloop.campaign.setup import Setup
from twinloop.identification.identified import Identified
from twinloop.identification.identify import UnderWay, identify_runs
from twinloop.identification.records import Run
from twinloop.identification.terms.directions import Direction, of_mixer
from twinloop.remarks import serious

PLAIN = 1_000_000
"""Added to the number of an identification whose law may be linear only, so that it draws from streams of its own."""
AGAIN = 2_000_000
"""Added likewise where the law known before is tuned again."""
INSIDE_ONLY = 3_000_000
"""Added likewise where flights are learnt only as far as they were inside their envelope."""
RIGHTED = 4_000_000
"""Added likewise where a log that contradicts the others was put right."""
ROUGH = serious(
    "rough",
    "No law explains the flights, and a linear one follows them in free run, or predicted later ones, better than"
    " a nonlinear one. So the twin is linear, and rough: this may be enough to tune gains, but it is not a simulator.",
)
"""What is said of a twin that is linear because no law explains the flights and no other one is better."""


@dataclass(frozen=True, eq=False)
class Two:
    """What is remembered of two kinds of law where none explains the flights.

    Args:
        laws: both best models of each such lesson.
        rough: the last law of linear terms.
    """

    laws: tuple[TwoLaws, ...] = ()
    rough: Identified | None = None


@dataclass(frozen=True, eq=False)
class EstimationData:
    """What is learnt from, and held against what is learnt.

    Args:
        experiments: as they were told, or as far as they were inside their envelope.
        flights: the same without single readings that are wrong.
        selected: those, or parts of them, that are learnt from.
        identify: identification of these; what it lacks are options and a number.
        answered: holds what was identified against the flights.
    """

    experiments: Sequence[Experiment]
    flights: Sequence[Experiment]
    selected: Sequence[Selected]
    identify: Callable[..., Identified]
    answered: Callable[..., Answer]


@dataclass(frozen=True, eq=False)
class Judged:
    """An answer beside what it was learnt from.

    Args:
        answer: held against the flights.
        data: that it was learnt from.
        invalid: whether it does not explain the flights, or explains them and is wild.
    """

    answer: Answer
    data: EstimationData
    invalid: bool


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
        experiments = len(book.experiments)
        needed = () if asked is None else Knowledge(self.setup, book, asked).needed_factors()
        earlier = None if asked is None else asked.identified
        data, begun = self._data_of(book.experiments), under_way

        def kept(so_far: UnderWay) -> None:
            nonlocal begun
            begun = so_far
            keep(so_far)

        answer = data.answered(
            data.identify(
                self.options, iteration=experiments, earlier=earlier, under_way=under_way, keep=kept
            )
        )
        if not answer.explained and self.options.earlier_twin and earlier is not None:
            answer = or_known_before(answer, earlier, data.answered)
        found = Judged(answer, data, self._invalid(answer, data))
        within = self._inside(book.experiments, earlier) if found.invalid and self.options.inside else None
        if within is not None:
            found, begun = within
        if earlier is not None:
            found = self._tuned_again(found, earlier, begun) or found
        two = Two() if asked is None else Two(asked.two_laws, asked.rough)
        if self.options.plain != self.options and found.invalid:
            found, two = self._of_two(found, two, experiments)
        if asked is not None and self.options.earlier_twin and not found.answer.explained:
            answered = found.data.answered
            foretold = or_foretold(found.answer, asked.identified, asked.experiments, answered)
            if foretold is not found.answer:
                found = replace(found, answer=foretold, invalid=self._invalid(foretold, found.data))
        answer, identified = found.answer, found.answer.identified
        lesson = lesson_of(
            answer,
            is_rough(identified),
            book,
            found.data.flights,
            found.data.selected,
            None if earlier is None else earlier.model,
            self._contradicting(found),
            self.workers,
        )
        before, models, ensembles = (
            ((), (), ()) if asked is None else (asked.lessons, asked.models, asked.ensembles)
        )
        learnt = Learnt(
            experiments,
            identified,
            answer.believed,
            answer.follows,
            needed,
            (*before, lesson),
            models=(*models, identified.model),
            two_laws=two.laws,
            rough=two.rough,
            explained=not found.invalid,
        )
        return replace(
            learnt, ensembles=(*ensembles, Ensemble.of(Knowledge(self.setup, book, learnt).twin()))
        )

    def _tuned_again(self, found: Judged, earlier: Identified, begun: UnderWay | None) -> Judged | None:
        """The law known before, tuned on all flights: where that explains them, or is tamer; None elsewhere."""
        data, better = found.data, None
        again = cache(partial(self._known_again, data, earlier, begun))
        if not found.answer.explained and self.options.earlier_twin:
            answer = or_known_again(found.answer, again())
            found = better = Judged(answer, data, self._invalid(answer, data))
        tamer = self._tamer(found, earlier, again) if self.options.tame else None
        return better if tamer is None else Judged(tamer, data, self._invalid(tamer, data))

    def _contradicting(self, found: Judged) -> Odd | None:
        """The log that contradicts all others, where the law that explains them was made for it."""
        answer, experiments = found.answer, found.data.experiments
        odd = odd_log(experiments, self.setup.signals) if answer.explained else None
        if odd is None:
            return None
        data = self._data_of(righted(experiments, odd))
        of_righted = data.identify(self.options, iteration=RIGHTED + len(experiments))
        return odd if is_made_for(answer.identified, odd, of_righted) else None

    def _data_of(self, experiments: Sequence[Experiment]) -> EstimationData:
        """What is learnt from experiments, and what answers are held against."""
        selected = learnt_from(experiments, self.options.most_readings, self.setup.signals)
        flights = without_wrong_readings(experiments, self.setup.signals)
        return EstimationData(
            experiments,
            flights,
            selected,
            self._identification(selected, self._drawn(experiments, 3)),
            partial(Answer.of, flights=flights, setup=self.setup, options=self.options, workers=self.workers),
        )

    def _inside(
        self, experiments: Sequence[Experiment], earlier: Identified | None
    ) -> tuple[Judged, UnderWay | None] | None:
        """What is learnt and searched of flights as far as they were inside their envelope.

        None where none has left it for good, or where so little is left of them that more is lost than won.
        """
        kept = inside(experiments)
        if all(part is run for part, run in zip(kept, experiments, strict=True)):
            return None
        data, begun = self._data_of(kept), list[UnderWay]()
        found = data.identify(
            self.options, iteration=INSIDE_ONLY + len(experiments), earlier=earlier, keep=begun.append
        )
        answer = data.answered(found, number=5)
        if not (answer.explained or enough_inside(experiments, kept)):
            return None
        judged = Judged(answer, data, self._invalid(answer, data))
        return judged, begun[-1] if begun else None

    def _invalid(self, answer: Answer, data: EstimationData) -> bool:
        """Whether a law does not explain the flights; or only what may be a model error explains them, and it is wild.

        Whatever may disturb explains much. A law that needs it, and diverges under most controllers of the box, such as
        one with a hidden state that stands in for a load behind a gap, is no better than a linear one for that.
        """
        if not answer.explained:
            return True
        everywhere = self._drawn(data.flights, 0)
        (lasting,) = lasting_under(answer.believed[:1], self.setup, everywhere, self.workers)
        return 2 * lasting < DRAWN and bool(answer.misses(data.flights, self.setup, self.workers))

    def _known_again(self, data: EstimationData, known: Identified, begun: UnderWay | None) -> Answer:
        """The law known before, tuned on all flights: wrong and late readings, and the form, are of the search anew."""
        first_step = None if begun is None else replace(begun, searches=())
        iteration = AGAIN + len(data.flights)
        identified = data.identify(
            self.options.as_known, iteration=iteration, earlier=known, under_way=first_step
        )
        return data.answered(identified, number=4)

    def _tamer(self, found: Judged, known: Identified, known_again: Callable[[], Answer]) -> Answer | None:
        """The law known before, tuned on all flights, where it is tamer than that of an answer and follows nearly."""
        answer, invalid = found.answer, found.invalid
        everywhere = self._drawn(found.data.flights, 2)

        def lasting(other: Identified) -> Lasting:
            models = [answer.identified.model, other.model]
            return Lasting(*lasting_under(models, self.setup, everywhere, self.workers))

        if not is_wilder(answer.identified, known, lasting(known), invalid):
            return None
        again = known_again()
        tame = replace(again, identified=with_remark(again.identified, TAME))
        both = lasting(again.identified)
        wilder = is_wilder(answer.identified, again.identified, both, invalid)
        return tame.with_doubtful_disturbances() if wilder and follows_nearly(tame, answer, both) else None

    def _drawn(self, flights: Sequence[Experiment], number: int) -> Floats:
        """Controllers that are drawn from the whole box of gains for one of the looks at them (DRAWN, size)."""
        return drawn_controllers(self.setup, Unit(self.setup.seed).part(len(flights), 4, number))

    def _of_two(self, found: Judged, before: Two, experiments: int) -> tuple[Judged, Two]:
        """Of two laws that do not explain the flights the one to believe, and what is remembered of both kinds.

        Which of them it is, neither is valid.
        """
        answer, data = found.answer, found.data
        identified = with_remark(data.identify(self.options.plain, iteration=PLAIN + experiments), ROUGH)
        rough = data.answered(identified, number=2)
        if self.options.earlier_twin and before.rough is not None:
            rough = or_lasted_before(rough, before.rough, data.answered)
        both = TwoLaws(len(data.flights), answer.identified.model, rough.identified.model)
        now = Two((*before.laws, both), rough.identified)
        foretold = better_foretold(now.laws, data.flights, self.setup.limits, self.workers)
        laws = [both.nonlinear, both.linear]
        lasting = lasting_under(laws, self.setup, self._drawn(data.flights, 1), self.workers)
        better = better_of(answer, rough, foretold, [2 * each >= max(lasting) for each in lasting])
        return replace(found, answer=better), now

    def _identification(self, selected: Sequence[Selected], everywhere: Floats) -> partial[Identified]:
        """Identification of what is learnt from; what it lacks are options and a number.

        Args:
            selected: what is learnt from.
            everywhere: controllers that laws should last under.
        """
        return partial(
            identify_runs,
            [Run.of(states, commands) for one in selected for states, commands in one.recorded()],
            self.setup.signals,
            rests=resting_commands(self.setup, [one.experiment for one in selected]),
            axes=self._axes(),
            levels=levels_of([one.experiment for one in selected], self.setup.signals),
            reports=reports_in([one.experiment.trajectory for one in selected], self.setup.signals),
            seed=self.setup.seed,
            workers=self.workers,
            watch=self.watch,
            lasting=lambda models: lasting_under(models, self.setup, everywhere, self.workers),
        )

    def _axes(self) -> list[Direction]:
        """Directions in which the controller's axes move alike commands, as its mixer says."""
        mixer = self.setup.mixer
        return [] if mixer is None else of_mixer(mixer.matrix, self.setup.signals)


def better_of(
    answer: Answer, rough: Answer, foretold: Kind | None, lasting: Sequence[bool] = (True, True)
) -> Answer:
    """Of two laws that do not explain the flights the one to believe, with the other one beside it.

    The one to believe follows the flights, lasts on each of them, and under half as many controllers of the box as the
    other one does, at least. Where that is so of both, or of neither, it is the one that has foretold flights
    better which it had not learnt. As long as there are none, it is the linear one if that misses less of those that it
    has with no more terms: with more it does so in any case, and what it lacks are not terms. Gains have
    to be good on both: a linear law may rank them even where it follows badly. But one that diverges where a flight did
    not says nothing of gains, nor does a nonlinear one that even misses more of the flights that it was learnt from
    than a linear one.

    Args:
        answer: what all terms make of the flights.
        rough: what linear terms make of them.
        foretold: which kind has foretold flights better; None where no flight tells.
        lasting: whether each of the two lasts under half as many drawn controllers as the other one, at least.
    """
    rank, of_rough = (answer.follows, answer.lasts, lasting[0]), (rough.follows, rough.lasts, lasting[1])
    if foretold is None:
        plainer = rough.identified.terms <= answer.identified.terms
        foretold = "linear" if plainer and rough.worst < answer.worst else "nonlinear"
    if of_rough > rank or (of_rough == rank and rough.follows and foretold == "linear"):
        worth = answer.believable and lasting[0] and answer.worst < rough.worst
        return rough.beside(answer) if worth else rough
    return answer.beside(rough) if rough.lasts else answer


def is_rough(identified: Identified) -> bool:
    """Whether it is a law of linear terms beside one that does not explain the flights."""
    return any(remark.code == ROUGH.code for remark in identified.remarks)


def stands_in(identified: Identified) -> bool:
    """Whether it is such a linear law, with a lag or a delay that stands for what no law explains."""
    return is_rough(identified) and not all(actuator.direct for actuator in identified.actuation.actuators)
