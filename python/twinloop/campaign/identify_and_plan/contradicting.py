"""Contradicting: whether a log that contradicts the others is explained only by a law made for it.

Terms that begin at a place, and hidden states, let a law explain a log with a column in another sign or unit as well,
and it is wrong for all. The same flights with that column put right have a shorter description then. Those of a system
that no linear law explains have not: there it changes nothing, or makes them harder to explain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from twinloop.campaign.data.odd_one_out import Odd, odd_one_out
from twinloop.campaign.data.wrapped import without_turns
from twinloop.campaign.history import Experiment
from twinloop.identification.identified import Identified
from twinloop.identification.search.structure import prices
from twinloop.signals import Signals

SHORTER = 10.0
"""By how much the description must be shorter, in units of χ²: of 1200 sets of healthy logs one is accused at all."""
HIDDEN = 30.0
"""What a hidden state or an actuator costs there: as much as it must gain to be tried."""


def odd_log(experiments: Sequence[Experiment], signals: Signals) -> Odd | None:
    """The one log without a test that contradicts the others; its place is among all experiments. None: none does.

    Of a test its own controller shows what is wrong with its columns.

    Args:
        experiments: of a campaign.
        signals: of the system.
    """
    logs = [place for place, run in enumerate(experiments) if run.attached]
    recorded, _ = without_turns([experiments[place].trajectory for place in logs], signals, lambda k, row: "")
    odd = odd_one_out(recorded, signals) if logs else None
    return None if odd is None else odd._replace(place=logs[odd.place])


def righted(experiments: Sequence[Experiment], odd: Odd) -> list[Experiment]:
    """Experiments with the odd one put right.

    Args:
        experiments: of a campaign.
        odd: one of them.
    """
    return [
        replace(run, trajectory=odd.righted) if place == odd.place else run
        for place, run in enumerate(experiments)
    ]


def is_made_for(law: Identified, odd: Odd, of_righted: Identified) -> bool:
    """Whether a law of flights was made for the odd one among them: put right they have a shorter description.

    Args:
        law: of the flights as they were told.
        odd: one of them.
        of_righted: of the same flights with that one put right.
    """
    # Readings in a smaller unit are as much more probable as they are closer together.
    smaller = 2.0 * len(odd.righted.states) * odd.shrunk
    return _described(of_righted) + smaller + SHORTER <= _described(law)


def _described(law: Identified) -> float:
    """Description length of readings, and of the law that they are described with, in units of χ²."""
    terms = sum(float(prices(law.pool, list(found.weights), law.readings, 1).sum()) for found in law.sums)
    held = sum(not actuator.direct for actuator in law.actuation.actuators) + len(law.actuation.hidden)
    return law.description_length + terms + HIDDEN * held
