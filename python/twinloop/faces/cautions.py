"""Cautions on a test sheet: advice to stop, bands that leave the envelope, thin margins, unreliable twins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._experiment.envelope import band_outside
from twinloop._ground.texts import enumerated
from twinloop._ground.times import shown_time
from twinloop.campaign import Campaign
from twinloop.campaign.assessment import controller_to_fly
from twinloop.campaign.examination.checking import FRAGILE, PERIODS
from twinloop.campaign.history import Lesson
from twinloop.campaign.presets import DefaultOptions
from twinloop.errors import NotAvailable
from twinloop.remarks import Remark
from twinloop.signals import Signals
from twinloop.store import StoredAs
from twinloop.test import Test
from twinloop.trajectory import Trajectory


def leaving(signals: Signals, predicted: Trajectory | None) -> dict[str, tuple[float, float]]:
    """First and last time at which the predicted band of a state is beyond its envelope, s, by name.

    Args:
        signals: of the system.
        predicted: run with its band; None where nothing is known yet.
    """
    if predicted is None or predicted.band is None:
        return {}
    found = {}
    for i, state in enumerate(signals.states):
        if state.envelope is None:
            continue
        low, high = predicted.band[:, :, i]
        beyond = np.flatnonzero(band_outside(state, low, high))
        if len(beyond):
            found[state.name] = float(predicted.t[beyond[0]]), float(predicted.t[beyond[-1]])
    return found


def band_leaves(signals: Signals, predicted: Trajectory | None) -> list[str]:
    """That the band contradicts a small risk, where it leaves the envelope: a line, or none.

    Args:
        signals: of the system.
        predicted: run with its band; None where nothing is known yet.
    """
    end = 0.0 if predicted is None else float(predicted.t[-1])
    parts = [
        f"of {name} leaves its envelope {_when(first, last, end)}"
        for name, (first, last) in leaving(signals, predicted).items()
    ]
    return [f"The band {', that '.join(parts)}: the twin is not sure of this flight."] if parts else []


def _when(first: float, last: float, end: float) -> str:
    if last >= end:
        return f"from {first:.4g} s on"
    return f"at {first:.4g} s" if first == last else f"between {first:.4g} and {last:.4g} s"


def advised_to_stop(campaign: Campaign) -> str:
    """That a further test is one more than the controller needs; empty where it is not.

    Args:
        campaign: that has planned it.
    """
    advice = campaign.advice if campaign.history else None
    if advice is None or not advice.stop:
        return ""
    best, _ = controller_to_fly(campaign)
    if best is None or best.measured is None:
        return ""  # there is a flight to be made
    if not campaign.checks().passed:
        return ""  # as the verdict says: what fails is to be mended first
    return (
        "The advice is to stop: for the controller another flight would bring less than the scatter of one"
        " measurement."
    )


def thin_margins(campaign: Campaign, test: Test) -> list[str]:
    """That a certificate would refuse the gains of a test for their margins on the twin: a line, or none.

    Args:
        campaign: that has planned it.
        test: of it.
    """
    if test.predicted is None or not campaign.twin.follows:
        return []
    try:
        worst = campaign.margins(test.genes).worst
    except NotAvailable:
        return []
    unstable = [loop.loop for loop in worst if not loop.stable]
    if unstable:
        found = [f"the loops around the target are not stable ({enumerated(unstable)})"]
    else:
        least, latest = max(worst, key=lambda loop: loop.sensitivity), min(worst, key=lambda loop: loop.delay)
        found = []
        if least.sensitivity > FRAGILE:
            found.append(f"the sensitivity of {least.loop} is {least.sensitivity:.3g}, above {FRAGILE:g}")
        if latest.delay < PERIODS * test.family.signals.dt:
            more = shown_time(latest.delay)
            found.append(f"{more} more delay, less than a period, makes the loop of {latest.loop} unstable")
    said = " and ".join(found)
    cut = "Cut the flight if it begins to oscillate; a certificate of these gains would be refused."
    if isinstance(campaign.options, DefaultOptions) and campaign.options.delay_least < PERIODS:
        cut += " For others begin again from these flights with the option delay_least = 1.0."
    return [f"On the twin {said}. {cut}"] if found else []


def serious_of(lesson: Lesson | None) -> list[Remark]:
    """What speaks against a twin so much that it is not reliable.

    Args:
        lesson: its last; None where nothing was learnt.
    """
    return [] if lesson is None else [remark for remark in lesson.remarks if remark.serious]


def not_reliable(stored_as: StoredAs, remarks: Sequence[Remark]) -> list[str]:
    """That the twin is not reliable, with the first reason: a line, or none.

    Args:
        stored_as: under what the next command finds the campaign.
        remarks: serious ones.
    """
    if not remarks:
        return []
    codes = ", ".join(dict.fromkeys(remark.code for remark in remarks))
    whole = stored_as.to_type("show")
    return [f"The twin is not reliable yet ({codes}): {remarks[0].sentence} {whole} has the whole."]
