"""Hidden states that commands drive: searched by description length, then tuned.

A machine carries more than its sensors read: a climb that thrust has built up, heat that a current has left. Where such
a state matters it is an input like another: alone, times every input, and times what moves an output.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop._ground.streams import Unit
from twinloop.identification.context import Context
from twinloop.identification.evidence import by_evidence
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.directions import directions
from twinloop.identification.search.hidden import filled, with_hidden
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.search.structure import Sum, search
from twinloop.identification.terms.directions import Direction, together
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import HiddenState, alike_commands
from twinloop.signals import Signals

TIMES = (0.25, 1.0, 4.0)
"""Times that are tried, in lengths of the longest run; the one in the middle first."""
RAW, SMOOTHED = 1, 2
"""Numbers of the units of work that look for one behind states as they were read, and as a model has smoothed them."""


def hidden(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with the best hidden state, before it is fitted."""
    if hypothesis.fit is not None or not context.may_hide:
        return
    context.watch("hidden")
    found = filled_by_commands(context, hypothesis, hypothesis.sums)
    # Looking anew at the noise behind it is dear: only where it is believed.
    if found.evidence > hypothesis.evidence:
        yield from_both_sides(context, found, found.sums)


def filled_by_commands(context: Context, hypothesis: Hypothesis, start: Sequence[Sum]) -> Hypothesis:
    """The hypothesis with the best hidden state that commands fill, whether it pays or not.

    Args:
        context: of the identification.
        hypothesis: with actuators, and perhaps another hidden state.
        start: sums to begin with. Those that were found without the state stand in for it already.
    """
    signals, options = context.signals, context.options
    candidates = hypothesis.candidates.growing()
    enter_directions(candidates.pool, directions(Problem(context, hypothesis), start, signals))
    base = replace(hypothesis, candidates=candidates)
    driven = [found.chain for found in start]
    own = [term for found in start for term in found.weights]
    few, many = ([*filled(candidates.pool), *terms] for terms in (own, candidates.ladder[0]))
    unit, number = _unit(context, hypothesis), itertools.count(1)

    def tried(state: HiddenState) -> Hypothesis:
        behind = replace(base, actuation=replace(base.actuation, hidden=(state,)), fit=None)
        walks = context.walks(unit.part(next(number)), options.moves // 10, purpose="hidden_subsets")
        sums = search(Problem(context, behind), driven, few, start, walks)
        return replace(behind, sums=tuple(sums))

    longest = signals.dt * max(len(run.commands) for run in hypothesis.runs)
    rests: Sequence[Floats | None] = context.rests or [None]
    states = [
        HiddenState(tuple(group), squared, _mean(signals, group, squared, rest), TIMES[1] * longest)
        for group in alike_commands(signals)
        for squared in (False, True)
        for rest in rests
    ]
    found = [tried(state) for state in (*states, *_known(context, hypothesis))]
    (state,) = max(found, key=by_evidence).actuation.hidden
    found += [tried(state._replace(time=time * longest)) for time in (TIMES[0], TIMES[2])]
    best = max(found, key=by_evidence)
    # Which one shows on the terms that there are; whether there is one, when all may change.
    walks = context.walks(unit.part(0), options.moves, max(1, options.starts // 2), "hidden_subsets")
    sums = search(Problem(context, best), driven, many, best.sums, walks)
    return replace(best, sums=tuple(sums), candidates=with_hidden(context, best.candidates))


def enter_directions(pool: Pool, found: Sequence[Direction]) -> None:
    """Enters products of the hidden state and of directions of commands.

    What a hidden state does to each rotor it does to their difference.
    """
    for direction in found:
        term = pool.product(pool.hidden(0), together(pool, direction))
        pool.found[term] = float(log(3.0 * (pool.inputs + 1)))


def _known(context: Context, hypothesis: Hypothesis) -> tuple[HiddenState, ...]:
    """Hidden states that commands fill and that were found before."""
    earlier = () if context.earlier is None else context.earlier.actuation.hidden
    return tuple(state for state in hypothesis.actuation.hidden or earlier if not state.integrated)


def _unit(context: Context, hypothesis: Hypothesis) -> Unit:
    """Of work, for one look."""
    return context.unit.part(hypothesis.start + (SMOOTHED if hypothesis.smoothed else RAW))


def _mean(signals: Signals, group: Sequence[int], squared: bool, rest: Floats | None) -> float | None:
    if rest is None:
        return None
    levels = np.array([rest[i] / signals.commands[i].size for i in group])
    return float(np.mean(levels * levels if squared else levels))
