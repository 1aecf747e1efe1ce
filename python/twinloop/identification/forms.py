"""What a law's outputs mean is a hypothesis too: derivatives, integrated, or a step, as a simulator takes it.

Over a period, a polynomial law does not give a polynomial map; a simulator that takes one Euler step a period does.
Both forms are learnt briefly from the same readings, and the shorter description of these is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from twinloop import _core
from twinloop._ground.elementary import log
from twinloop.identification.context import Context
from twinloop.identification.description import shorter, shortest
from twinloop.identification.evidence import STEPPING
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.identified import Identified
from twinloop.identification.records import Run
from twinloop.identification.search.hidden import with_hidden
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import climbed, from_both_sides, undisturbed
from twinloop.identification.sensors.euler_steps import euler_form
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.starts import FORMS, begun, with_offsets
from twinloop.law.actuation import Actuation
from twinloop.law.forms import EULER
from twinloop.remarks import Remark, note
from twinloop.signals import Signals

MEANINGS = {
    "acceleration": "derivatives",
    "increment": "what a period adds",
    "absolute": "the next state",
    "explicit-euler": "derivatives in one explicit Euler step a period",
    "semi-implicit-euler": "derivatives in one semi-implicit Euler step a period",
}
"""Forms in words."""
CALMER = 20.0
"""What terms must gain, in units of χ², that take the place of what disturbs."""
LEAST = 1e-6
"""The least share of a reading that is left in a residual."""
LATE = 18.0
"""What late sensors must gain over a step of Euler, each: an offset, and that of all offsets it is half a period."""
AS_LONG = 0.05
"""Description length by which two forms are not said to differ: it is written with no digit that counts."""
HALF_A_PERIOD = (
    "Between a state and its derivative a sensor that is late or early by half a period shows the same; what drives"
    " them decides."
)
"""What is said where one of the forms is a step of Euler."""


def first_form(options: IdentificationOptions, signals: Signals) -> str:
    """The form that is believed unless another describes the readings more briefly.

    Args:
        options: of the identification.
        signals: of the system.
    """
    declared = options.form != "auto" or options.fixed_terms or options.bounded_terms
    return options.form_for(signals) if declared else "acceleration"


def candidates(
    options: IdentificationOptions, signals: Signals, runs: Sequence[Run], workers: _core.Workers
) -> tuple[str, ...]:
    """Forms that may be the law's, the one that is believed unless another is shorter first.

    Args:
        options: of the identification.
        signals: of the system.
        runs: recorded.
        workers: how the work is carried out.
    """
    first = first_form(options, signals)
    if options.form != "auto":
        return (first,)
    if len(signals.driven) < signals.n_x:
        # Formulas of a user mean derivatives under either.
        step = euler_form(runs, signals, workers)
        return (first,) if step is None else (first, step)
    return (first,) if options.fixed_terms or options.bounded_terms else (first, "increment")


def likeliest(context: Context) -> tuple[str, list[Remark]]:
    """The form of the shorter description of the runs, with what a person should know of the choice.

    Args:
        context: of the identification.

    Returns:
        The form, and a remark where there was a choice.
    """
    forms = candidates(context.options, context.signals, context.runs, context.workers)
    if context.earlier is not None and context.settled and context.earlier.model.form in forms:
        forms = (context.earlier.model.form,)
    if len(forms) == 1:
        return forms[0], []
    context.watch("form")
    aligned = forms[-1] in EULER
    looks = [brief_look(context, form, FORMS + place, aligned) for place, form in enumerate(forms)]
    known = context.earlier
    if known is not None and known.actuation != Actuation.direct(context.signals):
        looks = [
            shortest(
                (look, brief_look(context, look.form, look.start, aligned, known, look.searches)),
                partial(_described, context),
            )
            for look in looks
        ]
    best, other = looks
    if shorter(_described(context, other), _described(context, best)):
        best, other = other, best
    return best.form, [_said(context, best, other)]


def briefly_described(context: Context, runs: Sequence[Run], start: int) -> float:
    """Description length of runs by what a short search finds under the form that is believed at first.

    Args:
        context: of the identification.
        runs: that are described.
        start: its number.
    """
    brief, form = context.brief(runs), first_form(context.options, context.signals)
    return from_both_sides(brief, begun(brief, form, brief.first_pool(), start)).length


def brief_look(
    context: Context,
    form: str,
    start: int,
    aligned: bool = False,
    known: Identified | None = None,
    searches: int = 0,
) -> Hypothesis:
    """What a short search finds under a form, with what disturbs explained by terms as far as they can.

    Args:
        context: of the identification.
        form: what outputs mean.
        start: its number.
        aligned: whether late sensors are looked for: where another form is a step of Euler, for which they may be
            taken. Quotients are not then, for a period of any law resembles one.
        known: what was learnt earlier, to look behind its lags and hidden state, which a short search does not look for
            itself; None: commands act at once.
        searches: how many searches from the same start were made before.
    """
    brief = replace(context.brief(context.runs), earlier=known, as_integrated=True)
    first = replace(begun(brief, form, brief.first_pool(), start), searches=searches)
    if aligned:
        brief = replace(brief, options=replace(brief.options, implicit=False))
        first = with_offsets(brief, first)
    if known is not None:
        first = replace(first, actuation=known.actuation)
        if hidden := known.actuation.hidden:
            first = replace(first, candidates=with_hidden(brief, first.candidates, len(hidden)))
    found = climbed(brief, from_both_sides(brief, first))
    for calmer in undisturbed(brief, found, CALMER):
        found = calmer
    return found


def _described(context: Context, look: Hypothesis) -> float:
    """Description length of the readings, with what is late in it priced."""
    late = LATE * len(set(look.offsets[look.offsets != 0.0].tolist()))
    return look.evidence.length + late + _read_at_the_end(context, look)


def _read_at_the_end(context: Context, look: Hypothesis) -> float:
    """What the description length of residuals lacks of that of the readings, −2 log |∂ residuals / ∂ readings|.

    Derivatives are read at both ends of a period. Where a share J of a reading is in its own prediction, the residual
    has 1 − J of it. What steps is read at the start alone.
    """
    if look.form != "acceleration":
        return 0.0
    problem, total = Problem(context, look), 0.0
    for found in look.sums:
        fixed = dict.fromkeys(problem.priors.fixed.get(found.chain.states[0], ()), 1.0)
        weights = fixed | found.weights
        if terms := problem.usable(list(weights)):
            fed = problem.feedthrough(found.chain, terms) * np.array([weights[term] for term in terms])
            total -= 2.0 * float(log(np.maximum(np.abs(1.0 - fed.sum(axis=1)), LEAST)).sum())
    return total


def _said(context: Context, best: Hypothesis, other: Hypothesis) -> Remark:
    step = best.form in EULER or other.form in EULER
    # What steps, lags and hidden states cost is in the one, and not in the other: there the sentence says it.
    best_length, other_length = (
        _described(context, look) if step else look.length + _read_at_the_end(context, look)
        for look in (best, other)
    )
    gain = other_length - best_length
    size = f"{abs(gain):.3g} {'longer' if gain > 0.0 else 'shorter'}" if abs(gain) > AS_LONG else "as long"
    decided = f", where {STEPPING:g} would decide. The option form fixes it."
    if step:
        decided = (
            f", with what a step and what a late sensor costs. The option form fixes it. {HALF_A_PERIOD}"
        )
    return note(
        "form",
        f"The form of the law was searched. The readings are described as {MEANINGS[best.form]}"
        f" (form {best.form!r}): as {MEANINGS[other.form]} (form {other.form!r}) their description is"
        f" {size}{decided}",
    )
