"""Reach: how far beyond the flights so far the next one may lead, as bounds of the states."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.planning.proposal import Flown, Wanted
from twinloop.planning.settings import PlanningOptions
from twinloop.signals import Signals

HAIR = 0.01
"""By how much more of the envelope than any before it a flight may use that is to lead nowhere new."""


def reach_of(flown: Flown, wanted: Wanted, options: PlanningOptions) -> float:
    """Usage of the envelope that a proposal may have, where that of each flight so far is known.

    Args:
        flown: so far.
        wanted: what it is for.
        options: of the planning.
    """
    used = flown.usages
    # Where the task begins no flight of it can use less, whatever was flown before of others.
    first = max(used[0] if used else 0.0, flown.begins)
    most = max([flown.begins, *used])
    # A model is believed near what was flown: each flight may go on by a share of what is left beyond those before it.
    # That of these much has come true tells nothing of what is there: a wing has not stalled until it does.
    left = max(0.0, 1.0 - options.margin - most)
    # The last one has nobody to learn from it, and gains that go further are better by little.
    near = max(options.reach_first, most + (min(HAIR, left) if wanted.last else options.reach_rest * left))
    # With gains far from any that were flown it may be wrong in ways that no member shows, and the more so the
    # further a flight goes: what is small on the first flight, and in no term, is not small then.
    far = max(min(options.reach_far, options.reach_growth * first), options.reach_least, most)
    return min(1.0 - options.margin, far if wanted.goal == "model" else near)


def bounds_of(flown: Flown, wanted: Wanted, signals: Signals, options: PlanningOptions) -> Floats:
    """Bounds of the states (2, n_x) that no member may leave in the next flight; infinite where there is none.

    Args:
        flown: so far.
        wanted: what it is for.
        signals: of the system.
        options: of the planning.
    """
    reach, bounds = reach_of(flown, wanted, options), np.tile([[-np.inf], [np.inf]], len(signals.states))
    for i, state in enumerate(signals.states):
        if state.envelope is not None:
            low, high = state.envelope
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            bounds[:, i] = middle - reach * half, middle + reach * half
    if flown.seen is None or options.reach_seen <= 0.0:
        return bounds
    near = flown.seen.around(options.reach_seen, signals)
    return np.stack([np.maximum(bounds[0], near[0]), np.minimum(bounds[1], near[1])])
