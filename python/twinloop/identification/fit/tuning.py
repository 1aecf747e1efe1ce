"""Tuning: constants and lags of a model on its predictions, within bounds, and draws of what the runs leave open."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop.identification.context import Context
from twinloop.identification.fit.models import layout, limits_of
from twinloop.identification.hypothesis import Fit, Hypothesis
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.bounds import beyond, bounded_model
from twinloop.law.actuation import Actuation
from twinloop.signals import Signals

LONGEST_MEMORY = 16.0
"""Time of a hidden state at most, in lengths of the longest run: no run can tell a longer one from for ever."""


def tune(
    context: Context,
    hypothesis: Hypothesis,
    model: _core.Model,
    observer: Sequence[Chain],
    steps: int,
    draws: int = 0,
    number: int = 0,
) -> tuple[Fit, list[_core.Model]]:
    """A model tuned on its predictions; a constant that leaves its bounds is held at the nearer one.

    Args:
        context: of the identification.
        hypothesis: whose sums the model is made of, and on whose runs it is tuned.
        model: to begin with.
        observer: all chains, with their noise.
        steps: at most.
        draws: models to be drawn from what the runs leave open.
        number: of the call, which tells its draws from those of others.

    Returns:
        The fit, and the draws.
    """
    signals, tuning = context.signals, context.options.tuning
    free = list(range(len(model.constants))) if hypothesis.form == "absolute" else layout(hypothesis)[0]
    actuation, lags = Actuation.of(model, signals), moving_together(model, hypothesis, signals)
    limits = limits_of(hypothesis) if tuning else {}
    # Nothing moves in no steps: what is at its bound stays there, and draws of the rest know it.
    start = model.constants.tolist()
    held = {place for place, bounds in limits.items() if steps == 0 and start[place] in bounds}
    longest = LONGEST_MEMORY * signals.dt * max(len(run.commands) for run in hypothesis.runs)
    for turn in itertools.count():
        tuned, chi_squared, readings, covariance, drawn = _core.tune(
            model,
            context.limits.engine,
            [chain.engine for chain in observer],
            [run.engine for run in hypothesis.runs],
            free=[place for place in free if place not in held] if tuning else [],
            lags=lags if tuning else [],
            iterations=steps,
            draws=draws,
            unit=context.unit.part(number, turn).named("members") if draws else None,
            workers=context.workers,
        )
        outside = beyond(tuned, limits)
        model = bounded_model(tuned, limits) if outside else tuned
        endless: set[int] = set()
        if actuation.hidden:
            model, endless = _forgetting(model, signals, longest)
        if not outside and not endless:
            break
        held |= outside
        lags = [group for group in lags if endless.isdisjoint(group)]
    if covariance.size:
        for place in (place for place, constant in enumerate(free) if constant in held):
            covariance = np.insert(np.insert(covariance, place, 0.0, axis=0), place, 0.0, axis=1)
    fit = Fit(tuned, tuple(observer), chi_squared, readings, covariance)
    return fit, [bounded_model(one, limits) for one in drawn]


def moving_together(model: _core.Model, hypothesis: Hypothesis, signals: Signals) -> list[list[int]]:
    """Groups of lags, times of hidden states, those in which pairs turn, gaps, and ramps, each one number."""
    actuation = Actuation.of(model, signals)
    lags = [list(group) for group in hypothesis.alike if actuation.actuators[group[0]].lag > 0.0]
    # Hidden states that begin with one time keep one.
    times = [state.time for state in actuation.hidden]
    # Those in which pairs turn stand behind them.
    turns = [state.turns for state in actuation.hidden if state.turns > 0.0]
    groups = [
        [first + j for j, other in enumerate(each) if other == time]
        for first, each in ((signals.n_u, times), (signals.n_u + len(times), turns))
        for time in dict.fromkeys(each)
    ]
    first = signals.n_u + len(times) + len(turns)
    # Then half of each gap, and what damps beyond it, of both that are beside it.
    plays = sum(state.gap > 0.0 for state in actuation.hidden)
    groups += [[first + 4 * j + k, first + 4 * j + k + 2] for j in range(plays // 2) for k in (0, 1)]
    first += 2 * plays
    places = {
        i: first + j for j, i in enumerate(i for i, one in enumerate(actuation.actuators) if one.ramp > 0.0)
    }
    ramps = [[places[i] for i in group] for group in hypothesis.alike if group[0] in places]
    return lags + groups + ramps


def _forgetting(model: _core.Model, signals: Signals, longest: float) -> tuple[_core.Model, set[int]]:
    """The model with hidden states that last for so many seconds at most, and the places of those that did not."""
    actuation = Actuation.of(model, signals)
    times = [actuator.lag for actuator in actuation.actuators] + [state.time for state in actuation.hidden]
    times += [state.turns for state in actuation.hidden if state.turns > 0.0]
    times += [
        number for state in actuation.hidden if state.gap > 0.0 for number in (state.gap, state.damping)
    ]
    endless = {place for place, time in enumerate(times) if place >= signals.n_u and time > longest}
    times += [actuator.ramp for actuator in actuation.actuators if actuator.ramp > 0.0]
    if endless:
        times = [longest if place in endless else time for place, time in enumerate(times)]
        model = model.with_constants(model.constants.tolist(), times)
    return model, endless
