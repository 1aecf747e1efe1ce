"""Whether states go on by one step of Euler a period, as readings show it of states and their declared derivatives.

A state that goes on by its derivative at the start or at the end of a period is not the one that is integrated: half a
period lies between them. No law is needed to see that: the readings are described under each way of going on as if
nothing but disturbances drove the states, and the likelihoods are compared.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop.identification.evidence import STEPPING
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.sensors.chains import Chain, chains
from twinloop.identification.sensors.offsets import moved, search_offsets, unexplained_noise
from twinloop.law.forms import EULER
from twinloop.signals import Signals

NEARLY = 50.0
"""By how much a late sensor may describe readings more briefly, in units of χ², where a step is still tried as well."""


def euler_form(runs: Sequence[Run], signals: Signals, workers: _core.Workers) -> str | None:
    """The form of one step of Euler a period that the readings show.

    No chain may speak against it. A sensor that is late or early by half a period looks much like a step: where one
    describes the readings better by far, no step is shown; otherwise the law has to decide.

    Args:
        runs: recorded.
        signals: of the system.
        workers: how the work is carried out.

    Returns:
        A form; None where states are integrated finely, or nothing shows.
    """
    scales = np.array([state.scale for state in signals.states])
    noise = guessed_noise(runs, scales)
    finely = chains(signals, "acceleration", noise)
    plain = _lengths(runs, signals, finely, workers)
    steps = {form: _lengths(runs, signals, chains(signals, form, noise), workers) for form in EULER}
    best = min(EULER, key=lambda form: sum(steps[form]))
    step = sum(steps[best])
    against = any(more > less + STEPPING for more, less in zip(steps[best], plain, strict=True))
    if against or not step < sum(plain) - STEPPING:
        return None
    offsets = search_offsets(runs, signals, finely, scales, workers)
    late = sum(_lengths(moved(runs, signals, offsets), signals, finely, workers))
    return best if step < late + NEARLY else None


def _lengths(
    runs: Sequence[Run], signals: Signals, every: Sequence[Chain], workers: _core.Workers
) -> list[float]:
    """−2 log of the likelihood of each chain's readings, of chains in which states move one another."""
    moving = [chain for chain in every if len(chain.states) > 1 or chain.output is None]
    return [length for _, length in unexplained_noise(runs, signals, moving, workers)]
