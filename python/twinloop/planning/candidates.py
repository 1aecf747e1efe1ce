"""Candidates for the next test: gains near the tuned ones with an excitation, and once more the best ones flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.planning.excitation import chirps, directions, directions_for, growing_chirps
from twinloop.planning.judging import Ends, Judge
from twinloop.planning.proposal import Flown
from twinloop.planning.settings import PlanningOptions

MOST_DOUBLINGS = 64
"""Flights after which an excitation that is doubled with each has long been at its most."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """K flights that are compared.

    Args:
        genes: gains of each (K, size).
        excitation: of each (K, n, n_u).
        ends: where each starts and where it leads, (K, n_x) both.
        repeats: the first of those, the last ones, that fly the best gains flown with another excitation.
    """

    genes: Floats
    excitation: Floats
    ends: Ends
    repeats: int

    @classmethod
    def of_best(cls, judge: Judge, flown: Flown) -> Candidates:
        """The best gains flown alone, without excitation, on the campaign's task."""
        task, calm = judge.task, np.zeros((1, judge.task.steps, judge.signals.n_u))
        ends = task.initial_state[np.newaxis], task.target_state[np.newaxis]
        return cls(flown.best[np.newaxis], calm, ends, repeats=0)

    def quiet(self) -> Candidates:
        """The same without excitation, all of them on the task of the first."""
        ends = tuple(np.repeat(states[:1], len(states), axis=0) for states in self.ends)
        return Candidates(self.genes, np.zeros_like(self.excitation), (ends[0], ends[1]), self.repeats)

    def some(self, chosen: list[int]) -> Candidates:
        """Those of some numbers, in their order."""
        ends = self.ends[0][chosen], self.ends[1][chosen]
        return Candidates(self.genes[chosen], self.excitation[chosen], ends, len(chosen))


def candidates(
    judge: Judge,
    options: PlanningOptions,
    tuned: Floats,
    flown: Flown,
    goal: str,
    number: int,
    leads: bool = True,
    lawless: Sequence[int] = (),
    untunable: Sequence[int] = (),
) -> Candidates:
    """Draws candidates; the first one is the tuned gains as they are.

    Args:
        judge: of the campaign: family, task and seed.
        options: of the planning.
        tuned: gains that are best on the committee (size,).
        flown: so far.
        goal: "both", "model" or "control".
        number: of the test, for its streams.
        leads: whether the committee can say where a flight leads; otherwise it is held back as a first one is.
        lawless: states of which it knows no law: their commands are excited as in a first flight. None where nothing
            would hold that back.
        untunable: numbers of the gains that cannot be tuned for that: they stay as in the best flight.

    Returns:
        The candidates.
    """
    family, steps = judge.family, judge.task.steps
    stream = judge.unit.part(number).stream("candidates")
    count = max(2, options.candidates)
    again = max(1, count // 16)
    place = family.to_unit(tuned)
    places = place + options.nearness * stream.normals(count, family.size)
    places[: count // 4] = place
    if goal == "model":
        places[count // 2 :] = stream.uniforms(count - count // 2, family.size)
    elif options.backtracking:
        # Where the tuned gains go further than the committee is believed, some on the way to them do not.
        way = count - count // 4
        back = stream.uniforms(count - way)[:, np.newaxis]
        places[way:] += back * (family.to_unit(flown.best) - place)
    genes = family.from_unit(places)
    genes[0] = tuned
    genes[count - again :] = flown.best
    if options.excitation <= 0.0:
        # The same flight once more would tell nothing: gains close by.
        near = family.to_unit(flown.best) + 0.3 * options.nearness * stream.normals(again, family.size)
        genes[count - again :] = family.from_unit(near)
    kept = list(untunable)
    genes[:, kept] = flown.best[kept]
    excitation = np.zeros((count, steps, judge.signals.n_u))
    most = options.excitation_most
    if most > 0.0 and options.excitation > 0.0:
        # Gains that have flown bear more of it than before, and once more the same would tell little.
        stronger = min(2.0 ** min(max(1, flown.times), MOST_DOUBLINGS) * options.excitation, most)
        along = directions_of(judge, flown.best) if options.hold_back and not leads else None
        target = judge.task.first_target
        beside = directions_for(judge.family, flown.best, target, lawless) if leads and lawless else None
        for i in range(1, count):
            repeated = i >= count - again
            if repeated and along is not None:
                excitation[i] = unknown_excitation(judge, options, along, flown.borne, stream)
                continue
            amplitude = stronger if repeated else most * stream.uniform()
            excitation[i] = chirps(judge.signals, steps, amplitude, options.fade, stream)
            if beside is not None:
                excitation[i] += unknown_excitation(judge, options, beside, flown.borne, stream)
    return Candidates(genes, excitation, _ends(judge, options, number, count), count - again)


def _ends(judge: Judge, options: PlanningOptions, number: int, count: int) -> Ends:
    """Start (K, n_x) and target (K, n_x) or (K, n + 1, n_x) of each candidate; the campaign's for the first one."""
    stream = judge.unit.part(number).stream("ends")
    ends = []
    for middle, reach in (
        (judge.task.initial_state, options.initial_range),
        (judge.task.target_state, options.target_range),
    ):
        states = np.tile(middle, (count, *(1 for _ in middle.shape)))
        if any(reach):
            off = np.array(reach) * (2.0 * stream.uniforms(count - 1, middle.shape[-1]) - 1.0)
            states[1:] += off if middle.ndim == 1 else off[:, np.newaxis]
        ends.append(states)
    return ends[0], ends[1]


def directions_of(judge: Judge, genes: Floats) -> tuple[Floats, Floats]:
    """`directions` of the controller with some gains (size,), around the target of the campaign's task."""
    return directions(judge.family, genes, judge.task.first_target)


def unknown_excitation(
    judge: Judge,
    options: PlanningOptions,
    along: tuple[Floats, Floats],
    flights: int,
    stream: _core.Stream,
) -> Floats:
    """An excitation of a flight of the campaign's task of which no model can say where it leads (n, n_u).

    Args:
        judge: of the campaign: its signals and task.
        options: of the planning; where nothing holds it back, it does not grow.
        along: `directions_of` the gains that fly.
        flights: before this one that have borne such an excitation.
        stream: of random numbers.
    """
    most = options.excitation_unknown if options.hold_back else options.excitation
    return growing_chirps(
        judge.signals, along, judge.task.steps, options.excitation, most, options.fade, stream, flights
    )
