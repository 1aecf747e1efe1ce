"""Answers: what was identified, held against the flights that it was learnt from.

A model that is right follows a flight by itself, up to what noise and disturbances explain. One that was learnt from it
does not always.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.diagnostics import in_pulses
from twinloop.campaign.identify_and_plan.following import (
    Following,
    expected_misses,
    following,
    in_pieces,
    unexplained,
)
from twinloop.campaign.identify_and_plan.recurring import recurring_states
from twinloop.campaign.identify_and_plan.unmoved import unmoved_states
from twinloop.campaign.setup import Setup
from twinloop.identification.identified import Identified
from twinloop.streams import Unit

FEWEST = 4
"""Members of a committee that are kept in any case."""
WRONG = 0.5
"""Normalised closed-loop error on a flown test at which a member of the committee is not believed."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What was identified, beside the flights that it was learnt from.

    Args:
        identified: a model and a committee.
        followed: free runs of the members.
        follows: whether the best of them follows at least half of the flights.
        recurring: states that an error of the law moves, and no disturbance.
        unmoved: states that move, and nothing moves them by the law.
        missed: times further from each flight than noise and disturbances explain that the best one is; 0 where they
            do.
    """

    identified: Identified
    followed: Following
    follows: bool
    recurring: Sequence[int]
    unmoved: Sequence[int]
    missed: Sequence[float]

    @property
    def worst(self) -> float:
        """Mean square of the best member on the flight that it misses most, over that of the model that never moves."""
        return self.followed.worst(0)

    @property
    def explained(self) -> bool:
        """Whether it follows the flights, and noise and disturbances explain what its free runs miss."""
        return self.follows and not any(self.missed)

    @staticmethod
    def of(
        identified: Identified, flights: Sequence[Experiment], setup: Setup, workers: _core.Workers
    ) -> Answer:
        """What was identified, with how it follows flights when it is flown by itself.

        Args:
            identified: a model and a committee.
            flights: at least one.
            setup: of the campaign.
            workers: how the work is carried out.
        """
        followed = following(identified.members, flights, setup.limits, workers)
        unmoved = unmoved_states(identified, flights, setup)
        if not np.isfinite(identified.chi_squared):
            # Of a model that diverges no more is known.
            return Answer(identified, followed, False, [], unmoved, [])
        recurring = recurring_states(identified, flights, setup.signals, setup.limits, workers)
        missed = _missed(identified, followed, flights, recurring, setup, workers)
        lost = _lost(identified, followed, flights, setup, workers)
        return Answer(identified, followed, 2 * lost <= len(flights), recurring, unmoved, missed)

    @property
    def believed(self) -> list[_core.Model]:
        """Members of the committee that follow the flights, and the best one in any case, in order.

        One that cannot is no member (E-SINDy's stability filter).
        """
        free = self.followed.free
        wrong = (free > np.maximum(WRONG * self.followed.frozen, 4.0 * free[0])).any(axis=1)
        believed = {0, *np.flatnonzero(~wrong).tolist()}
        # Where hardly any can, the ones that go wrong least still show where more must be known.
        others = [i for i in self.followed.order() if i not in believed]
        kept = sorted(believed | set(others[: max(0, FEWEST - len(believed))]))
        return [self.identified.members[i] for i in kept]


def _lost(
    identified: Identified,
    followed: Following,
    flights: Sequence[Experiment],
    setup: Setup,
    workers: _core.Workers,
) -> int:
    """Number of flights that the best member does not follow; where commands were sent in pulses, under those."""
    scales = np.array([state.scale for state in setup.signals.states])
    noise = float(np.square(identified.sensors(len(scales)) / scales).mean())
    free, frozen = followed.free[0], followed.frozen
    lost = free - noise > WRONG * np.maximum(frozen - noise, 2.0 * noise)
    numbers: list[int] = np.flatnonzero(lost).tolist()
    pulsed = in_pulses([flights[j] for j in numbers])
    again = [j for j in numbers if flights[j].number in pulsed]
    if again:
        model = identified.members[0]
        lost[again] = in_pieces(model, [flights[j] for j in again], setup.limits, workers) > WRONG
    return int(lost.sum())


def _missed(
    identified: Identified,
    followed: Following,
    flights: Sequence[Experiment],
    recurring: Sequence[int],
    setup: Setup,
    workers: _core.Workers,
) -> list[float]:
    """By how much more than noise and disturbances explain the best member misses each flight.

    Nothing of what recurs is a disturbance. A flight whose commands were sent in pulses is judged piece by piece alone.
    """
    noise = identified.noise(setup.signals)
    noise = replace(
        noise, correlated=tuple(each for each in noise.correlated if each.states[0] not in recurring)
    )
    unit = Unit(setup.seed).part(len(flights), 1)
    expected = expected_misses(identified.members[0], flights, noise, unit, setup.limits, workers)
    steered = np.array([run.test is not None for run in flights])
    missed = unexplained(followed.free[0], followed.frozen, expected, steered)
    pulsed = in_pulses([run for run, off in zip(flights, missed, strict=True) if off])
    return [0.0 if run.number in pulsed else off for run, off in zip(flights, missed.tolist(), strict=True)]
