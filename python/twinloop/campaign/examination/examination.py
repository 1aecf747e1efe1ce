"""A campaign looked at as an engineer does; each number is computed when it is first asked for."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

from twinloop.arrays import Floats
from twinloop.campaign.examination.correlation import (
    Correlations,
    autocorrelation,
    crosscorrelation,
    lags_of,
)
from twinloop.campaign.examination.unseen import Unseen, unseen_flights
from twinloop.campaign.history import Experiment
from twinloop.errors import NotAvailable
from twinloop.law.linear.margins import Margins
from twinloop.law.twin import Twin
from twinloop.test import Test

if TYPE_CHECKING:
    from twinloop.campaign.campaign import Campaign


class Examination:
    """What an engineer checks.

    Args:
        campaign: with at least one experiment told; it is not changed.
        twins_before: earlier twins, with how many of the first experiments each had learnt.
        innovations: of each experiment that was learnt (n + 1, n_x), whitened; None where there are none.
    """

    def __init__(
        self,
        campaign: Campaign,
        twins_before: tuple[tuple[int, Twin], ...],
        innovations: tuple[Floats, ...] | None,
    ) -> None:
        self.campaign = campaign
        self.setup, self.signals = campaign.setup, campaign.signals
        self.experiments: tuple[Experiment, ...] = campaign.experiments
        self.twin: Twin = campaign.twin
        self.twins_before = twins_before
        self.innovations = innovations
        self.best: Test | None = None
        self.no_controller = ""
        try:
            self.best = campaign.best_test
        except NotAvailable as reason:
            self.no_controller = str(reason)

    @cached_property
    def unseen(self) -> tuple[Unseen, ...]:
        """Flights that had not been learnt beside what was predicted of them, in the order told."""
        return unseen_flights(self.experiments, self.twins_before)

    @cached_property
    def _lags(self) -> int:
        lengths = [] if self.innovations is None else [len(found) - 1 for found in self.innovations]
        return lags_of(lengths)

    @cached_property
    def autocorrelation(self) -> Correlations | None:
        """Of the innovations of each state (n_x, lags); None where there are none, or flights are too short."""
        if self.innovations is None or self._lags == 0:
            return None
        return autocorrelation([found[1:] for found in self.innovations], self._lags)

    @cached_property
    def crosscorrelation(self) -> Correlations | None:
        """Of the innovations of each state with each command before (n_x, n_u, lags); None as for `autocorrelation`."""
        if self.innovations is None or self._lags == 0:
            return None
        commands = [run.trajectory.commands for run in self.experiments[: len(self.innovations)]]
        return crosscorrelation([found[1:] for found in self.innovations], commands, self._lags)

    @property
    def last_miss(self) -> float | None:
        """Predicted minus flown quality of the last flight that has both, in the spreads that were told."""
        for run in reversed(self.experiments):
            test = run.test
            if test is None or run.quality is None or test.predicted is None or not test.spread:
                continue
            return (test.predicted - run.quality) / test.spread if math.isfinite(test.predicted) else math.inf
        return None

    @cached_property
    def margins(self) -> Margins | None:
        """Of the controller to fly, at the target; None where it or the twin has no slope there."""
        if self.best is None:
            return None
        try:
            return self.campaign.margins(self.best.genes)
        except NotAvailable:
            return None
