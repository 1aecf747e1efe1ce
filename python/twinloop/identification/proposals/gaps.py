"""Masses behind gaps that no sensor reads: the load of a gear with backlash, of which the motor alone is logged.

Looked for where a model leaves more than noise. What drives such a mass is a rate that is read: its twist against the
mass, what presses beyond the gap and the mass' own rate follow from that rate and four numbers. What presses enters the
law as a term like any other.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

from twinloop._ground.elementary import power
from twinloop.identification.context import Context
from twinloop.identification.evidence import by_evidence, price
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.fit.predictions import smoothed
from twinloop.identification.fit.promises import promises
from twinloop.identification.fit.settling import settled
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.proposals.lags import without_lags
from twinloop.identification.proposals.storage import shows
from twinloop.identification.search.masses import masses_behind
from twinloop.identification.search.noise import first_noise, still
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.screen import Screen, Sources
from twinloop.identification.search.structure import Sum, prices, usable_among, weighed
from twinloop.identification.terms.friction import entered, frictions
from twinloop.law.actuation import HiddenState

LOOKED_AT = 1500
"""Periods at most of the runs in which masses are looked for; laws with them are tuned on all."""
SHORTEST = 50
"""Periods of a part of a run in which it is worth while."""
DAMPED = (1.0, 0.3)
"""Shares of the damping of what was walked to from which it is tuned."""
FADED = (1.0, 2.5)
"""Shares of the time in which it fades from which it is tuned, each with each."""
FAR = 200.0
"""What the best law with a mass may be longer by, in units of χ², before masses are tuned from beside them."""
ROUNDS = 6
"""Times at most that it is."""
GAIN = 3.0
"""What each of these times must gain, in units of χ²: one that does not is the last, or two in a row once it pays."""
BESIDE = (("turns", 0.08), ("gap", 0.06), ("damping", 0.2), ("time", 0.1))
"""Shares by which its numbers are larger or smaller then."""
QUIET = 0.3
"""Variance of what disturbs in a period, in a sensor's, up to which it is not."""
MORE = 6
"""Terms at most that are added one by one."""
SCREENS = 100
"""Number of the first screen; those of storages have smaller ones."""
FINALISTS = 3
"""Terms, those that promise most, that are tuned before one is taken."""


