"""Answers: what was identified, held against the flights that it was learnt from.

A model that is right follows a flight by itself, up to what noise and disturbances explain. One that was learnt from it
does not always.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.data.readings import at_rest
from twinloop.campaign.data.sent import in_pulses
from twinloop.campaign.history import Cause, Experiment
from twinloop.campaign.identify_and_plan.causes import causes_of
from twinloop.campaign.identify_and_plan.following import WRONG, Following, following, in_pieces
from twinloop.campaign.identify_and_plan.misses import Miss, misses_any, misses_of, of_each_state
from twinloop.campaign.identify_and_plan.suspects import stirred, suspects_of
from twinloop.campaign.identify_and_plan.unmoved import unmoved_states
from twinloop.campaign.setup import Setup
from twinloop.identification.identified import Identified
from twinloop.identification.settings import IdentificationOptions
from twinloop.law.accuracy import left


@dataclass(frozen=True, eq=False)
class Answer:
    """What was identified, beside the flights that it was learnt from.

    Args:
        identified: a model and a committee.
        followed: free runs of the members.
        follows: whether the best of them follows at least half of the flights that tell.
        causes: of the correlated disturbances, by the state that each drives.
        unmoved: states that move, and nothing moves them by the law.
        missed: whether the best one misses a flight by more than noise and whatever may disturb explains.
        believed: members of the committee that follow the flights, the best first; where none explains them, the best
            one of another kind behind it.
        lost: places of the flights that the best of them does not follow.
        suspects: states that are stirred by a white disturbance which may be what the law is wrong about.
    """

    identified: Identified
    followed: Following
    follows: bool
    causes: Mapping[int, Cause]
    unmoved: Sequence[int]
    missed: bool
    believed: Sequence[_core.Model]
    lost: Sequence[int] = ()
    suspects: Sequence[int] = ()

    @property
    def worst(self) -> float:
        """Mean square of the best member on the flight that it misses most, over that of the model that never moves."""
        return self.followed.worst(0)

    @property
    def lasts(self) -> bool:
        """Whether the best member lasts on each flight that it was learnt from."""
        return bool(np.isfinite(self.followed.free[0]).all())

    @property
    def believable(self) -> bool:
        """Whether it follows the flights, and its best member lasts on each of them."""
        return self.follows and self.lasts

    @property
    def explained(self) -> bool:
        """Whether it follows the flights, and noise and whatever may disturb explain what its free runs miss."""
        return self.follows and not self.missed

    @staticmethod
    def of(
        identified: Identified,
        flights: Sequence[Experiment],
        setup: Setup,
        options: IdentificationOptions,
        workers: _core.Workers,
        number: int = 0,
    ) -> Answer:
        """What was identified, with how it follows flights when it is flown by itself.

        Args:
            identified: a model and a committee.
            flights: at least one.
            setup: of the campaign.
            options: of the identification.
            workers: how the work is carried out.
            number: of the answer to these flights, which tells its draws from those of others.
        """
        noise = identified.noise(setup.signals)
        followed = following(identified.members, flights, setup.limits, workers, noise)
        believed = [identified.members[i] for i in followed.believed()]
        unmoved = unmoved_states(identified, flights, setup)
        if not np.isfinite(identified.chi_squared):
            # Of a model that diverges no more is known.
            return Answer(identified, followed, False, {}, unmoved, False, believed)
        causes = causes_of(identified, flights, setup.signals, setup.limits, options, workers)
        model, unit = identified.members[0], Unit(setup.seed).part(len(flights), 1, number)
        missed = misses_any(model, followed, flights, noise, causes, unit, setup.limits, workers)
        lost = _lost(identified, followed, flights, setup, workers)
        can_tell = _can_tell(flights, bool(noise.correlated) and not missed)
        follows = 2 * len(can_tell.intersection(lost)) <= len(can_tell)
        suspects = suspects_of(identified, flights, setup.limits, workers) if options.causes else ()
        return Answer(identified, followed, follows, causes, unmoved, missed, believed, lost, suspects)

    def with_doubtful_disturbances(self) -> Answer:
        """The same where all that disturbs may be a model error, for another law describes the flights more briefly."""
        causes: dict[int, Cause] = {
            state: "law" if cause == "law" else "undecided" for state, cause in self.causes.items()
        }
        return replace(self, causes=causes, suspects=stirred(self.identified))

    def beside(self, other: Answer) -> Answer:
        """The same with the best model of another answer in its committee.

        Gains are tuned on the first few members: it comes second.
        """
        first, *others = self.believed
        return replace(self, believed=[first, other.identified.model, *others])

    def misses(self, flights: Sequence[Experiment], setup: Setup, workers: _core.Workers) -> list[Miss]:
        """States that the best member misses by more than noise and known disturbances explain.

        Args:
            flights: that it was learnt from.
            setup: of the campaign.
            workers: how the work is carried out.

        Returns:
            Each; none where the twin diverges on what it was learnt from: of such a one that is said already.
        """
        if not np.isfinite(self.identified.chi_squared):
            return []
        model, noise = self.identified.members[0], self.identified.noise(setup.signals)
        unit = Unit(setup.seed).part(len(flights), 2)
        return misses_of(model, flights, noise, self.causes, unit, setup.limits, workers, self.suspects)


def _can_tell(flights: Sequence[Experiment], disturbed: bool) -> set[int]:
    """Places of the flights that tell whether a law is followed.

    What disturbs takes a replay without a controller far from the right law, too, if what is replayed is unstable. So a
    replay tells nothing beside a flight of a test, under whose controller a right law follows.

    Args:
        flights: that a law was learnt from.
        disturbed: whether disturbances that last explain what it misses.
    """
    every, tested = range(len(flights)), {place for place, run in enumerate(flights) if run.test is not None}
    return tested if tested and disturbed else set(every)


def _lost(
    identified: Identified,
    followed: Following,
    flights: Sequence[Experiment],
    setup: Setup,
    workers: _core.Workers,
) -> list[int]:
    """Places of the flights that the best member does not follow; where commands were sent in pulses, under those."""
    scales = np.array([state.scale for state in setup.signals.states])
    seen = np.square(identified.sensors(len(scales)) / scales)
    free, frozen = followed.free[0], followed.frozen
    rows = zip(free.tolist(), frozen.tolist(), strict=True)
    level = float(seen.mean())
    lost = np.array([left(*row, level) for row in rows])
    for j, run in enumerate(flights):
        if at_rest(run.trajectory):
            lost[j] = not free[j] <= level
    model, limits = identified.members[0], setup.limits
    short = [j for j in _shortened(identified, followed, flights, setup) if not lost[j]]
    if short:
        parts = followed.lengths[short], [flights[j] for j in short]
        each, still = of_each_state(model, *parts, limits, workers)
        for j, off, held in zip(short, each.tolist(), still.tolist(), strict=True):
            # A state that stays where it is, as it should, is followed.
            lost[j] = any(o > 0.0 and left(o, h, n) for o, h, n in zip(off, held, seen.tolist(), strict=True))
    numbers: list[int] = np.flatnonzero(lost).tolist()
    pulsed = in_pulses([flights[j] for j in numbers])
    again = [j for j in numbers if flights[j].number in pulsed]
    if again:
        lost[again] = in_pieces(model, [flights[j] for j in again], limits, workers) > WRONG
    found: list[int] = np.flatnonzero(lost).tolist()
    return found


def _shortened(
    identified: Identified, followed: Following, flights: Sequence[Experiment], setup: Setup
) -> list[int]:
    """Places of the flights that are followed in pieces which disturbances may have shortened.

    In a short piece an angle goes on as its rate began, whatever the law: so each state has to be followed there.
    """
    if not identified.noise(setup.signals).correlated:
        return []
    return [j for j, run in enumerate(flights) if followed.lengths[j] < run.trajectory.steps]
