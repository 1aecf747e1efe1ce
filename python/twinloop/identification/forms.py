"""What a law's outputs mean is a hypothesis too: derivatives, or increments, as a simulator's own step makes them.

Over a period, a polynomial law does not give a polynomial map; a simulator that takes one Euler step a period does.
Both forms are learnt briefly from the same readings, and the shorter description of these is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop.identification.context import Context
from twinloop.identification.evidence import STEPPING, strongest
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.records import Run
from twinloop.identification.search.selection import climbed, from_both_sides, undisturbed
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.starts import FORMS, begun
from twinloop.remarks import Remark, note
from twinloop.signals import Signals

SURE = 5.0
"""Standard errors from 0 of a share that is believed."""
WHOLE = 0.15
"""By how much a share may differ from a whole step of Euler; a sensor that is late leaves any other share."""
FEWEST = 10
"""Periods from which one is estimated."""
MEANINGS = {"acceleration": "derivatives", "increment": "what a period adds", "absolute": "the next state"}
"""Forms in words."""


def candidates(options: IdentificationOptions, signals: Signals, runs: Sequence[Run]) -> tuple[str, ...]:
    """Forms that may be the law's, the one that is believed unless another is shorter first.

    Args:
        options: of the identification.
        signals: of the system.
        runs: recorded.
    """
    if options.form != "auto" or options.fixed_terms or options.bounded_terms:
        return (options.form_for(signals),)
    declared = any(state.derivative_of is not None for state in signals.states)
    if signals.kinematics is not None or (declared and not steps_like_euler(runs, signals)):
        return ("acceleration",)
    return ("acceleration", "increment")


def steps_like_euler(runs: Sequence[Run], signals: Signals) -> bool:
    """Whether a state goes on by its declared derivative at the start or at the end of a period, not by the mean.

    What the mean leaves of a move is then half of what the derivative changes by, with one sign or the other: a share
    of 1. A sensor that is late by τ leaves a share of 2 τ / dt. Noise of the derivative adds to neither.

    Args:
        runs: recorded.
        signals: of the system.
    """
    for rate, state in enumerate(signals.states):
        if state.derivative_of is None:
            continue
        place = signals.state_names.index(state.derivative_of)
        moves, begun, ended = (
            np.concatenate(parts)
            for parts in zip(
                *(
                    (np.diff(run.states[:, place]), run.states[:-1, rate], run.states[1:, rate])
                    for run in runs
                ),
                strict=True,
            )
        )
        left = moves - 0.5 * signals.dt * (begun + ended)
        half = 0.5 * signals.dt * (ended - begun)
        size = float((half * half).sum())
        if size > 0.0 and len(half) > FEWEST:
            share = float((left * half).sum()) / size
            rest = left - share * half
            error = float(np.sqrt((rest * rest).sum() / (len(half) - 1.0) / size))
            if abs(share) > SURE * error and abs(abs(share) - 1.0) < WHOLE:
                return True
    return False


def likeliest(context: Context) -> tuple[str, list[Remark]]:
    """The form of the shorter description of the runs, with what a person should know of the choice.

    Args:
        context: of the identification.

    Returns:
        The form, and a remark where there was a choice.
    """
    forms = candidates(context.options, context.signals, context.runs)
    if context.earlier is not None and context.settled and context.earlier.model.form in forms:
        forms = (context.earlier.model.form,)
    if len(forms) == 1:
        return forms[0], []
    context.watch("form")
    looks = [brief_look(context, form, FORMS + place) for place, form in enumerate(forms)]
    best = strongest(looks)
    return best.form, [_said(best, strongest(look for look in looks if look is not best))]


def brief_look(context: Context, form: str, start: int) -> Hypothesis:
    """What a short search finds under a form, with what disturbs explained by terms as far as they can."""
    brief = replace(context.brief(context.runs), as_integrated=True)
    first = from_both_sides(brief, begun(brief, form, brief.first_pool(), start))
    return undisturbed(brief, climbed(brief, first))


def _said(best: Hypothesis, other: Hypothesis) -> Remark:
    gain = other.length - best.length
    than = "longer" if gain > 0.0 else "shorter"
    return note(
        "form",
        f"The form of the law was searched. The readings are described as {MEANINGS[best.form]}"
        f" (form {best.form!r}): as {MEANINGS[other.form]} (form {other.form!r}) their description is"
        f" {abs(gain):.3g} {than}, where {STEPPING:g} would decide. The option form fixes it.",
    )
