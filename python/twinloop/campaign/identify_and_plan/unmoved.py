"""Unmoved: states whose equation says that nothing moves them, though they move and the controller answers to them.

In gusts a gentle flight shows of an axis what disturbs it, and little of what commands do. A twin without a law for it
may follow the flights on the other axes; gains that are tuned on it are worth nothing there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._experiment.rates import rates_of
from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.campaign.setup import Setup
from twinloop.identification.identified import Identified
from twinloop.identification.records import Run, guessed_noise
from twinloop.law.forms import driven_states
from twinloop.law.law import Law
from twinloop.planning.excitation import slopes, usual_genes
from twinloop.signals import Signals

MOVED = 3.0
"""Standard deviations of its sensor by which a state deviates from a straight line if it moves."""


def unmoved_states(identified: Identified, experiments: Sequence[Experiment], setup: Setup) -> list[int]:
    """Driven states with an empty equation that move, and that the controller answers to, or to their integrals.

    Args:
        identified: with the model.
        experiments: that it was learnt from.
        setup: of the campaign.
    """
    signals, model = setup.signals, identified.model
    law = Law.of(model, signals)
    runs = [Run.of(run.trajectory.states, run.trajectory.commands).continued(signals) for run in experiments]
    sensors = np.minimum(identified.sensors(signals.n_x), _at_most(runs, signals))
    target = np.atleast_2d(setup.target_state)[0]
    answered = (slopes(setup.family, usual_genes(setup.family), target) != 0.0).any(axis=0)
    by_first = {found.chain.states[0]: list(found.chain.states) for found in identified.sums}
    return [
        first
        for first, output in zip(driven_states(signals, model.form), law.outputs, strict=True)
        if law.expressions.constant_value(output) is not None
        and answered[by_first[first]].any()
        and any(_moved(run.states[:, first], sensors[first]) for run in runs)
    ]


def lawless_states(
    identified: Identified, experiments: Sequence[Experiment], setup: Setup
) -> tuple[int, ...]:
    """Such states, and all that they are the rates of: what moves with them has no law either.

    Args:
        identified: with the model.
        experiments: that it was learnt from.
        setup: of the campaign.
    """
    names = setup.signals.state_names
    found = {names[state] for state in unmoved_states(identified, experiments, setup)}
    for rate, of in reversed(rates_of(setup.signals).items()):
        if rate in found:
            found.add(of)
    return tuple(place for place, name in enumerate(names) if name in found)


def _at_most(runs: Sequence[Run], signals: Signals) -> Floats:
    """Largest standard deviation of each sensor (n_x,): what seems more than readings scatter is motion."""
    guess: Floats = np.sqrt(guessed_noise(runs, np.array([state.scale for state in signals.states])))
    return guess


def _moved(readings: Floats, sensor: float) -> bool:
    """Whether readings of a state bend away from a straight line by more than its sensor scatters."""
    if len(readings) < 3:
        return False
    times = np.arange(len(readings)) - 0.5 * (len(readings) - 1)
    off = readings - readings.mean()
    off = off - times * float((times * off).sum() / np.square(times).sum())
    return bool(off.std() > MOVED * sensor)
