"""Likeness: whether series have something to do with each other, time by time, however slowly each of them changes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats

SHARE = 0.3
"""Correlation between flights from which that is more than a trace."""
PIECES = 200
"""Pieces into which a series is cut, in each of which it is taken at its mean."""


@dataclass(frozen=True)
class Likeness:
    """How alike pairs of series are.

    Args:
        product: sum of their products.
        by_luck: standard deviation of that sum if they had nothing to do with each other.
        size: of the sum if they were the same.
    """

    product: float
    by_luck: float
    size: float

    @classmethod
    def of(cls, pairs: Iterable[tuple[Floats, Floats]]) -> Likeness:
        """Of pairs, over all of them; of two series the longer one is cut.

        Args:
            pairs: of series, about 0.
        """
        product = scatter = size = 0.0
        for one, other in pairs:
            n = min(len(one), len(other))
            first, second = in_pieces(one[:n]), in_pieces(other[:n])
            product += float((first * second).sum())
            size += float(np.sqrt(np.square(first).sum() * np.square(second).sum()))
            # The variance of a sum of products of two unrelated series is that of their autocovariances' products.
            both = _autocovariances(first) * _autocovariances(second) * np.arange(len(first), 0, -1)
            scatter += float(both[0] + 2.0 * both[1:].sum())
        return cls(product, float(np.sqrt(max(scatter, 0.0))), size)

    def certain(self, deviations: float) -> bool:
        """Whether they are more than a trace alike, and by this many standard deviations more than by luck."""
        return self.product > SHARE * self.size and self.beyond_luck(deviations)

    def beyond_luck(self, deviations: float) -> bool:
        """Whether they are alike by this many standard deviations more than by luck, be it a trace."""
        return self.product > deviations * self.by_luck


def in_pieces(series: Floats) -> Floats:
    """Means over pieces of series (n, …), each as long as the next one; what is left at their end is not used."""
    length = max(1, len(series) // PIECES)
    whole = series[: len(series) // length * length]
    return np.asarray(whole.reshape(-1, length, *series.shape[1:]).mean(axis=1))


def _autocovariances(series: Floats) -> Floats:
    """About 0, for all shifts from 0 on."""
    n = len(series)
    return np.array([(series[: n - shift] * series[shift:]).sum() / n for shift in range(n)])
