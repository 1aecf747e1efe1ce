"""Which controller to fly: gains tuned on a committee, the best ones flown, or none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from twinloop import _core
from twinloop._experiment.envelope import outside
from twinloop._ground.arrays import Floats
from twinloop._ground.texts import enumerated, two_digits
from twinloop.campaign import standing
from twinloop.campaign.identify_and_plan.alone import share_of
from twinloop.campaign.identify_and_plan.calibration import beside_misses, calibrated, missed
from twinloop.campaign.identify_and_plan.track_record import (
    SURE,
    confirmed,
    over_promised,
    promised_in_vain,
    unproven_risk,
)
from twinloop.campaign.logbook import Logbook
from twinloop.errors import NotTrusted
from twinloop.planning.failed import stand_for_failed
from twinloop.planning.gusts import Moved
from twinloop.planning.judging import Committee, Judged, expected, risk
from twinloop.planning.planner import Planner
from twinloop.planning.proposal import Fared
from twinloop.planning.reasons import what_stays
from twinloop.test import Test

WORTH = 0.005
"""Share of a quality by which gains that have not flown must be better to be worth it."""
UNKNOWN = "No controller to fly: "


@dataclass(frozen=True, eq=False)
class Choice:
    """Chooses between gains that were tuned and the best ones flown.

    Args:
        planner: of the campaign.
        committee: that judges.
        book: of the campaign.
        draws: of the sensors' noise.
        confidence: share of members and draws that must find tuned gains better than the best flown, by half a percent
            or more, and by more than predictions have missed of late.
        misses: whether the twin misses its own flights.
        rough: whether it is a law of linear terms, since none explains the flights.
    """

    planner: Planner
    committee: Committee
    book: Logbook
    draws: int
    confidence: float
    misses: bool = False
    rough: bool = False

    def between(self, tuned: Floats, best: Test | None) -> Test:
        """The controller to fly, without excitation, for the campaign's own task.

        Args:
            tuned: gains that are best on the committee (size,).
            best: the best test flown; None if there is none.

        Raises:
            NotTrusted: neither can be answered for.
        """
        flown = best if best is not None and standing.finishes(self.book, best.number) else None
        genes = np.stack([tuned] if flown is None else [tuned, flown.genes])
        # One that diverges under gains that have flown is wrong; under others it may be right.
        everyone = self.committee.members
        members = everyone if flown is None else self.planner.stable_members(everyone, genes[1:])
        judged = self._judge(members, genes)
        recorded = self._judge(members, genes, measured=True).qualities
        refused = self._refused(members, judged, tuned, flown)
        if flown is None:
            if refused:
                raise NotTrusted(
                    f"{UNKNOWN}{refused}, and no gains have completed a flight. Fly another controller that you"
                    " trust."
                )
            reason = (
                "Tuned on the twin, which predicts that they stay in the envelope; no gains have completed a flight"
                " yet."
            )
            return self._tuned(tuned, judged, recorded, reason)
        flies, own = standing.flies(self.book, flown.number), self._fared(flown)
        in_gusts = self._in_gusts(members, genes, judged).qualities
        new, old = in_gusts[:, :, 0].ravel(), in_gusts[:, :, 1].ravel()
        better = float(((1.0 + self._worth) * new < old).mean())
        if flies and not refused:
            refused = self._not_preferred(recorded, tuned, flown, better)
        if not refused:
            share = f"{100 * better:.3g} %"
            found = f"by {self._more} in {share} of its predictions"
            reason = f"Tuned on the twin: better than the best flown gains {found}."
            if not flies:
                reason = (
                    "Tuned on the twin: no model predicts that they leave the envelope, and the best flown gains did"
                    " not keep it to the end."
                )
            return self._tuned(tuned, judged, recorded, f"{reason}{self._stays}")
        reason = f"The best gains flown: {refused}."
        if not flies:
            reason += " They did not keep the envelope to the end when they flew."
        elif own.left:
            reason += f" But {own} did not keep the envelope to the end."
        reason += self._measured_better(flown)
        return self._flown(flown, judged, recorded, reason)

    # Inside

    @cached_property
    def _worth(self) -> float:
        """Share of tuned gains' quality by which flown ones must be worse: more than predictions have missed of late.

        A share of the other quality would forbid all gains once predictions miss by more than the whole quality.
        """
        least = missed(self.book.experiments) if self.planner.options.track_record else 0.0
        return max(WORTH, least)

    @property
    def _more(self) -> str:
        return f"{two_digits(100.0 * self._worth)} % or more"

    def _measured_better(self, flown: Test) -> str:
        """Which flight was measured better than that of the best gains: an excitation helped it, or cost these."""
        better = standing.best_flown(self.book)
        if better is None or better.number == flown.number:
            return ""
        if better.genes.tobytes() == flown.genes.tobytes():
            return f" Test {better.number} flew the same gains, and was measured better."
        if better.excitation is None and flown.excitation is None:
            return f" Test {better.number} was measured better; what the twin predicts speaks for these."
        return f" Test {better.number} was measured better; without excitation these are better."

    @property
    def _lawless(self) -> list[str]:
        return [self.planner.signals.state_names[i] for i in self.committee.lawless]

    @property
    def _stays(self) -> str:
        """Which gains are not tuned, as they answer to what has no law; nothing where all are."""
        untunable = [self.planner.family.names[i] for i in self.committee.untunable]
        return f" {what_stays(self._lawless, untunable)}" if self._lawless else ""

    def _refused(
        self, members: Sequence[_core.Model], judged: Judged, tuned: Floats, flown: Test | None
    ) -> str:
        """Why tuned gains cannot be answered for; nothing if they can."""
        if not self.committee.trusted:
            return "the twin does not follow the runs that it was learnt from"
        if flown is None and promised_in_vain(self.book.experiments):
            return "the twin predicted flights to their end, and each of them was cut"
        if stand_for_failed(self.planner, members, tuned[np.newaxis], standing.unfit(self.book))[0]:
            return (
                "a flight with gains close to those that the twin prefers, or alike on it, failed or was cut"
            )
        others = flown is None or tuned.tobytes() != flown.genes.tobytes()
        if others and flown is not None and (self.rough or (self.misses and self._tuned_have_flown())):
            why = "is rough" if self.rough else "misses its own flights"
            return f"the twin {why}, and gains that it prefers have to fly before they are recommended"
        if self.committee.lawless and (flown is None or not self.committee.gains_count):
            return f"the twin knows no law of {enumerated(self._lawless)} yet"
        if not self.committee.gains_count:
            return "the gains have no effect on the twin, which does not know yet what the commands do to the task"
        if not others:
            return "the twin finds no better ones that may be flown now"
        off = off_start(self.book)
        elsewhere = judged if off is None else self._judge(members, tuned[np.newaxis], off=off)
        if any(outside(flights.usages[:, :, 0]).any() for flights in (judged, elsewhere)):
            return "a model predicts that those preferred by the twin leave the envelope"
        if flown is not None and self.committee.delayed:
            delayed = self._judge(self.committee.delayed, np.stack([tuned, flown.genes]))
            left, borne = outside(delayed.worst_usage)
            if left and not borne:
                return "with more delay than was found those preferred by the twin leave the envelope"
        if self._moved(tuned).left > (0 if flown is None else self._moved(flown.genes).left):
            return "in disturbances as the flights felt them, those preferred by the twin leave the envelope"
        return ""

    def _tuned_have_flown(self) -> bool:
        """Whether gains that a twin has proposed completed a flight: others are then no longer the only way on."""
        flights = ((run.test, run.quality) for run in self.book.experiments)
        return any(
            test is not None and test.predicted is not None and quality is not None
            for test, quality in flights
        )

    def _not_preferred(self, recorded: Floats, tuned: Floats, flown: Test, better: float) -> str:
        """Why the best gains flown are better than those tuned; nothing if they are not."""
        alone = self._measured_alone(flown) if self.planner.options.track_record else None
        others = self.book.of_task(tuned, flown.number)
        # Where a promise was broken the spread of the next one would rule out whatever is promised.
        of_others = partial(self._expected, others, recorded[:, :, 0], beside_misses)
        if alone is not None and (spoken := self._spoken_against(alone, flown, of_others)):
            return spoken
        if better < self.confidence:
            sure, asked = (f"{100 * part:.3g} %" for part in (better, self.confidence))
            return (
                f"newly tuned ones are better by {self._more} in only {sure} of the twin's predictions, and proven"
                f" gains are replaced from {asked} on"
            )
        return "" if alone is None else self._no_better_than_measured(alone, flown, of_others)

    def _spoken_against(self, alone: float, flown: Test, of_others: Callable[[], tuple[float, float]]) -> str:
        """Why what the twin said of the last flights speaks against gains that it prefers; nothing if it does not.

        Args:
            alone: quality that was measured of the flown gains, without the effect of their excitation.
            flown: their test.
            of_others: gives the quality that is predicted of the gains that the twin prefers, and its spread.
        """
        promised = over_promised(self.book.experiments)
        if promised > 1.0:
            predicted, _ = of_others()
            if not predicted * promised < alone:
                worse = two_digits(100.0 * (promised - 1.0))
                return (
                    f"the last two flights were worse than predicted, both by {worse} % or more, and others,"
                    f" corrected for that, would be no better ({predicted:.3g} predicted) than these"
                    f" ({alone:.3g})"
                )
        if not confirmed(self.book.experiments):
            predicted, spread = of_others()
            if not predicted + SURE * spread < alone:
                return (
                    "the last flight was not as predicted, and for others the twin predicts"
                    f" {predicted:.3g} ± {two_digits(spread)} where {_reaches(alone, flown)}"
                )
        return ""

    def _no_better_than_measured(
        self, alone: float, flown: Test, of_others: Callable[[], tuple[float, float]]
    ) -> str:
        """That tuned gains are predicted to be hardly better than the flown ones were measured; nothing if they are.

        Predictions that are too bad for the flown gains are no evidence for others. Arguments as for `_spoken_against`.
        """
        predicted, _ = of_others()
        if (1.0 + self._worth) * predicted < alone:
            return ""
        return f"{_reaches(alone, flown)}, and the twin predicts {predicted:.3g} for others: not better by {self._more}"

    def _measured_alone(self, flown: Test) -> float | None:
        """Quality that was measured of flown gains, without the effect of their excitation; None of another task."""
        measured = standing.measured_on_task(self.book, flown)
        return (
            None if measured is None else measured * share_of(self.planner, self.committee, flown, self.draws)
        )

    def _tuned(self, genes: Floats, judged: Judged, recorded: Floats, reason: str) -> Test:
        same = next((test for test in self.book.tests if test.genes.tobytes() == genes.tobytes()), None)
        quiet = same is not None and same.excitation is None and standing.on_task(self.book, same)
        number = len(self.book.tests) if same is None else same.number
        measured = standing.measured(self.book, number) if quiet else None
        return self._answer(self.book.of_task(genes, number), measured, judged, recorded, 0, reason)

    def _flown(self, flown: Test, judged: Judged, recorded: Floats, reason: str) -> Test:
        # A test of another task says nothing of the campaign's own, and is not returned.
        measured = standing.measured_on_task(self.book, flown)
        test = self.book.of_task(flown.genes, flown.number)
        return self._answer(test, measured, judged, recorded, 1, reason)

    def _answer(
        self, test: Test, measured: float | None, judged: Judged, recorded: Floats, pick: int, reason: str
    ) -> Test:
        predicted, spread = self._expected(test, recorded[:, :, pick])
        usages = judged.usages[:, :, pick]
        own = self._fared(test)
        unproven = unproven_risk(self.book.experiments, own, test.signals, self.committee.explains)
        least = max(own.risk, self._moved(test.genes).risk, unproven)
        return replace(test, predicted=predicted, measured=measured).explained(
            spread, max(risk(usages), least), reason
        )

    def _fared(self, test: Test) -> Fared:
        """How the gains of a test have fared, of which the twin may know nothing."""
        return standing.fared(self.book, test.genes, excited=False)

    def _expected(
        self, test: Test, recorded: Floats, calibrate: Callable[..., float] = calibrated
    ) -> tuple[float, float]:
        """The quality to be measured of a flight, and its calibrated spread, disturbances included."""
        predicted, spread = self._moved(test.genes).added_to(*expected(recorded))
        return predicted, calibrate(spread, predicted, self.book.experiments, self.misses)

    def _moved(self, genes: Floats) -> Moved:
        """What known disturbances do to the task's flight with some gains (size,), without excitation."""
        return self.committee.moved_by_gusts(self.book.of_task(genes, len(self.book.tests)))

    def _in_gusts(self, members: Sequence[_core.Model], genes: Floats, calm: Judged) -> Judged:
        """What members make of gains in known disturbances; what they make of them in calm where there are none."""
        met = self.planner.disturbances(self.committee, self.draws)
        if met is None:
            return calm
        return self.planner.judge(members, genes, self.committee.sds, self.draws, disturbances=met)

    def _judge(
        self, members: Sequence[_core.Model], genes: Floats, measured: bool = False, off: Floats | None = None
    ) -> Judged:
        return self.planner.judge(members, genes, self.committee.sds, self.draws, measured=measured, off=off)


def _reaches(alone: float, flown: Test) -> str:
    """What flown gains are worth, in words."""
    if flown.excitation is None:
        return f"{alone:.3g} was measured with these"
    return f"these, without the excitation of their flight, reach {alone:.3g}"


def off_start(book: Logbook) -> Floats | None:
    """How far flights began from where they were asked to, root mean square of the first readings (n_x,).

    Args:
        book: of the campaign.

    Returns:
        None where no test was flown.
    """
    difference = book.setup.signals.difference
    off = [
        difference(run.trajectory.states[0], run.test.initial_state)
        for run in book.experiments
        if run.test is not None
    ]
    return np.asarray(np.sqrt(np.square(off).mean(axis=0)), dtype=np.float64) if off else None
