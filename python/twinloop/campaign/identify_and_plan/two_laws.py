"""Two laws: where none explains the flights, a nonlinear one beside one of linear terms, and what each has foretold.

A law with more terms follows the flights that it was learnt from better in any case. Of a flight that it has not learnt
that says nothing where an unlogged state moves the system. So two laws are compared on flights that came after them
(prequential comparison; Dawid 1984).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.following import following
from twinloop.records import Recorded

Kind = Literal["nonlinear", "linear"]
LEAST = 1e-12
"""Ratio of mean squares to those of the model that never moves, below which predictions are equally good."""


@dataclass(frozen=True, eq=False)
class TwoLaws(Recorded, kind="two_laws"):
    """Both laws that were learnt from flights which neither explains.

    Args:
        experiments: number of these flights.
        nonlinear: the best model of all terms.
        linear: the best model of linear terms.
    """

    experiments: int
    nonlinear: _core.Model
    linear: _core.Model


def better_foretold(
    earlier: Sequence[TwoLaws],
    flights: Sequence[Experiment],
    limits: Limits,
    workers: _core.Workers,
) -> Kind | None:
    """Which kind of law has foretold flights better, each time those that came before the next laws were learnt.

    Args:
        earlier: both laws, in the order in which they were learnt.
        flights: all so far.
        limits: where a run counts as diverged.
        workers: how the work is carried out.

    Returns:
        The kind that diverged on fewer of them; where that is the same, the one with the smaller errors, mean of
        logarithms over the flights on which both last. None where no flight came after such laws.
    """
    ends = [*(laws.experiments for laws in earlier[1:]), len(flights)]
    ratios = [
        _ratios(laws, flights[laws.experiments : end], limits, workers)
        for laws, end in zip(earlier, ends, strict=True)
        if end > laws.experiments
    ]
    return compared(np.concatenate(ratios, axis=1)) if ratios else None


def compared(ratios: Floats) -> Kind:
    """Which of two laws has foretold better.

    Args:
        ratios: of the nonlinear and the linear law (2, N), mean squares over those of the model that never moves;
            infinite where the law diverged.
    """
    lost = np.isinf(ratios).sum(axis=1)
    if lost[0] != lost[1]:
        return "nonlinear" if lost[0] < lost[1] else "linear"
    both = ratios[:, np.isfinite(ratios).all(axis=0)]
    nonlinear, linear = log(np.maximum(both, LEAST)).sum(axis=1)
    return "linear" if linear < nonlinear else "nonlinear"


def _ratios(laws: TwoLaws, flights: Sequence[Experiment], limits: Limits, workers: _core.Workers) -> Floats:
    """Mean squares of both laws on flights, over those of the model that never moves (2, N)."""
    return following([laws.nonlinear, laws.linear], flights, limits, workers).ratios
