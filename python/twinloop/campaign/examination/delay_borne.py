"""Delay borne: how many more periods of delay the flight of a task bears."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop import _core
from twinloop._experiment.envelope import outside, usages_of
from twinloop._experiment.limits import Limits
from twinloop.law.actuation import delayed
from twinloop.law.flight import fly
from twinloop.test import Test

MOST = 20
"""Periods of delay up to which flights are tried; no clock, bus or scheduler is that late."""


def periods_borne(models: Sequence[_core.Model], test: Test, limits: Limits) -> int:
    """With how many more periods of delay a flight neither diverges nor leaves its envelope.

    Margins are those of small departures. A flight also meets the bounds of its commands, and all that is not linear.

    Args:
        models: a twin and its committee, of which a member on which the flight fails as it is has no say: risks are
            counted elsewhere.
        test: what is flown, without noise.
        limits: where a flight counts as diverged.

    Returns:
        The largest number up to which every number of periods is borne; 0 if one is not.
    """

    def borne(model: _core.Model) -> bool:
        run = fly(model, test, limits=limits)
        assert run.true_states is not None  # of a simulator
        return run.steps == test.steps and not outside(usages_of(test.signals, run.true_states)).any()

    twin, *members = models
    flying = [twin, *(member for member in members if borne(member))]
    for periods in range(1, MOST + 1):
        if not all(borne(delayed(model, test.signals, periods)) for model in flying):
            return periods - 1
    return MOST