def gaps(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis with the best mass behind a gap, fitted; none where only noise is left, or none pays."""
    driven = [found.chain.states[0] for found in hypothesis.sums]
    rates = [i for i, state in enumerate(driven) if context.signals.states[state].derivative_of is not None]
    if not (context.options.storage and rates) or hypothesis.fit is None or hypothesis.form != "acceleration":
        return
    problem = Problem(context, hypothesis)
    quiet = still(problem, (found.chain for found in hypothesis.sums))
    if problem.priors.bounds or (quiet and hypothesis.fit.stable):
        return
    context.watch("hidden")
    bare = smoothed(context, hypothesis) or replace(hypothesis, fit=None)
    # A lag may have stood in for what a mass does, so commands that act at once come first.
    numbers = itertools.count(SCREENS)
    for variant in (*without_lags(context, bare), bare):
        screen, short = Screen.of(context, variant, next(numbers)), _short(variant)
        looked = screen if short is variant else Screen.of(context, short, next(numbers))
        for place in rates:
            several: list[Hypothesis] = []
            for pairs in _nearest(_masses(looked, place)):
                several += [fitted(context, one) for pair in pairs for one in _described(screen, pair, place)]
                if not any(one.evidence.length < hypothesis.evidence.length + FAR for one in several):
                    break
            if not several:
                continue
            with_mass = max(several, key=by_evidence)
            if with_mass.evidence.length < hypothesis.evidence.length + FAR:
                with_mass = _polished(context, with_mass, hypothesis)
            if (
                with_mass.evidence > hypothesis.evidence
                and (more := _with_more(context, with_mass, place)) is not with_mass
            ):
                with_mass = _polished(context, more, hypothesis)
            yield with_mass
            if with_mass.evidence > hypothesis.evidence:
                yield from (fitted(context, closed) for closed in _closed(context, with_mass, place))
                return


def _short(hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with so much of its runs as masses are looked for in; itself where that is all."""
    left, runs = LOOKED_AT, []
    for run in hypothesis.runs:
        if left >= SHORTEST:
            runs.append(run if len(run.commands) <= left else run.part(0, left))
            left -= len(run.commands)
    return hypothesis if left >= 0 else replace(hypothesis, runs=tuple(runs))


def _polished(context: Context, with_mass: Hypothesis, known: Hypothesis) -> Hypothesis:
    """The best hypothesis tuned to from beside one: where a mass just touches, what is left has many valleys.

    One that is no likelier than what is known without a mass is hardly another valley's neighbour: it gets one chance.
    """
    failed, dt = 0, context.signals.dt
    for number in range(ROUNDS):
        if all(one.chain.motion.white * dt <= QUIET * float(one.chain.sensors[0]) for one in with_mass.sums):
            break
        begun = replace(settled(with_mass), fit=None)
        # Half of the corners of a box, then the others.
        corners = [
            corner for corner in itertools.product((False, True), repeat=4) if sum(corner) % 2 == number % 2
        ]
        best = max(
            [with_mass, *(fitted(context, _beside(begun, corner)) for corner in corners)], key=by_evidence
        )
        failed = 0 if best.evidence.less(GAIN) > with_mass.evidence else failed + 1
        with_mass = best
        if failed == (2 if with_mass.evidence > known.evidence else 1):
            break
    return with_mass


def _beside(with_mass: Hypothesis, corner: Sequence[bool]) -> Hypothesis:
    """The hypothesis with another mass, numbers of which are larger, the others smaller, that is pressed as much."""
    changed = {
        name: 1.0 + share if larger else 1.0 / (1.0 + share)
        for (name, share), larger in zip(BESIDE, corner, strict=True)
    }
    hidden = tuple(
        one._replace(**{name: getattr(one, name) * factor for name, factor in changed.items()})
        for one in with_mass.actuation.hidden
    )
    stiffer, pool = 1.0 / (changed["turns"] * changed["turns"]), with_mass.pool
    sums = tuple(
        replace(
            found,
            weights={
                term: weight * (stiffer if 0 in pool.hidden_in(term) else 1.0)
                for term, weight in found.weights.items()
            },
            others=[],
        )
        for found in with_mass.sums
    )
    return replace(with_mass, actuation=replace(with_mass.actuation, hidden=hidden), sums=sums)


def _with_more(context: Context, with_mass: Hypothesis, place: int) -> Hypothesis:
    """The hypothesis with terms that pay beside what presses on its mass: each is added to what is tuned.

    Regressions on readings find none: of what presses they know too little between them.
    """
    for _ in range(MORE):
        grown = replace(with_mass, candidates=with_mass.candidates.growing())
        problem, known = Problem(context, grown), grown.sums[place]
        every = list(frictions(context.signals, problem.stages.start)) if context.options.friction else []
        readings = problem.readings(known.chain)
        nodes = [entered(problem.pool, each, len(every), readings) for each in every]
        nodes = problem.usable([*grown.candidates.ladder[0], *nodes])
        nodes = [node for node in dict.fromkeys(nodes) if node not in known.weights]
        gains = promises(context, grown, place, nodes)
        costs = prices(problem.pool, nodes, readings, len(grown.runs))
        best = sorted(range(len(nodes)), key=lambda i: (costs[i] - gains[i], i))[:FINALISTS]
        begun = settled(grown)
        own, others = begun.sums[place], []
        for node in (nodes[i] for i in best if gains[i] > costs[i]):
            more = replace(begun, candidates=begun.candidates.with_terms([node]))
            others.append(_with_sum(more, place, replace(own, weights={**own.weights, node: 0.0}, others=[])))
        found = max([with_mass, *(fitted(context, other) for other in others)], key=by_evidence)
        if found is with_mass:
            break
        with_mass = found
    return with_mass


def _closed(context: Context, with_mass: Hypothesis, place: int) -> Iterator[Hypothesis]:
    """The hypothesis with a spring in the place of a gap, as two hidden states that turn; none where they would not.

    None either where tuning has shown that nothing of its mass presses, so that it went and other terms stayed.
    """
    if not with_mass.actuation.hidden:
        return
    begun = settled(replace(with_mass, candidates=with_mass.candidates.growing()))
    own, known, pool = begun.actuation.hidden[0], begun.sums[place], begun.pool
    stiffness = 1.0 / (own.turns * own.turns)
    half = 0.5 * (own.damping * stiffness + 1.0 / own.time)
    if not half * half < stiffness:
        return
    turns = 1.0 / float(power(stiffness - half * half, 0.5))
    pair = (HiddenState((), False, 0.0, 1.0 / half, own.states, False, turns),) * 2
    tried = replace(begun, actuation=replace(begun.actuation, hidden=pair), fit=None)
    problem, kept = Problem(context, tried), [term for term in known.weights if not pool.is_hidden(term)]
    usable = problem.usable(list(dict.fromkeys([*kept, *own.states, pool.hidden(0), pool.hidden(1)])))
    weights = weighed(problem, known.chain, usable)
    if weights is not None and shows(pair, context.signals.dt):
        yield _with_sum(tried, place, replace(known, weights=weights, others=[]))


def _with_sum(hypothesis: Hypothesis, place: int, other: Sum) -> Hypothesis:
    """The hypothesis with another sum in one place, not fitted."""
    sums = (*hypothesis.sums[:place], other, *hypothesis.sums[place + 1 :])
    return replace(hypothesis, sums=sums, fit=None)


def _nearest(masses: Sequence[HiddenState]) -> Iterator[list[Sources]]:
    """Masses, then others from which tuning may go elsewhere: readings between which little is known bias these two."""
    for damping, time in itertools.product(DAMPED, FADED):
        others = [one._replace(damping=one.damping * damping, time=one.time * time) for one in masses]
        yield [(other, other) for other in others]


def _described(screen: Screen, pair: Sources, place: int) -> Iterator[Hypothesis]:
    """The hypothesis with a mass, and what presses on it beside linear terms; none if these are collinear.

    What the mass does stood as a lasting disturbance until now, or as terms that stand in for it. Such a disturbance
    would still hide what is as slow, like friction: so none is believed to last.
    """
    tried, problem = screen.behind(pair)
    pool, found = tried.pool, tried.sums[place]
    usable = problem.usable([pool.one, *range(pool.inputs), pool.hidden(0)])
    [chain] = first_noise(problem, [found.chain], usable, gusts=False)
    weights = weighed(problem, chain, usable)
    if weights is not None:
        yield _with_sum(tried, place, replace(found, chain=chain, weights=weights, others=[]))


def _masses(screen: Screen, place: int) -> list[HiddenState]:
    """Masses that the rate drives whose law is one of a screen's sums, which explain most of what is left of it."""
    hypothesis, context, chain = screen.hypothesis, screen.context, screen.hypothesis.sums[place].chain
    rate = chain.states[0]

    def behind(turns: float, gap: float, damping: float, time: float) -> HiddenState:
        return HiddenState((), False, 0.0, time, (rate,), False, turns, gap, damping)

    priced = (
        price(hypothesis.form, actuation, hypothesis.alike, context.signals.n_x)
        for actuation in (
            replace(hypothesis.actuation, hidden=(behind(1.0, 1.0, 1.0, 1.0),) * 2),
            hypothesis.actuation,
        )
    )
    base = usable_among(screen.problem, screen.terms, hypothesis.sums)
    found = masses_behind(screen.problem, context.signals, chain, base, next(priced) - next(priced))
    return [behind(*mass.tolist()) for mass in found]
