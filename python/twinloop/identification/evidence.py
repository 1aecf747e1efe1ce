"""Evidence: what the readings say for a hypothesis. Here, and nowhere else, two hypotheses are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

from twinloop._ground.elementary import log
from twinloop.identification.description import shorter
from twinloop.law.actuation import Actuation
from twinloop.law.forms import EULER

LAGGING = 12.0
"""What a lag or a delay, or a limited rate, must gain in description length, each: its number, and the choice of it."""
HIDING = 30.0
"""What a hidden state must gain: its time, its kind, and what a search may find by luck."""
STANDING_IN = 30.0
"""What one that commands alone fill must gain besides, once it is tuned.

Those that stand in for what is not in the law at all gain some tens of units, the same after each flight; those of a
machine hundreds, and more with each flight. Until then they may lead to others, which are not found without them.
"""
PLAYING = 12.0
"""For each of the two numbers that a gap has beyond a spring without one."""
STORING = 10.0
"""What each hidden state must gain besides where states fill one, with the choice among all that may."""
CORRELATED = 16.0
"""What a correlated disturbance must gain, each: its size, its correlation time, and the choice of having one."""
ANEW = 12.0
"""What a law that is found anew must gain for each term that it has more than the one known before.

The terms of the one were chosen after the last flight, those of the other before: so they have foretold it. And noise
is not quite what a likelihood takes it for; beyond the flights, laws that few units tell apart differ by much.
"""
LATENESS = 12.0
"""What a driven state's sensor that is late must gain: by how many periods it is, and the choice of it."""
SLIGHT = 0.02
"""What a late sensor, and a hidden state that commands alone fill, must gain besides, a reading.

A law that is not quite right leaves something on every reading, and such a thing explains a part of that whether it is
there or not: 0.002 to 0.013 where it is not, on cars and vessels under water. Hidden states that are there explained
0.02 to 1.4, late sensors 0.03 and more; one 0.002, and its twin is as good without.
"""
STEPPING = 12.0
"""What a law of a step must gain, increments or one of Euler: it holds for that step alone."""


@dataclass(frozen=True)
class Evidence:
    """What the readings say for a hypothesis: first how far it was worked out, then how briefly it describes them.

    Description lengths of the same stage compare. Of fitted models they are by innovations, whatever their terms were
    selected on; before that they are of features, and those of readings do not compare with those of smoothed states.

    Args:
        fitted: whether its constants were tuned on predictions.
        stable: whether its model stays near its own runs; where that is not known yet it is taken to.
        smoothed: of what is not fitted, whether its terms were selected on states that a model has smoothed.
        length: description length of the readings: −2 log of their likelihood, the price of its terms, and that of
            what else it holds (`price`).
    """

    fitted: bool
    stable: bool
    smoothed: bool
    length: float

    @property
    def stage(self) -> tuple[bool, ...]:
        """How far it was worked out; a model that diverges is worth nothing."""
        return self.fitted, self.stable, self.stable and self.smoothed

    def less(self, worth: float) -> Evidence:
        """The same of a hypothesis that has to gain something first.

        Args:
            worth: what it has to, in units of χ².
        """
        return replace(self, length=self.length + worth)

    def __gt__(self, other: Evidence) -> bool:
        """Whether this hypothesis is believed rather than the other; of two whose models diverge neither is."""
        if self.stage != other.stage:
            return self.stage > other.stage
        return self.stable and shorter(self.length, other.length)


by_evidence = attrgetter("evidence")
"""Of several hypotheses `max(several, key=by_evidence)` is the first that none of those after it beats."""


def price(
    form: str,
    actuation: Actuation,
    alike: Sequence[Sequence[int]],
    states: int,
    tuned: bool = False,
    readings: int = 0,
) -> float:
    """What a hypothesis pays for besides its terms and its disturbances, in units of χ².

    Args:
        form: what its outputs mean.
        actuation: between commands and its law.
        alike: groups of commands; those of a group share one lag and one delay, and pay for them once.
        states: how many may fill a hidden state, empty or settled at the start, beside a group of commands or none.
        tuned: whether its constants were tuned on predictions.
        readings: that it describes.
    """
    behind = [[actuation.actuators[i] for i in group] for group in alike]
    lagging = sum(any(one.lag > 0.0 or one.delay > 0 for one in group) for group in behind)
    lagging += sum(any(one.ramp > 0.0 for one in group) for group in behind)
    by_motion = any(one.states for one in actuation.hidden)
    return (
        STEPPING * (form == "increment" or form in EULER)
        + LAGGING * lagging
        + HIDING * bool(actuation.hidden)
        + (STANDING_IN + SLIGHT * readings) * (tuned and bool(actuation.hidden) and not by_motion)
        + bool(actuation.stored) * STORING * len(actuation.hidden)
        + PLAYING * sum(one.gap > 0.0 for one in actuation.stored)
        + len(actuation.stored) * 2.0 * float(log(2.0 * states * (1 + len(alike))))
    )
