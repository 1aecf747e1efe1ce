"""The committee: models that explain the runs about as well, so that their disagreement is what the runs leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop._ground.elementary import exp
from twinloop.identification.context import Context
from twinloop.identification.fit.models import model_of
from twinloop.identification.fit.tuning import tune
from twinloop.identification.hypothesis import Fit, Hypothesis
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import exact
from twinloop.identification.terms.bounds import bounded_solution
from twinloop.law.reports import with_reports

PLAUSIBLE = 1.5
"""Multiple of the best model's χ² up to which another structure is a member."""
ROUNDING = 2.0**-50
"""Share of a reading that rounding takes of it in a step or two: no model follows it more closely."""
SEATS = 4
"""One of this many members comes from a part of the only run."""


class Committee:
    """The best model, draws from what the runs leave open of it, and other structures that are nearly as good.

    Args:
        context: of the identification.
        hypothesis: that is believed; its sums hold the other subsets of their search.
        fit: of it.
        rivals: that were proposed on the way to it; those of parts of the only run have seats.

    Attributes:
        members: models, the best first; at most as many as the options ask for.
        observer: all chains with noise that explains what is left.
        of_parts: whether there are members that parts of the only run have led to.
    """

    def __init__(
        self, context: Context, hypothesis: Hypothesis, fit: Fit, rivals: Sequence[Hypothesis]
    ) -> None:
        observer = _rescaled(hypothesis, fit)
        seats = context.options.committee_size // SEATS
        others = [rival.fit.model for rival in rivals if rival.of_part and rival.fit is not None][:seats]
        size = context.options.committee_size - len(others)
        base, draws = tune(context, hypothesis, fit.model, observer, 0, size)
        members = [fit.model, *_structures(context, hypothesis, base, draws, size)]
        while len(members) < size and draws:
            members.append(draws.pop())
        # The others first: gains are tuned on the first few members, and should suit laws that differ, not draws of
        # one law's constants.
        members = [members[0], *others, *members[1:]]
        members = [as_read(context, hypothesis, member) for member in members]
        self.members, self.observer, self.of_parts = members, observer, bool(others)


def as_read(context: Context, hypothesis: Hypothesis, model: _core.Model) -> _core.Model:
    """A model whose states are read, and whose commands are sent, as those of the runs were.

    Args:
        context: of the identification.
        hypothesis: of the model.
        model: whose states are all read at once.
    """
    if hypothesis.offsets.any():
        model = model.with_offsets(hypothesis.offsets.tolist())
    if context.levels:
        model = model.with_levels(context.levels)
    return with_reports(model, context.reports) if context.reports else model


def _structures(
    context: Context, hypothesis: Hypothesis, base: Fit, draws: list[_core.Model], size: int
) -> list[_core.Model]:
    """Members of subsets drawn by how likely they are; where the best one's is drawn, its next constants."""
    problem, draw = Problem(context, hypothesis), context.unit.stream("structures")
    plausible = PLAUSIBLE * max(base.chi_squared, base.readings)
    members: list[_core.Model] = []
    grams: dict[tuple[int, tuple[int, ...]], _core.Gram] = {}
    for attempt in range(3 * size):
        if len(members) + 1 >= size:
            break
        structures = [_other(found, draw) for found in hypothesis.sums]
        if all(s is None for s in structures):
            if draws:
                members.append(draws.pop())
            continue
        varied = []
        for i, (found, subset) in enumerate(zip(hypothesis.sums, structures, strict=True)):
            if subset is None:
                varied.append(found)
                continue
            terms = problem.usable(subset)
            if (i, subset) not in grams:
                grams[i, subset] = problem.gram(found.chain, problem.values(terms))
            limits = problem.limits(found.chain, terms)
            solved = grams[i, subset].solve(list(range(len(terms))))
            if solved is None:
                varied.append(found)
            else:
                coefficients, _ = bounded_solution(solved, range(len(terms)), limits)
                weights = dict(zip(terms, coefficients.tolist(), strict=True))
                varied.append(replace(found, weights=weights))
        other = replace(hypothesis, sums=tuple(varied), fit=None)
        fit, drawn = tune(context, other, model_of(context, other), base.observer, 4, 1, number=attempt + 1)
        if fit.stable and fit.chi_squared <= plausible and drawn:
            members.append(drawn[0])
    return members


def _rescaled(hypothesis: Hypothesis, fit: Fit) -> tuple[Chain, ...]:
    """Noise that explains what is left on average, so that members are as uncertain as the runs say."""
    misfit = fit.chi_squared / max(1, fit.readings) if fit.stable else 1.0
    factor = misfit if exact(misfit) else max(misfit, 1.0)
    sizes = np.max([np.abs(run.states).max(axis=0) for run in hypothesis.runs], axis=0)
    scaled = []
    for chain in fit.observer:
        least = np.square(ROUNDING * sizes[list(chain.states)])
        sensors = np.where(least > 0.0, np.maximum(chain.sensors * factor, least), chain.sensors)
        motion = (
            chain.motion.white * factor,
            chain.motion.correlated * factor,
            chain.motion.correlation_time,
        )
        scaled.append(chain.with_noise(sensors, motion))
    return tuple(scaled)


def _other(found: Sum, draw: _core.Stream) -> tuple[int, ...] | None:
    """A subset drawn by how likely it is; None for the best one."""
    chances = exp(-0.5 * np.array([0.0, *(other.above for other in found.others)]))
    pick = int(np.searchsorted(np.cumsum(chances) / chances.sum(), draw.uniform()))
    return None if pick == 0 else found.others[min(pick, len(found.others)) - 1].terms
