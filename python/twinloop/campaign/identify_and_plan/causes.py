"""Causes: whether what disturbs for long comes from outside, or is what the law is wrong about.

A gust does not know when a flight begins. What a law is wrong about does: flights of one task pass through much the
same states at much the same times. So the disturbances that the twin's observer has estimated are multiplied between
flights, time by time. The sum of the products is compared with the scatter that it has if the flights have nothing to
do with each other, however slowly each of them changes (Bartlett 1935). One flight tells nothing, and neither do two in
which a disturbance changes so slowly that its sign alone decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.campaign.history import Cause, Experiment
from twinloop.campaign.identify_and_plan.selection import distinct
from twinloop.errors import engine_input
from twinloop.identification.identified import Identified
from twinloop.identification.records import Run
from twinloop.identification.sensors.offsets import moved
from twinloop.limits import Limits
from twinloop.signals import Signals

Predictions = Sequence[tuple[Floats, Floats, Floats]]
"""Of each run whitened errors and states (n + 1, n_x), and correlated disturbances (n + 1, chains)."""
SURE = 3.0
"""Standard deviations of unrelated flights by which the products of an error of the law must be larger."""
SHARE = 0.3
"""Correlation between flights from which that is more than a trace."""
AT_MOST = 0.5
"""Correlation between flights that something from outside must not have, even if the products are too small by luck."""
BY_LUCK = 2.0
"""Standard deviations of unrelated flights by which products may be too small by luck."""
LATEST = 12
"""Flights that are compared, the last ones."""
PIECES = 200
"""Pieces into which a flight is cut, in each of which a disturbance is taken at its mean."""


def observed(
    identified: Identified,
    experiments: Sequence[Experiment],
    signals: Signals,
    limits: Limits,
    workers: _core.Workers,
) -> Predictions | None:
    """What the observer of a twin makes of flights; None where the twin diverges under it.

    Args:
        identified: with the twin's model and its chains.
        experiments: at least one.
        signals: of the system.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    runs = [Run.of(run.trajectory.states, run.trajectory.commands).continued(signals) for run in experiments]
    with engine_input():
        return _core.predictions(
            identified.model,
            limits.engine,
            [chain.engine for chain in identified.chains],
            [(run.states, run.weights, run.commands) for run in moved(runs, signals, identified.offsets)],
            workers=workers,
        )


def causes_of(
    identified: Identified,
    experiments: Sequence[Experiment],
    signals: Signals,
    limits: Limits,
    workers: _core.Workers,
) -> dict[int, Cause]:
    """Causes of the correlated disturbances of a twin, by the state that each of them drives.

    Args:
        identified: with the twin's model and its chains.
        experiments: that it was learnt from.
        signals: of the system.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    disturbed = {
        chain.states[0]: place
        for place, chain in enumerate(identified.chains)
        if chain.motion.correlated > 0.0
    }
    flights = [run for run in distinct(experiments) if run.test is not None][-LATEST:]
    found = (
        observed(identified, flights, signals, limits, workers) if disturbed and len(flights) > 1 else None
    )
    if found is None:
        return dict.fromkeys(disturbed, "undecided")
    tasks: dict[bytes, list[Floats]] = {}
    for run, (_, _, gusts) in zip(flights, found, strict=True):
        assert run.test is not None
        tasks.setdefault(run.test.target_state.tobytes(), []).append(gusts)
    return {
        state: cause([[gusts[:, place] for gusts in flown] for flown in tasks.values()])
        for state, place in disturbed.items()
    }


def cause(tasks: Sequence[Sequence[Floats]]) -> Cause:
    """The cause of what disturbs: whether its series resemble each other, time by time, more than unrelated ones do.

    Args:
        tasks: of each task a series for each of its flights; of two flights the longer one is cut.
    """
    product = scatter = size = 0.0
    for series in tasks:
        for one, other in combinations(series, 2):
            n = min(len(one), len(other))
            first, second = _in_pieces(one[:n]), _in_pieces(other[:n])
            product += float((first * second).sum())
            size += float(np.sqrt(np.square(first).sum() * np.square(second).sum()))
            # The variance of a sum of products of two unrelated series is that of their autocovariances' products.
            both = _autocovariances(first) * _autocovariances(second) * np.arange(len(first), 0, -1)
            scatter += float(both[0] + 2.0 * both[1:].sum())
    by_luck = float(np.sqrt(max(scatter, 0.0)))
    if product > SHARE * size and product > SURE * by_luck:
        return "law"
    return "disturbance" if product + BY_LUCK * by_luck < AT_MOST * size else "undecided"


def _in_pieces(series: Floats) -> Floats:
    """Means over pieces of a series, each as long as the next one; what is left at its end is not used."""
    length = max(1, len(series) // PIECES)
    return np.asarray(series[: len(series) // length * length].reshape(-1, length).mean(axis=1))


def _autocovariances(series: Floats) -> Floats:
    """About 0, for all shifts from 0 on."""
    n = len(series)
    return np.array([(series[: n - shift] * series[shift:]).sum() / n for shift in range(n)])
