"""Track record: what has come of the predictions of a campaign's flights, and what that is worth."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from twinloop._experiment.envelope import is_bounded
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.calibration import held_to
from twinloop.planning.proposal import Fared
from twinloop.signals import Signals

SURE = 2.0
"""Spreads of a predicted quality that a flight may be off it and still confirm it."""
NEARLY = 0.1
"""Share of a quality by which a prediction may be off it and still have come true."""
WIDE = 0.15
"""Share of itself from which on the spread of a prediction shows nothing: nearly all is within twice more."""
UNPROVEN = 0.028
"""Least risk of gains that have not flown, as long as no prediction has come true since the last one that did not: of
88 second flights of the zoo and of machines outside it 2 left their envelopes, (2 + 1/2) / (88 + 1)."""
UNEXPLAINED = 0.088
"""The same of gains that a twin has chosen which does not explain its own flights: of 50 flights of new gains after
such a lesson, on the zoo's report half and on twenty machines outside it, 4 left their envelopes, (4 + 1/2) / (50 + 1);
of 117 after other lessons none."""
WEIGHT = 4.0
"""Flights that those count as, beside the campaign's own predictions that have not come true."""


def over_promised(experiments: Sequence[Experiment]) -> float:
    """Ratio by which both of the last two flights that something was predicted of were worse; 1 if they were not.

    Gains that are tuned on a twin are those that its errors flatter most. One flight that misses its prediction teaches
    the twin; two in a row show that it is flattered again.

    Args:
        experiments: in the order of `tell`.
    """
    ratios = [
        run.quality / predicted
        for run, predicted in _predicted(experiments)
        if run.quality is not None and np.isfinite(predicted) and predicted > 0.0
    ]
    return max(1.0, min(ratios[-2:])) if len(ratios) > 1 else 1.0


def confirmed(experiments: Sequence[Experiment]) -> bool:
    """Whether the last flight that something was predicted of came out as predicted; so where none was.

    Args:
        experiments: in the order of `tell`.
    """
    run = _last_predicted(experiments)
    return run is None or _came_true(run)


def nearly_confirmed_in_a_row(experiments: Sequence[Experiment], or_better: bool = False) -> int:
    """How many of the last flights in a row came within two spreads of what was predicted, or a tenth of themselves.

    Where nothing was predicted yet, nothing is confirmed. Gains that had flown before count only where they miss: the
    twin has learnt how they fly, and what it says of others is not put to the test.

    Args:
        experiments: in the order of `tell`.
        or_better: whether flights count as well that were better than predicted.
    """
    flown, count = set[bytes](), 0
    for run in experiments:
        if run.test is None:
            continue
        genes, predicted = run.test.genes.tobytes(), _predicted([run])
        if predicted and not (_nearly(run) or (or_better and _better(run))):
            count = 0
        elif predicted and genes not in flown:
            count += 1
        flown.add(genes)
    return count


class Judged(NamedTuple):
    """What was predicted of a flight, and what came of it.

    Args:
        test: its number.
        predicted: quality, before the flight.
        spread: standard deviation that was expected of the measured one.
        measured: quality.
    """

    test: int
    predicted: float
    spread: float
    measured: float

    def missed(self, share: float) -> bool:
        """Whether it came out more than two spreads from the prediction, and more than a share of itself."""
        return abs(self.predicted - self.measured) > max(SURE * self.spread, share * self.measured)


def missed_in_a_row(experiments: Sequence[Experiment], share: float = 0.0) -> tuple[Judged, ...]:
    """The last two flights that have both a predicted and a measured quality, if both missed to the same side.

    Args:
        experiments: in the order of `tell`.
        share: of its quality by which a flight may be off its prediction, beside two spreads.

    Returns:
        Two, or none.
    """
    judged = [
        Judged(run.test.number, predicted, run.test.spread, run.quality)
        for run, predicted in _predicted(experiments)
        if run.test is not None
        and run.test.spread is not None
        and run.quality is not None
        and np.isfinite(predicted)
    ]
    last = judged[-2:]
    one_side = len({found.predicted < found.measured for found in last}) == 1
    missed = len(last) == 2 and one_side and all(found.missed(share) for found in last)
    return tuple(last) if missed else ()


def promised_in_vain(experiments: Sequence[Experiment]) -> bool:
    """Whether flights were predicted to be completed, and none of them was.

    Args:
        experiments: in the order of `tell`.
    """
    promised = [run for run, predicted in _predicted(experiments) if np.isfinite(predicted)]
    return bool(promised) and not any(run.complete for run in promised)


def _predicted(experiments: Sequence[Experiment]) -> list[tuple[Experiment, float]]:
    """Flights that something was predicted of, each with that; not those that began elsewhere."""
    asked = [(run, run.test.predicted) for run in experiments if run.test is not None and not run.off_start]
    return [(run, predicted) for run, predicted in asked if predicted is not None and not np.isnan(predicted)]


def _last_predicted(experiments: Sequence[Experiment]) -> Experiment | None:
    found = _predicted(experiments)
    return found[-1][0] if found else None


def _nearly(run: Experiment) -> bool:
    """Whether a quality was predicted, and came out within a tenth of itself, or two spreads that are not too wide."""
    return _came_true(run, NEARLY, WIDE)


def _came_true(run: Experiment, share: float = 0.0, widest: float = np.inf) -> bool:
    """Whether a quality was predicted, and came out within two spreads of that, or within a share of itself.

    Args:
        run: a flight.
        share: of the quality.
        widest: spread that counts, as a share of the prediction.
    """
    test = run.test
    if test is None or test.predicted is None or test.spread is None or run.quality is None:
        return False
    # That a flight diverges is no quality, and comes true in none that has one.
    if not np.isfinite(test.predicted):
        return False
    spread = min(held_to(test.predicted, test.spread), widest * abs(test.predicted))
    return bool(abs(test.predicted - run.quality) <= max(SURE * spread, share * run.quality))


def _better(run: Experiment) -> bool:
    """Whether a quality was predicted, and a better one was flown."""
    predicted = None if run.test is None else run.test.predicted
    return predicted is not None and run.quality is not None and run.quality < predicted


def unproven_risk(
    experiments: Sequence[Experiment], fared: Fared, signals: Signals, explains: bool = True
) -> float:
    """Least risk of a flight while nothing shows that the twin can foretell one; 0 of gains that have flown.

    A law from one gentle flight may be wrong elsewhere in a way that no member of a committee shows. Where flights have
    left the envelope or diverged against what was predicted, it is. One that was stopped inside may have been stopped
    for any reason; two of them have hardly.

    Args:
        experiments: in the order of `tell`.
        fared: how the gains of the flight have fared.
        signals: without an envelope nothing can leave one.
        explains: whether the twin explains its own flights.
    """
    least = UNPROVEN if explains else UNEXPLAINED
    if not is_bounded(signals) or fared.flights > 0 or nearly_confirmed_in_a_row(experiments) > 0:
        return 0.0
    predicted = [run for run, _ in reversed(_predicted(experiments))]
    untrue = list(takewhile(lambda run: not _nearly(run), predicted))
    stopped = [run.trajectory.ended == "aborted" and not run.left_envelope for run in untrue]
    counted = [run for run, by_hand in zip(untrue, stopped, strict=True) if sum(stopped) > 1 or not by_hand]
    left = sum(not run.kept_envelope for run in counted)
    return max(least, (least * WEIGHT + left) / (WEIGHT + len(counted)))
