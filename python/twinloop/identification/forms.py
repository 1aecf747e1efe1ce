"""What a law's outputs mean is a hypothesis too: derivatives, integrated, or a step, as a simulator takes it.

Over a period, a polynomial law does not give a polynomial map; a simulator that takes one Euler step a period does.
Both forms are learnt briefly from the same readings, and the shorter description of these is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from twinloop import _core
from twinloop.identification.context import Context
from twinloop.identification.evidence import STEPPING
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.records import Run
from twinloop.identification.search.description import shorter
from twinloop.identification.search.selection import climbed, from_both_sides, undisturbed
from twinloop.identification.sensors.euler_steps import euler_form
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.starts import FORMS, begun, with_offsets
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
LATE = 18.0
"""What late sensors must gain over a step of Euler, each: an offset, and that of all offsets it is half a period."""
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
    told = options.form != "auto" or options.fixed_terms or options.bounded_terms
    return options.form_for(signals) if told else "acceleration"


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
    best, other = looks
    if shorter(_described(other), _described(best)):
        best, other = other, best
    return best.form, [_said(best, other)]


def brief_look(context: Context, form: str, start: int, aligned: bool = False) -> Hypothesis:
    """What a short search finds under a form, with what disturbs explained by terms as far as they can.

    Args:
        context: of the identification.
        form: what outputs mean.
        start: its number.
        aligned: whether late sensors are looked for: where another form is a step of Euler, for which they may be
            taken. Quotients are not then, for a period of any law resembles one.
    """
    brief = replace(context.brief(context.runs), as_integrated=True)
    first = begun(brief, form, brief.first_pool(), start)
    if aligned:
        brief = replace(brief, options=replace(brief.options, implicit=False))
        first = with_offsets(brief, first)
    return undisturbed(brief, climbed(brief, from_both_sides(brief, first)))


def _described(look: Hypothesis) -> float:
    """Description length of the readings, with what is late in it priced."""
    return look.evidence.length + LATE * len(set(look.offsets[look.offsets != 0.0].tolist()))


def _said(best: Hypothesis, other: Hypothesis) -> Remark:
    step = best.form in EULER or other.form in EULER
    gain = _described(other) - _described(best) if step else other.length - best.length
    than = "longer" if gain > 0.0 else "shorter"
    decided = f", where {STEPPING:g} would decide. The option form fixes it."
    if step:
        decided = (
            f", with what a step and what a late sensor costs. The option form fixes it. {HALF_A_PERIOD}"
        )
    return note(
        "form",
        f"The form of the law was searched. The readings are described as {MEANINGS[best.form]}"
        f" (form {best.form!r}): as {MEANINGS[other.form]} (form {other.form!r}) their description is"
        f" {abs(gain):.3g} {than}{decided}",
    )
