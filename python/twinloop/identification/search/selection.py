"""Selection: which terms drive each chain, up a ladder of candidates, with the noise estimated from below and above.

Each function takes a hypothesis and gives another one; the searches of a hypothesis draw from one stream after another.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from twinloop._ground.side_by_side import side_by_side
from twinloop.identification.context import Context
from twinloop.identification.description import shorter, shortest
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.records import Stages, stages
from twinloop.identification.search.directions import directions
from twinloop.identification.search.evolution import evolve
from twinloop.identification.search.joints import with_joints
from twinloop.identification.search.noise import calm, first_noise, unexplained
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.quotients import renewed, with_quotients
from twinloop.identification.search.structure import Sum, search
from twinloop.identification.sensors.chains import Chain


def from_both_sides(
    context: Context, hypothesis: Hypothesis, known: Sequence[Sum | None] | None = None
) -> Hypothesis:
    """The shorter description of each chain, with the noise estimated from below or from above.

    From below, little noise makes many terms of few runs and stays little; from above, the strongest terms come
    first and the noise falls as far as they explain it. The sums from above are kept beside (`from_above`).

    Args:
        context: of the identification.
        hypothesis: whose terms of the first rung are searched.
        known: sums that are known, from which only the search from below begins; None: none are.
    """
    options, problem = context.options, Problem(context, hypothesis)
    terms, nothing = hypothesis.candidates.ladder[0], [None] * len(hypothesis.driven)
    threads = context.workers.threads
    walks = context.walks(hypothesis.next_unit(context.unit), options.moves, starts=2)
    below = first_noise(problem, hypothesis.driven, terms, options.gusts)
    low = hypothesis.searched(search(problem, below, terms, known or nothing, walks))
    if not options.noise_from_above:
        return replace(low, from_above=low.sums)
    above = side_by_side(lambda chain: unexplained(problem, chain, options.gusts), hypothesis.driven, threads)
    walks = context.walks(low.next_unit(context.unit), options.moves, starts=2)
    high = low.searched(search(problem, above, terms, nothing, walks))
    both = zip(low.sums, high.sums, strict=True)
    return replace(
        high,
        sums=tuple(shortest(pair, lambda found: found.description_length) for pair in both),
        from_above=high.sums,
    )


def short_search(
    context: Context, hypothesis: Hypothesis, chains: Sequence[Chain], known: Sequence[Sum | None]
) -> list[Sum]:
    """Sums of a quarter of the usual moves among the terms of the first rung, with the noise that all of them leave.

    Args:
        context: of the identification.
        hypothesis: whose terms are searched.
        chains: that they drive.
        known: sums to begin with, one for each chain; None: of no terms.
    """
    walks = context.walks(hypothesis.next_unit(context.unit), context.options.moves // 4)
    problem, terms = Problem(context, hypothesis), hypothesis.candidates.ladder[0]
    below = first_noise(problem, chains, terms, context.options.gusts)
    return list(search(problem, below, terms, known, walks))


def climbed(context: Context, hypothesis: Hypothesis, brief: bool = False) -> Hypothesis:
    """The hypothesis with the best sums of all rungs and of evolved terms; `brief`: of the first rung only.

    Directions of commands that are read off the sums so far stand on the first rung from then on.
    """
    options, climber = context.options, hypothesis
    inputs = stages(climber.runs, context.signals, climber.actuation)
    if options.libraries and options.directions and not brief:
        found = directions(Problem(context, climber, inputs), climber.sums, context.signals)
        states = range(context.signals.n_x)
        tilts = context.tilts(climber.pool)
        climber = replace(climber, candidates=climber.candidates.with_directions(found, states, tilts))
    climber = replace(climber, candidates=climber.candidates.growing())
    problem, ladder = Problem(context, climber, inputs), climber.candidates.ladder
    for number, terms in enumerate((ladder[:1] if brief else ladder) if options.libraries else ()):
        starts = options.starts if number == 0 and not brief else max(1, options.starts // 2)
        walks = context.walks(climber.next_unit(context.unit), options.moves, starts)
        driven = [found.chain for found in climber.sums]
        sums = search(problem, driven, terms, climber.sums, walks, fixed_noise=number > 0)
        climber = climber.searched(sums)
    if options.generations and not (brief and options.libraries):
        context.watch("evolution")
        seeds = [problem.pool.one, *range(problem.pool.inputs)] if options.libraries else list(ladder[0])
        seeds += [node for found in climber.sums for node in found.weights]
        for _ in range(options.restarts):
            walks = context.walks(climber.next_unit(context.unit), options.moves // 4, starts=2)
            sums = evolve(problem, climber.sums, seeds, options, walks, context.signals)
            climber = climber.searched(sums)
    return _with_implicit_laws(context, climber, inputs, brief)


def _with_implicit_laws(context: Context, hypothesis: Hypothesis, inputs: Stages, again: bool) -> Hypothesis:
    """The hypothesis with quotients, then shared masses, where they pay; the very same where they do not.

    Args:
        context: of the identification.
        hypothesis: with the best sums so far.
        inputs: of its runs and actuation.
        again: whether quotients were searched before, on states that were not smoothed: those that there are get new
            constants, and no others are looked for.
    """
    options = context.options
    # Where forms are compared, increments get none: a period of any law resembles a quotient.
    compared = context.as_integrated and hypothesis.form != "acceleration"
    if not (options.implicit and options.libraries) or compared:
        return hypothesis
    grown = replace(hypothesis, candidates=hypothesis.candidates.growing())
    problem, signals = Problem(context, grown, inputs), context.signals
    walks = context.walks(grown.next_unit(context.unit), options.moves // 2)
    if again:
        sums = renewed(problem, signals, grown.sums, walks)
    else:
        sums = with_quotients(problem, signals, grown.sums, grown.candidates.ladder[-1], walks)
    # After them: joints that share masses can stand in for one that hangs from a rope of changing length.
    if context.may_couple:
        sums = with_joints(problem, signals, sums, walks)
    changed = any(new is not old for new, old in zip(sums, grown.sums, strict=True))
    return grown.searched(sums) if changed else hypothesis


def undisturbed(context: Context, hypothesis: Hypothesis, least: float) -> Iterator[Hypothesis]:
    """The hypothesis with sums searched as if nothing disturbed: of its own terms, then of those of all rungs.

    Under a disturbance that explains all that is left no further term gains anything. Its own terms come first, for it
    may be that only their noise was mistaken. Noise is estimated behind what is found.

    Args:
        context: of the identification.
        hypothesis: with sums.
        least: what a sum must gain to take the place of another, in units of χ².

    Returns:
        One after the other, each made of the one before; none once hardly anything disturbs.
    """
    options, latest = context.options, hypothesis
    own = list(dict.fromkeys(node for found in hypothesis.sums for node in found.weights))
    for terms, moves in ((own, options.moves // 20), (hypothesis.candidates.ladder[-1], options.moves // 2)):
        problem = Problem(context, latest)
        driven = [calm(problem, found.chain) for found in latest.sums]
        if all(quiet is found.chain for quiet, found in zip(driven, latest.sums, strict=True)):
            return
        walks = context.walks(latest.next_unit(context.unit), moves)
        found = search(problem, driven, terms, latest.sums, walks)
        latest = latest.searched(
            [
                new if shorter(new.description_length + least, old.description_length) else old
                for old, new in zip(latest.sums, found, strict=True)
            ]
        )
        yield latest
