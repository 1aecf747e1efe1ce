"""The noise of sensors before any term is known: as declared, as kinematics show it, and the least that is believed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.identification.records import Run
from twinloop.identification.sensors.chains import Chain, Motion
from twinloop.identification.sensors.kinematic_steps import kinematic_step
from twinloop.signals import Signals

BEST_SENSOR = 0.1
"""Share of its readings' roughness that a sensor's standard deviation is at least."""
NOTHING = 0.01
"""χ² a reading below which the noise was not estimated but held at the least that is believed: readings are exact."""
KINEMATIC = 1e-4
"""Variance, in its sensor's, of what moves an angle in a period beside the body rates that turn it."""
DRIFTS = 50.0
"""What a drift of an angle beside its rates must gain, in units of χ²."""
LARGE = 30.0
"""Times what its rates are known to add to an angle that a drift of it must be: a wrong form may look like less."""
FEW_READINGS = 20
"""Fewest readings from which the noise of an angle that body rates turn is estimated."""
OUTLYING = 6.0
"""Medians of its residuals' size beyond which one counts no more."""


def exact(misfit: float) -> bool:
    """Whether a χ² a reading says that they are exact: next to nothing is left by the least noise that is believed."""
    return misfit < NOTHING


def declared_noise(chain: Chain, signals: Signals) -> Chain:
    """The chain with sensors as they are declared, as far as readings allow; the estimate begins there."""
    sensors = chain.sensors.copy()
    for i, state in enumerate(chain.states):
        noise = signals.states[state].noise
        if noise is not None:
            sensors[i] = np.clip(noise * noise, BEST_SENSOR * BEST_SENSOR * chain.rough[i], chain.rough[i])
    return chain.with_noise(sensors, chain.motion)


def given_noise(chain: Chain, signals: Signals) -> Chain:
    """An angle that body rates turn: what it does between readings is known but for the rates' own noise."""
    sensors = declared_noise(chain, signals).sensors
    return chain.with_noise(sensors, (KINEMATIC * float(sensors[0]) / signals.dt, 0.0, 1.0))


def kinematic_noise(chain: Chain, runs: Sequence[Run], signals: Signals, rates: float = 0.0) -> Chain:
    """An angle that body rates turn, with its sensor's noise as kinematics show it.

    A reading's error makes one increment too large and the next one too small: the covariance of neighbouring residuals
    is minus its variance. What goes on adding up is no sensor's noise: gyroscopes of a real machine drift, and are
    mounted a little askew. Where it is far more than the noise of the rates adds, it moves the angle.

    Args:
        chain: of one angle that no output drives, with a first guess of its sensor's noise.
        runs: as they would have been read had all sensors been read at once.
        signals: of the system, which say how rates turn the angle.
        rates: variance of the noise of the rates that turn it.

    Returns:
        The chain with that noise; as it was where readings are too few.
    """
    (angle,) = chain.states
    residuals = [(run.states[1:] - kinematic_step(run.states, signals, chain.form))[:, angle] for run in runs]
    if sum(len(residual) for residual in residuals) < FEW_READINGS:
        return chain
    # A single wild reading must not be taken for noise.
    most = OUTLYING * float(np.median(np.abs(np.concatenate(residuals))))
    clipped = [np.clip(residual, -most, most) for residual in residuals]
    products = np.concatenate([residual[1:] * residual[:-1] for residual in clipped])
    rough = float(chain.rough[0])
    found = min(-float(products.mean()), rough)
    sensors = np.array([max(BEST_SENSOR * BEST_SENSOR * rough, found)])
    quiet = chain.with_noise(sensors, (KINEMATIC * float(sensors[0]) / signals.dt, 0.0, 1.0))
    known = signals.dt * signals.dt * (rates + _bent(runs, signals))
    return _drifting(quiet, clipped, [run.weights[:, [angle]] for run in runs], signals.dt, known)


def _bent(runs: Sequence[Run], signals: Signals) -> float:
    """Variance of a body rate's mean over a period about the mean of its ends, as its second differences show it."""
    body = signals.kinematics
    if body is None:
        return 0.0
    rates = [signals.state_names.index(rate) for rate in body.rates]
    bends = np.concatenate([np.diff(run.states[:, rates], n=2, axis=0) for run in runs])
    return float(np.square(bends / 12.0).mean(axis=0).max())


def _drifting(
    quiet: Chain, residuals: Sequence[Floats], weights: Sequence[Floats], dt: float, known: float
) -> Chain:
    """An angle whose residuals add up beyond what the noise of its rates does, moved by that; else as it was.

    Args:
        quiet: the chain, with its sensor's noise.
        residuals: what a period adds to the angle beyond its kinematics, of each run (n,).
        weights: of the angle's readings, of each run (n + 1, 1).
        dt: period, s.
        known: variance that the noise of the rates and their motion between readings add to the angle in a period.
    """
    records = []
    for residual, counted in zip(residuals, weights, strict=True):
        added = np.concatenate([[0.0], np.cumsum(residual)])[:, np.newaxis]
        nothing = np.zeros((len(residual), 1))
        records.append((added, counted, nothing, nothing, nothing))
    first = float(quiet.sensors[0])
    low, slow = BEST_SENSOR * BEST_SENSOR * quiet.rough, Motion(KINEMATIC * first, 0.0, dt)
    regression = _core.Regression(1, dt, "increment", records)
    begun = (regression, [0.0], quiet.sensors, Motion(1e-2 * first, 0.0, dt), low, slow)
    ((sensors, motion, length),) = _core.most_likely_noises([begun])
    without = regression.likelihood([0.0], quiet.sensors, slow)
    drift = Motion(*motion).white - known
    if without - length < DRIFTS or drift <= max(LARGE * known, KINEMATIC * float(sensors[0])):
        return quiet
    return quiet.with_noise(sensors, (drift / dt, 0.0, 1.0))


def floor_of(chain: Chain, dt: float, integration: float = 0.0) -> tuple[Floats, Motion]:
    """Variances below which noise is not believed: rounding and integration leave that much.

    Disturbances could explain every reading exactly. Sensors are therefore never taken to be much better than their
    own roughness says, which is all noise of theirs or less, and never below rounding.

    Args:
        chain: of states.
        dt: period, s.
        integration: variance, a period, of what integrating terms leaves of what moves the first state.
    """
    sensors = BEST_SENSOR * BEST_SENSOR * chain.rough
    period = dt if chain.integrated else 1.0
    white = 1e-9 * float(sensors[0]) + integration
    return sensors, Motion(white / period, 1e-9 * float(sensors[0]) / (period * period), dt)
