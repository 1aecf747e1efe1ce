"""What each flight is worth as data: how much it moved beside the sensors' noise, what was odd, and its fingerprint."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from twinloop._experiment.envelope import is_bounded
from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.trajectory import continued

LARGE = 3.0
"""Standard deviations from which an innovation is looked at."""


@dataclass(frozen=True)
class DataQuality:
    """The data quality of one experiment.

    Args:
        number: of the test; None for an attached run.
        seconds: its duration.
        ended: "completed", "aborted" or "diverged".
        moved: smallest motion of a state: root mean square about its mean, over its sensor's noise; None without a
            known noise.
        least: name of that state.
        saturated: share of the periods in which a command was at a bound, the most of all commands.
        large: share of innovations beyond three standard deviations; None without innovations. 0.3 % are expected.
        usage: largest usage of the envelope by its readings; None without an envelope.
        fingerprint: the first 16 hexadecimal digits of the SHA-256 of times, states and commands, as little-endian
            doubles in this order.
    """

    number: int | None
    seconds: float
    ended: str
    moved: float | None
    least: str
    saturated: float
    large: float | None
    usage: float | None
    fingerprint: str


def data_quality(
    run: Experiment, sensors: Floats | None, innovations: Floats | None, saturated: float
) -> DataQuality:
    """Of one experiment.

    Args:
        run: an experiment.
        sensors: standard deviation of each state's readings (n_x,); None where unknown.
        innovations: of it (n + 1, n_x), the first row aside; None where there are none.
        saturated: share of the periods with a command at a bound.
    """
    flown, signals = run.trajectory, run.replayed.signals
    states = continued(flown, signals, flown.states[0]).states
    moved, least = None, ""
    shares = movements(states, sensors)
    if shares is not None:
        place = int(np.argmin(shares))
        moved, least = float(shares[place]), signals.state_names[place]
    large = None if innovations is None else float((np.abs(innovations[1:]) > LARGE).mean())
    return DataQuality(
        run.number,
        float(flown.t[-1] - flown.t[0]),
        flown.ended,
        moved,
        least,
        saturated,
        large,
        run.usage if is_bounded(signals) else None,
        fingerprint(run),
    )


def movements(states: Floats, sensors: Floats | None) -> Floats | None:
    """How much each state moved: root mean square about its mean, over its sensor's noise.

    Args:
        states: of a flight (n + 1, n_x).
        sensors: standard deviation of each state's readings (n_x,); None where unknown.

    Returns:
        One a state (n_x,), infinite where its sensor has no noise; None where no sensor has any.
    """
    if sensors is None or not (sensors > 0.0).any():
        return None
    noise = np.where(sensors > 0.0, sensors, np.inf)
    return np.where(sensors > 0.0, states.std(axis=0) / noise, np.inf)


def fingerprint(run: Experiment) -> str:
    """The first 16 hexadecimal digits of the SHA-256 of an experiment's data.

    Args:
        run: an experiment.
    """
    digest = hashlib.sha256()
    for values in (run.trajectory.t, run.trajectory.states, run.trajectory.commands):
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()[:16]
