"""What a law's outputs mean is a hypothesis too: derivatives, or increments, as a simulator's own step makes them.

The map over a period of a law that is a polynomial is none. The step of a simulator that takes one Euler step a period is
that polynomial. Both forms are learnt briefly from the same readings, and the shorter description of these is believed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from twinloop.elementary import log
from twinloop.identification.records import Run
from twinloop.identification.search.description import shorter
from twinloop.remarks import Remark, note
from twinloop.signals import Signals

PRICE = 12.0
"""What increments must gain in description length: a law of a step holds for that step alone."""
MEANINGS = {"acceleration": "derivatives", "increment": "what a period adds", "absolute": "the next state"}
"""Forms in words."""


def candidates(form: str, signals: Signals, runs: Sequence[Run]) -> tuple[str, ...]:
    """Forms that may be the law's, the one that is believed unless another is shorter first.

    Args:
        form: of the options; any but "auto" is the only one.
        signals: of the system.
        runs: recorded.
    """
    if form != "auto":
        return (form,)
    declared = any(state.derivative_of is not None for state in signals.states)
    if signals.kinematics is not None or (declared and not steps_like_euler(runs, signals)):
        return ("acceleration",)
    return ("acceleration", "increment")


def steps_like_euler(runs: Sequence[Run], signals: Signals) -> bool:
    """Whether a state goes on by its declared derivative at the start or at the end of a period, not by the mean.

    Args:
        runs: recorded.
        signals: of the system.
    """
    gain = 0.0
    for rate, state in enumerate(signals.states):
        if state.derivative_of is None:
            continue
        place = signals.state_names.index(state.derivative_of)
        moves = np.concatenate([np.diff(run.states[:, place]) for run in runs])
        begun, ended = (
            signals.dt * np.concatenate([run.states[rows, rate] for run in runs])
            for rows in (slice(None, -1), slice(1, None))
        )
        # Medians: a wild reading, or a wrap, is none of this.
        start, end, mean = (
            float(np.median(np.abs(moves - by))) for by in (begun, ended, 0.5 * (begun + ended))
        )
        least = 2.0**-40 * float(np.abs(moves).max(initial=0.0))
        if mean > least:
            gain += 2.0 * len(moves) * float(log(mean / max(min(start, end), least)))
    return gain > PRICE


def likeliest(forms: Sequence[str], length: Callable[[str], float]) -> tuple[str, list[Remark]]:
    """The form of the shorter description, with what a person should know of the choice.

    Args:
        forms: to choose from, at least one; the first one is believed where others are as short.
        length: description length of the readings under a form.

    Returns:
        The form, and a remark where there was a choice.
    """
    if len(forms) == 1:
        return forms[0], []
    lengths = [length(form) for form in forms]
    best = 0
    for number in range(1, len(forms)):
        if shorter(lengths[number] + PRICE, lengths[best]):
            best = number
    others = [above for number, above in enumerate(lengths) if number != best]
    said = note(
        "form",
        f"What the law gives was not declared: the readings are described best as {MEANINGS[forms[best]]} (form"
        f" {forms[best]!r}), {min(others) - lengths[best]:.3g} shorter than as"
        f" {MEANINGS[forms[1 - best]]}; the option form={forms[best]!r} fixes it.",
    )
    return forms[best], [said]
