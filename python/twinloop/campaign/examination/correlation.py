"""Correlation of innovations with themselves and with what was commanded (Ljung 1999, section 16.6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats

NORMAL_99 = 2.5758293035489004
"""Standard deviations on either side of 0 between which 99 of 100 normal numbers lie."""
LAGS = 20
"""Periods over which correlations are looked at, where the runs are long enough."""
FEWEST = 8
"""Numbers for each lag that a run must have."""


@dataclass(frozen=True, eq=False)
class Correlations:
    """Correlations of sequences, by lag.

    Args:
        lags: in periods (l,).
        values: correlation coefficients (..., l).
        limit: 99 of 100 coefficients of independent numbers lie between −limit and +limit.
        count: of numbers in the sequences.
    """

    lags: Floats
    values: Floats
    limit: float
    count: int

    @property
    def told(self) -> NDArray[np.bool_]:
        """Whether each sequence tells anything (...): a constant does not, such as of a rate that no sensor reads."""
        found: NDArray[np.bool_] = (self.values != 0.0).any(axis=-1)
        return found

    @property
    def outside(self) -> float:
        """Share beyond the limits of those that tell anything; lag 0 of a sequence with itself does not count."""
        counted = self.values[self.told][..., self.lags > 0.0]
        return float((np.abs(counted) > self.limit).mean()) if counted.size else 0.0


def lags_of(lengths: Sequence[int]) -> int:
    """Lags that runs of these lengths bear: an eighth of the shortest, at most `LAGS`.

    Args:
        lengths: of the runs.
    """
    return max(0, min(LAGS, min(lengths, default=0) // FEWEST))


def autocorrelation(runs: Sequence[Floats], lags: int) -> Correlations:
    """Of each column with itself, over all runs, about the mean of all.

    Args:
        runs: (n, c) each.
        lags: the last one.

    Returns:
        Coefficients (c, lags + 1) from lag 0; 0 for a column that is constant.
    """
    centred, variance = _centred(runs)
    values = np.stack(
        [sum((x[lag:] * x[: len(x) - lag]).sum(axis=0) for x in centred) for lag in range(lags + 1)], axis=-1
    )
    count = sum(len(x) for x in centred)
    return Correlations(np.arange(lags + 1.0), _over(values, variance[:, np.newaxis]), _limit(count), count)


def crosscorrelation(runs: Sequence[Floats], causes: Sequence[Floats], lags: int) -> Correlations:
    """Correlation of each column with each cause at each lag: what a cause explains that the model does not.

    Causes of runs in closed loop also answer to noise, after it: only what comes before counts, from lag 1 on.

    Args:
        runs: (n, c) each.
        causes: (n, d) each, row k one period before row k of the run.
        lags: the last one.

    Returns:
        Coefficients (c, d, lags), from lag 1; 0 for a column that is constant.
    """
    centred, variance = _centred(runs)
    causing, strength = _centred(causes)
    values = np.stack(
        [
            sum(
                np.einsum("kc,kd->cd", x[lag - 1 :], u[: len(x) - lag + 1])
                for x, u in zip(centred, causing, strict=True)
            )
            for lag in range(1, lags + 1)
        ],
        axis=-1,
    )
    count = sum(len(x) for x in centred)
    scale = np.sqrt(variance[:, np.newaxis, np.newaxis] * strength[np.newaxis, :, np.newaxis])
    return Correlations(np.arange(1.0, lags + 1.0), _over(values, scale), _limit(count), count)


def _centred(runs: Sequence[Floats]) -> tuple[list[Floats], Floats]:
    """The runs about the mean of all, and the sum of squares of each column."""
    mean = np.concatenate(runs).mean(axis=0)
    centred = [run - mean for run in runs]
    return centred, sum(np.square(x).sum(axis=0) for x in centred)


def _over(values: Floats, scale: Floats) -> Floats:
    return np.divide(
        values, scale, out=np.zeros_like(values), where=np.broadcast_to(scale > 0.0, values.shape)
    )


def _limit(count: int) -> float:
    return NORMAL_99 / float(np.sqrt(max(1, count)))
