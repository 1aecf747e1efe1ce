"""Guarding: what a campaign knows of a test, for the guard that watches its flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from twinloop.controllers import Controller
from twinloop.errors import NotAvailable
from twinloop.guard import Guard
from twinloop.test import Test, check_signals

if TYPE_CHECKING:
    from twinloop.campaign.campaign import Campaign


def guard_of(
    campaign: Campaign,
    test: Test,
    fallback: Mapping[str, float] | ArrayLike | None,
    *,
    horizon: float | None,
    false_alarms: float,
    overrun: float = 0.5,
    clock: Callable[[], float] | None,
) -> Guard:
    """The guard of a test, as `Campaign.guard` describes it; with a twin only where that follows the flights so far."""
    check_signals(test, campaign.signals)
    flown = [(run.test, run.trajectory) for run in campaign.experiments if run.test is not None]
    twin = campaign.twin if campaign.experiments else None
    return Guard(
        test,
        _instead(campaign, test, fallback),
        twin=None if twin is None or not twin.follows else twin,
        flown=flown,
        horizon=horizon,
        false_alarms=false_alarms,
        overrun=overrun,
        clock=clock,
        limits=campaign.setup.limits,
    )


def _instead(
    campaign: Campaign, test: Test, fallback: Mapping[str, float] | ArrayLike | None
) -> Controller | ArrayLike:
    """What commands once the guard has tripped: gains by name, a held command, or the controller that is trusted."""
    if fallback is None:
        return campaign.family.controller(_trusted(campaign, test).genes)
    if isinstance(fallback, Mapping):
        return campaign.family.controller(campaign.family.genes(fallback))
    return fallback


def _trusted(campaign: Campaign, test: Test) -> Test:
    """The first test that is known to fly; before any has flown, the one that is flown now, without its excitation."""
    known = campaign.trusted
    if known is not None:
        return known
    if campaign.runs:
        raise NotAvailable(
            "Guard: expected a test that has flown to its end inside the envelope, to fall back on, found none; name"
            " gains or a command that are safe: fallback=."
        )
    return test
