"""Exactness: whether what disturbs a chain of states may be no more than what its law is inexact by.

No law of few terms is exact. So a disturbance that is a small share of what the law itself drives is not told from the
law's own inaccuracy, and neither is one that free runs do not show.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop.identification.records import Run, stages
from twinloop.identification.sensors.chains import Chain
from twinloop.law.actuation import Actuation
from twinloop.signals import Signals

SEEN = 2.0
"""Standard deviations of a sensor by which free runs must miss its readings for a disturbance to show."""
EXACT = 0.02
"""Share of what a law drives, by which it may be wrong."""


def shows(flights: Sequence[tuple[Floats, Floats]], chain: Chain, limits: Limits) -> bool:
    """Whether free runs miss the states that something drives by more than their sensors scatter.

    Args:
        flights: of each its readings and its free run (n + 1, n_x); where there are none, it may.
        chain: that is driven, with its sensors.
        limits: with the signals.
    """
    states = list(chain.states)
    missed = [
        np.square(limits.signals.difference(free, read)[:, states]).mean(axis=0) for read, free in flights
    ]
    return not missed or bool((np.mean(missed, axis=0) > SEEN * SEEN * chain.sensors).any())


def may_be_inexactness(chain: Chain, drives: Floats) -> bool:
    """Whether the correlated disturbance of a chain is a small share of what its law drives.

    Args:
        chain: with what disturbs it.
        drives: variances of each output of the law over the flights.
    """
    return chain.output is not None and bool(chain.motion.correlated < EXACT * EXACT * drives[chain.output])


def driven(model: _core.Model, runs: Sequence[Run], signals: Signals) -> Floats:
    """Variances over flights of what the outputs of a law drive, from the readings.

    Args:
        model: of the law.
        runs: with all sensors read at once.
        signals: of the system.
    """
    rows = stages(runs, signals, Actuation.of(model, signals)).middle
    outputs = model.program.run(rows[:, : model.program.inputs])
    return np.asarray(np.where(np.isfinite(outputs).all(axis=0), outputs.var(axis=0), 0.0))
