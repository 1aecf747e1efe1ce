"""Parts of a run: what each of them would have taught shows how far the law of the whole may carry over.

A single run is explained as well by laws that part ways on the next one. Two runs test each other; of one, parts do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from twinloop.identification.context import Context
from twinloop.identification.description import shortest
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.records import Run
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import climbed, from_both_sides
from twinloop.identification.search.structure import search
from twinloop.identification.starts import PARTS, begun
from twinloop.law.actuation import Actuation
from twinloop.signals import Signals

SHARES = ((0.0, 0.7), (0.3, 1.0), (0.0, 0.5), (0.5, 1.0))
"""Where parts begin and end, as shares of a run; those that miss less of it first."""
SHORTEST = 20
"""Periods of a part at least."""


def parts(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The shortest sum of each output that the only run or parts of it have led to, then what each part has led to.

    Parts enter terms in one pool after another, so that a sum of one means the same in the last.
    """
    if not context.options.parts or len(hypothesis.runs) != 1:
        return
    context.watch("parts")
    whole, found = hypothesis, []
    for number, (run, begins) in enumerate(cut(whole.runs[0], context.signals, whole.actuation), PARTS):
        brief = context.brief([run])
        # Of so little, anything resembles a quotient.
        brief = replace(brief, options=replace(brief.options, implicit=False))
        part = begun(brief, whole.form, whole.pool.copy(), number)
        part = climbed(brief, from_both_sides(brief, replace(part, actuation=begins)))
        whole = replace(whole, candidates=replace(whole.candidates, pool=part.pool))
        own = [term for sum_ in part.sums for term in sum_.weights]
        walks = context.walks(whole.next_unit(context.unit), brief.options.moves // 4)
        driven = [sum_.chain for sum_ in part.sums]
        sums = search(Problem(context, whole), driven, own, part.sums, walks)
        tried = whole.searched(sums)
        whole = replace(whole, searches=tried.searches)
        answer = replace(fitted(context, tried), of_part=True)
        if answer.evidence.stable:
            found.append(answer)
    of_each = zip(hypothesis.sums, *(answer.sums for answer in found), strict=True)
    best = [shortest(sums, lambda sum_: sum_.description_length) for sums in of_each]
    if any(new is not old for new, old in zip(best, hypothesis.sums, strict=True)):
        yield fitted(context, replace(whole, sums=tuple(best)))
    yield from found


def cut(run: Run, signals: Signals, actuation: Actuation) -> list[tuple[Run, Actuation]]:
    """Parts of a run that are long enough, each with actuators that begin with the effects they have there.

    Args:
        run: recorded.
        signals: of the system.
        actuation: between commands and model, without hidden states.

    Returns:
        Runs of their own.
    """
    steps = len(run.commands)
    effects, _, _ = actuation.effects(signals, run.commands)
    found = []
    for first, last in ((int(begins * steps), int(ends * steps)) for begins, ends in SHARES):
        if last - first < SHORTEST:
            continue
        rests = effects[first].tolist() if first else [actuator.rest for actuator in actuation.actuators]
        # Behind the effects of actuators stand hidden states that commands fill.
        begun = tuple(
            actuator._replace(rest=rest)
            for actuator, rest in zip(actuation.actuators, rests[: signals.n_u], strict=True)
        )
        found.append((run.part(first, last), replace(actuation, actuators=begun)))
    return found
