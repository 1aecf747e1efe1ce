"""Reported: runs as sensors have read them, of what logs give. What is repeated or computed of readings is no reading.

What a slow sensor repeats lies behind, and so does a filtered difference, whose noise is that of the readings again: a
law would take all of this for motion. Between readings a state is what a cubic through them says, and a rate that is
computed the slope of what it is computed of, on both sides of each reading. Neither counts as read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats, Integers
from twinloop.identification.records import Run
from twinloop.identification.sensors.chains import Chain
from twinloop.law.reports import Held, Reports, computed, slopes_of, variance
from twinloop.signals import Signals


def as_sensed(run: Run, reports: Reports, signals: Signals, ignored: int = 0) -> Run:
    """The run without readings that were repeated, or computed of others.

    Args:
        run: as it was logged.
        reports: what is given of readings.
        signals: of the system.
        ignored: periods after the start whose new readings of sensors that are slow or late do not count.
    """
    if not any(reports):
        return run
    states, weights = run.states.copy(), run.weights.copy()
    for i, report in enumerate(reports):
        if isinstance(report, Held):
            slow = report.every > 1
            fresh = (np.flatnonzero(np.diff(run.states[:, i])) if slow else np.arange(len(states) - 1)) + 1
            fresh = np.concatenate([[0], fresh[fresh > max(report.age, ignored)]])
            read = np.maximum(fresh - report.age, 0)
            weights[:, i] = 0.0
            weights[read, i] = run.weights[fresh, i]
            states[:, i] = _through(read, run.states[fresh, i], len(states))
    for i, rate in slopes_of(states, reports, signals).items():
        states[:, i], weights[:, i] = rate, 0.0
    return replace(run, states=states, weights=weights, smooth=states)


def _through(rows: Integers, values: Floats, count: int) -> Floats:
    """What lies on the cubics through values at some rows, on a line before the first and after the last (count,)."""
    if len(rows) < 2:
        return np.full(count, values[0])
    slopes_ = np.gradient(values, rows)
    at = np.arange(count)
    left = np.clip(np.searchsorted(rows, at, side="right") - 1, 0, len(rows) - 2)
    step = (rows[left + 1] - rows[left]).astype(np.float64)
    share = (at - rows[left]) / step
    rest = 1.0 - share
    cubic = (
        values[left] * rest * rest * (1.0 + 2.0 * share)
        + values[left + 1] * share * share * (3.0 - 2.0 * share)
        + step * share * rest * (slopes_[left] * rest - slopes_[left + 1] * share)
    )
    beyond = values[-1] + slopes_[-1] * (at - rows[-1])
    return np.where(at > rows[-1], beyond, cubic)


def with_their_noise(chains: Sequence[Chain], reports: Reports) -> list[Chain]:
    """Chains in which a rate that is computed of readings has their noise, as it passes through the filter.

    Args:
        chains: all of them, with the noise that was found.
        reports: what is given of readings.
    """
    sensors = {
        state: float(size)
        for chain in chains
        for state, size in zip(chain.states, chain.sensors, strict=True)
    }
    for i, report in computed(reports).items():
        sensors[i] = variance(report, sensors[report.of])
    return [
        chain.with_noise(np.array([sensors[state] for state in chain.states]), chain.motion)
        for chain in chains
    ]
