"""Suspects: white disturbances that may be what a law is wrong about.

What a law lacks at single moments, such as a contact, is taken for white noise by whoever knows no other name for it.
But noise that stirs a state in each period makes errors of prediction that are normal, and that nothing read or sent
before foretells; an impact makes a few that are far larger than the others. Of a single flight neither can be told: a
law that lacks something is bent until what is left looks like noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.causes import LATEST, PEAKED, SURE, is_peaked, observed
from twinloop.campaign.identify_and_plan.foretold import features_of, foretold
from twinloop.campaign.identify_and_plan.selection import distinct
from twinloop.identification.identified import Identified

SCATTER = 24.0
"""Variance of the kurtosis of normal errors, times their number."""


def suspects_of(
    identified: Identified,
    flights: Sequence[Experiment],
    limits: Limits,
    workers: _core.Workers,
) -> list[int]:
    """States that are stirred by a white disturbance which may be what the law is wrong about, in order.

    Args:
        identified: with the twin's model and its chains.
        flights: that it was learnt from.
        limits: with the signals.
        workers: how the work is carried out.
    """
    signals = limits.signals
    states = stirred(identified)
    # A record that was told twice would foretell its own noise.
    latest = distinct(flights)[-LATEST:]
    if len(latest) == 1:
        return states
    seen = observed(identified, latest, signals, limits, workers) if states else None
    if seen is None:
        return []
    features = [features_of(run.trajectory.states, run.trajectory.commands, signals) for run in latest]
    found = []
    for state in states:
        errors = [whitened[1:, state] for whitened, _, _ in seen]
        past = foretold(list(zip(features, errors, strict=True)))
        if comes_at_moments(np.concatenate(errors)) or past.beyond_luck(SURE):
            found.append(state)
    return found


def stirred(identified: Identified) -> list[int]:
    """States that a law drives and a white disturbance stirs, in order.

    Args:
        identified: with the twin's chains.
    """
    return sorted(
        chain.states[0]
        for chain in identified.chains
        if chain.output is not None and chain.motion.white > 0.0
    )


def comes_at_moments(errors: Floats) -> bool:
    """Whether few errors of prediction are large among small ones, by more than normal ones may be by luck.

    Args:
        errors: whitened (n,).
    """
    return is_peaked(errors, PEAKED + SURE * float(np.sqrt(SCATTER / len(errors))))
