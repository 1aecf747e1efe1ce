"""Wrong readings: single ones that no motion has made are not held against a twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop.campaign.history import Experiment
from twinloop.identification.fit.predictions import FEW
from twinloop.identification.outliers import ignoring, suspects
from twinloop.identification.records import Run
from twinloop.signals import Signals

FAR = 10.0
"""Standard deviations of the sensor's noise from which a reading stands out: it weighs as much as a hundred others."""


def without_wrong_readings(experiments: Sequence[Experiment], signals: Signals) -> list[Experiment]:
    """Experiments in whose records such readings stand where their neighbours foretell them.

    What a free run misses is a mean of squares, of which one wrong reading may be nearly all.

    Args:
        experiments: as they were told.
        signals: of the system.

    Returns:
        The very same where no reading stands out, or too many do.
    """
    scales = np.array([state.scale for state in signals.states])
    runs = [Run.of(one.trajectory.states, one.trajectory.commands).continued(signals) for one in experiments]
    wrong = [suspect for suspect in suspects(runs, scales) if suspect.size > FAR]
    found = list(experiments)
    for number, (experiment, run) in enumerate(zip(experiments, runs, strict=True)):
        own = [suspect for suspect in wrong if suspect.run == number]
        # Where more than a few stand out the noise is of another kind.
        if 0 < len(own) <= max(1.0, FEW * run.states.size):
            for suspect in own:
                run = ignoring(run, suspect, signals)
            found[number] = replace(experiment, trajectory=replace(experiment.trajectory, states=run.states))
    return found
