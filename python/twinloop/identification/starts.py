"""Starts: the hypotheses that a search begins with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.identified import Identified
from twinloop.identification.records import guessed_noise
from twinloop.identification.search.behind_a_law import that_hold
from twinloop.identification.search.hidden import with_hidden, without_hidden
from twinloop.identification.search.moderation import with_moved
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import chains
from twinloop.identification.sensors.noise import declared_noise, given_noise, kinematic_noise
from twinloop.identification.sensors.offsets import moved, search_offsets
from twinloop.identification.terms.candidates import Candidates
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation, alike_commands
from twinloop.law.forms import EULER

ANEW, PARTS, RENEWED, FORMS, CONTACTS, GROWTH = 0, 1, 10, 100, 300, 600
"""Numbers of starts; each start draws from streams under its own number. In order: whole runs anew, the first part of
the only run, what was known, the first form, and what searches for contacts and for exponentials add to the number of
their start. Further parts and forms take the numbers that follow."""


def starts(context: Context, form: str) -> tuple[Callable[[], Hypothesis], ...]:
    """What the search begins with, each made when it is called: the runs anew, and what was known of fewer of them.

    Args:
        context: of the identification.
        form: what outputs mean.
    """
    aligned = cache(lambda: with_offsets(context, begun(context, form, context.first_pool(), ANEW)))
    known = context.earlier
    if known is None:
        return (lambda: from_both_sides(context, aligned()),)
    if not context.options.anew:
        return (lambda: renewed(context, known, aligned()),)
    # A law that followed fewer runs may be lost in a search among more; what is hidden shows when terms are nearly
    # right, and these when it shows.
    return (
        lambda: from_both_sides(context, *without_what_is_hidden(context, known, aligned())),
        lambda: renewed(context, known, aligned()),
    )


def begun(context: Context, form: str, pool: Pool, start: int) -> Hypothesis:
    """Nothing but candidates and a first guess of the noise.

    Args:
        context: of the identification.
        form: what outputs mean.
        pool: that candidates are entered in; nobody else's.
        start: its number.
    """
    signals, options, runs = context.signals, context.options, tuple(context.runs)
    every = chains(signals, form, guessed_noise(runs, np.array([state.scale for state in signals.states])))
    seen = [node for node in context.known_terms if not pool.is_hidden(node)]
    driven = (declared_noise(chain, signals) for chain in every if chain.output is not None)
    if options.moderation:
        driven = (with_moved(chain, runs, signals.dt) for chain in driven)
    candidates = Candidates.of(pool, signals, options, form, seen)
    if options.libraries and options.mixer:
        candidates = candidates.with_directions(context.axes, (), context.tilts(candidates.pool), exact=True)
    return Hypothesis(
        form=form,
        offsets=np.zeros(signals.n_x),
        runs=runs,
        actuation=Actuation.direct(signals),
        alike=alike_commands(signals),
        candidates=candidates,
        driven=tuple(driven),
        given=tuple(given_noise(chain, signals) for chain in every if chain.output is None),
        start=start,
    )


def with_offsets(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with runs as they would have been read had all sensors been read at once."""
    signals, runs, known = context.signals, context.runs, context.earlier
    offsets = hypothesis.offsets
    # A step of Euler looks like a sensor that is late by half a period: where one is believed no sensor is late.
    may_be_late = context.options.offsets and hypothesis.form not in EULER
    if may_be_late and known is not None and context.settled:
        offsets = known.offsets
    elif may_be_late:
        scales = np.array([state.scale for state in signals.states])
        every = [*hypothesis.driven, *hypothesis.given]
        offsets = search_offsets(runs, signals, every, scales, context.workers)
        offsets = that_hold(context, hypothesis, offsets)
    at_once = tuple(moved(runs, signals, offsets))
    rates = max((float(chain.sensors[0]) for chain in hypothesis.driven), default=0.0)
    given = tuple(kinematic_noise(chain, at_once, signals, rates) for chain in hypothesis.given)
    return replace(hypothesis, offsets=offsets, runs=at_once, given=given)


def without_what_is_hidden(
    context: Context, known: Identified, aligned: Hypothesis
) -> tuple[Hypothesis, list[Sum | None]]:
    """What noise and terms are searched anew with: lags as they were known, and sums, those of hidden states not."""
    sums = [_left_of(found, aligned.pool) for found in known.sums]
    alike = alike_commands(context.signals, known.actuation)
    return replace(aligned, actuation=known.actuation.bare(), alike=alike), sums


def renewed(context: Context, known: Identified, aligned: Hypothesis) -> Hypothesis:
    """What was known, with its lags and its hidden state, tuned on all runs."""
    candidates, hidden = aligned.candidates, known.actuation.hidden
    begins = replace(
        aligned,
        actuation=known.actuation,
        alike=alike_commands(context.signals, known.actuation),
        candidates=with_hidden(context, candidates, len(hidden)) if hidden else candidates,
        sums=tuple(replace(found, others=[]) for found in known.sums),
        start=RENEWED,
    )
    return fitted(context, begins)


def _left_of(found: Sum, pool: Pool) -> Sum | None:
    """A sum without terms of a hidden state; None where nothing is left of it."""
    left = without_hidden(found, pool)
    return None if found.weights and not left.weights else left
