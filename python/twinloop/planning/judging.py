"""Judging: what members of a committee make of candidate flights, under drawn noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop._experiment.envelope import outside
from twinloop._experiment.hold_back import HoldBack
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.controllers import Family
from twinloop.flights import candidates, qualities
from twinloop.law.reports import Reports, given, reports_of
from twinloop.planning.gusts import UNMOVED, Gusts, Moved
from twinloop.planning.leaving import risk_of
from twinloop.planning.quality import Quality
from twinloop.test import Test

Ends = tuple[Floats, Floats]
"""Initial states and target states (K, n_x)."""


@dataclass(frozen=True, eq=False)
class Task:
    """Start, target and length of flights."""

    initial_state: Floats
    target_state: Floats
    steps: int

    @property
    def first_target(self) -> Floats:
        """Where it leads at its beginning (n_x,)."""
        first: Floats = np.atleast_2d(self.target_state)[0]
        return first


@dataclass(frozen=True, eq=False)
class Committee:
    """Models that judge, the best first, and the noise of the sensors.

    Args:
        members: m of them.
        sds: of each state's sensor (n_x,).
        trusted: whether the best one, flown by itself, follows at least half of the runs that it was learnt from.
        delayed: models with more delay than was seen, with which gains have to keep the envelope.
        tuned_delayed: such models with less of it, on which gains are also tuned.
        explains: whether the best one explains the runs.
        gusts: disturbances that are known; None: nothing disturbs.
        foretells: whether what it foretold last came true.
        ending: the best one where what states do ends where flights have been; None where that is not asked.
        gains_count: whether gains that can be tuned make a difference on the best one.
        lawless: states that move, of which no law is known.
        untunable: numbers of the gains that cannot be tuned for that.
    """

    members: Sequence[_core.Model]
    sds: Floats
    trusted: bool
    delayed: Sequence[_core.Model] = ()
    explains: bool = True
    gusts: Gusts | None = None
    tuned_delayed: Sequence[_core.Model] = ()
    foretells: bool = False
    ending: _core.Model | None = None
    gains_count: bool = True
    lawless: tuple[int, ...] = ()
    untunable: tuple[int, ...] = ()

    @property
    def leads(self) -> bool:
        """Whether it can say where a flight leads: the best one follows the runs, and there are gains to tune."""
        return self.trusted and self.gains_count

    @property
    def predicts_limits(self) -> bool:
        """Whether flights that keep limits on the best model may be expected to keep them on the system.

        Of a model that does not explain the runs, the gains that are best within limits are best because of its errors.
        """
        return self.leads and self.explains

    def as_flown(self, genes: Floats, flown: Floats) -> Floats:
        """Genes (..., size) with the gains that cannot be tuned of others (size,), the best that were flown."""
        kept, untunable = genes.copy(), list(self.untunable)
        kept[..., untunable] = flown[untunable]
        return kept

    def disturbances(self, draws: int, steps: int) -> Floats | None:
        """Draws of known disturbances (draws, n, n_x), the same for all candidates; None where nothing disturbs.

        Nor where the committee has foretold nothing yet: a wrong law takes its errors for disturbances, and gains that
        fight these are the higher the more it is wrong.

        Args:
            draws: of them.
            steps: n of a flight.
        """
        if self.gusts is None or not self.foretells or draws < 2:
            return None
        drawn = self.gusts.tuned_in(draws + draws % 2, steps)[:draws]
        # Kicks that add up over a flight to less than the sensor scatters, in every state, ask for no other gains.
        walked = np.sqrt(np.square(drawn.cumsum(axis=1)).mean(axis=(0, 1)))
        return drawn if (walked > self.sds).any() else None

    def moved_by_gusts(self, test: Test) -> Moved:
        """What known disturbances do to a flight."""
        return UNMOVED if self.gusts is None else self.gusts.on(test)


@dataclass(frozen=True, eq=False)
class Judged:
    """Qualities and worst usages of the envelope (members, draws, K), both infinite where a flight diverges."""

    qualities: Floats
    usages: Floats

    @property
    def mean(self) -> Floats:
        """Over members and draws (K,); infinite where any flight diverges."""
        mean: Floats = self.qualities.mean(axis=(0, 1))
        return mean

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Members that diverge on fewer than half of the flights; the best one in any case (members,)."""
        stable: NDArray[np.bool_] = np.isinf(self.qualities).any(axis=1).mean(axis=1) < 0.5
        stable[0] = True
        return stable

    def of(self, members: NDArray[np.bool_]) -> Judged:
        """The same of some members."""
        return Judged(self.qualities[members], self.usages[members])

    @property
    def lost(self) -> Floats:
        """Share of the flights that diverge (K,)."""
        lost: Floats = np.isinf(self.qualities).mean(axis=(0, 1))
        return lost

    @property
    def mean_of_finite(self) -> Floats:
        """Mean quality of the flights that do not diverge (K,); 0 where none is left."""
        lasts = np.isfinite(self.qualities)
        total = np.where(lasts, self.qualities, 0.0).sum(axis=(0, 1))
        mean: Floats = total / np.maximum(1, lasts.sum(axis=(0, 1)))
        return mean

    @property
    def finite(self) -> Judged:
        """The flights that do not diverge, with zeros for those that do."""
        lasts = np.isfinite(self.qualities)
        return Judged(np.where(lasts, self.qualities, 0.0), np.where(lasts, self.usages, 0.0))

    @property
    def worst_usage(self) -> Floats:
        """Over members and draws (K,)."""
        worst: Floats = self.usages.max(axis=(0, 1))
        return worst


def _only(test: Test) -> tuple[Floats, Floats | None, Ends]:
    """Genes, excitation and ends of a test that is the only candidate."""
    excitation = None if test.excitation is None else test.excitation[np.newaxis]
    return test.genes[np.newaxis], excitation, (test.initial_state[np.newaxis], test.target_state[np.newaxis])


def risk(usages: Floats) -> float:
    """Share of flights that leave the envelope, with half a flight added on either side: none is no certainty.

    Args:
        usages: of the envelope, any shape.
    """
    return risk_of(int(outside(usages).sum()), usages.size)


def expected(qualities: Floats) -> tuple[float, float]:
    """Quality that is expected to be measured, and its spread over members and noise; infinite where one diverges.

    Args:
        qualities: of one flight (members, draws).
    """
    if not np.isfinite(qualities).all():
        return float("inf"), float("inf")
    return float(qualities.mean()), float(qualities.std())


class Judge:
    """Flies candidates on members.

    Args:
        family: of the controllers.
        task: of the flights.
        quality: what is minimised.
        limits: where a flight counts as diverged.
        seed: of the campaign.
        workers: how the work is carried out.
    """

    def __init__(
        self,
        family: Family,
        task: Task,
        quality: Quality,
        *,
        limits: Limits,
        seed: int,
        workers: _core.Workers,
    ) -> None:
        self.family = family
        self.signals = family.signals
        self.task = task
        self.quality = quality
        self.limits = limits
        self.unit = Unit(seed)
        self.workers = workers

    def test(self, genes: Floats, start: Floats, target: Floats, excitation: Floats | None = None) -> Test:
        """One flight, of the task's length.

        Args:
            genes: of its gains (size,).
            start: where it begins (n_x,).
            target: where it leads, (n_x,) or a row for each state.
            excitation: (n, n_u); of zeros or None: there is none.
        """
        added = None if excitation is None or not excitation.any() else excitation
        return Test(self.family, genes, start, target, self.task.steps, added)

    def judge(
        self,
        members: Sequence[_core.Model],
        genes: Floats,
        sds: Floats,
        draws: int,
        excitation: Floats | None = None,
        ends: Ends | None = None,
        measured: bool = False,
        off: Floats | None = None,
        hold_back: HoldBack | None = None,
        disturbances: Floats | None = None,
    ) -> Judged:
        """Flies candidates on members under noise, and under disturbances where they are given (draws, n, n_x).

        Qualities are those of the true states, which gains are chosen by, or, `measured`, those that a record of the
        flight would give. Where `off` is given flights begin elsewhere, as far as it says (n_x,), drawn like noise.
        Excitations are held back as `hold_back` says.
        """
        noise = self.noise(sds, draws, reports_of(members[0], self.signals.n_x))
        offsets = (
            None if off is None else off * self.unit.part(0).stream("off_start").normals(draws, len(off))
        )
        flights = self.flights(genes, excitation, ends, hold_back)
        return self._judged(members, flights, noise, disturbances, offsets=offsets, measured=measured)

    def quiet(
        self,
        members: Sequence[_core.Model],
        genes: Floats,
        excitation: Floats | None = None,
        ends: Ends | None = None,
        hold_back: HoldBack | None = None,
    ) -> Judged:
        """Flies candidates on members once, without noise, as for `judge`."""
        return self.judge(
            members, genes, np.zeros(self.signals.n_x), 1, excitation, ends, hold_back=hold_back
        )

    def quiet_test(self, members: Sequence[_core.Model], test: Test) -> Judged:
        """Flies a test on members once, without noise, its excitation held back as it asks."""
        genes, excitation, ends = _only(test)
        return self.quiet(members, genes, excitation, ends, test.hold_back)

    def as_flown(
        self, members: Sequence[_core.Model], test: Test, sds: Floats, draws: int
    ) -> tuple[list[_core.Model], Judged]:
        """Flies a test as it was flown, under noise.

        Args:
            members: of a committee.
            test: with its excitation, and what held that back.
            sds: of each state's sensor (n_x,).
            draws: of the noise.

        Returns:
            Members that last, for one that diverges in a flight that went to its end says nothing of how good it was;
            and the qualities that records of its flights on them would give.
        """
        genes, excitation, ends = _only(test)
        lasting = list(compress(members, self.quiet_test(members, test).stable))
        judged = self.judge(
            lasting, genes, sds, draws, excitation, ends, measured=True, hold_back=test.hold_back
        )
        return lasting, judged

    def judge_in_turn(
        self,
        members: Sequence[_core.Model],
        genes: Floats,
        sds: Floats,
        draws: int,
        disturbances: Floats | None,
    ) -> Judged:
        """Flies candidates under each draw on one of the members, in turn, at the price of one member.

        What each draw does is nearly the same on all members, so to fly all draws on all of them tells hardly more.
        Members count alike where the draws divide among them.

        Args:
            members: that judge.
            genes: of K candidates.
            sds: of each state's sensor (n_x,).
            draws: of the noise; where there are fewer than members, all members fly all of them.
            disturbances: of each draw (draws, n, n_x); None: nothing disturbs.

        Returns:
            Qualities of the true states, and usages, as of one member.
        """
        if draws < len(members):
            return self.judge(members, genes, sds, draws, disturbances=disturbances)
        noise = self.noise(sds, draws, reports_of(members[0], self.signals.n_x))
        flights, every = self.flights(genes, None, None), len(members)

        def drawn(every_draw: Floats | None, number: int) -> Floats | None:
            return None if every_draw is None else every_draw[number::every]

        found = [
            self._judged([member], flights, drawn(noise, i), drawn(disturbances, i))
            for i, member in enumerate(members)
        ]
        return Judged(
            np.concatenate([each.qualities for each in found], axis=1),
            np.concatenate([each.usages for each in found], axis=1),
        )

    def judge_within(
        self,
        bounds: Floats,
        members: Sequence[_core.Model],
        genes: Floats,
        excitation: Floats | None = None,
        ends: Ends | None = None,
    ) -> Judged:
        """Quiet flights of candidates, with usages of bounds of the states (2, n_x), infinite where there is none."""
        states = [
            replace(state, envelope=(low, high) if np.isfinite([low, high]).all() else None)
            for state, (low, high) in zip(self.signals.states, bounds.T.tolist(), strict=True)
        ]
        bounded = replace(self.signals, states=states)
        flights = self.flights(genes, excitation, ends)
        return Judged(*qualities(members, flights, self.quality.engine, bounded, workers=self.workers))

    def stable_members(self, members: Sequence[_core.Model], genes: Floats) -> list[_core.Model]:
        """Members that diverge on fewer than half of the flights; the best one in any case."""
        return list(compress(members, self.quiet(members, genes).stable))

    def noise(self, sds: Floats, draws: int, reports: Reports) -> Floats | None:
        """The same draws of sensor noise for everybody, as it is given (draws, n + 1, n_x); None for a quiet flight."""
        if draws < 2:
            return None
        stream = self.unit.part(0).stream("sensors")
        return given(reports, sds * stream.normals(draws, self.task.steps + 1, self.signals.n_x))

    def flights(
        self,
        genes: Floats,
        excitation: Floats | None,
        ends: Ends | None,
        hold_back: HoldBack | None = None,
    ) -> _core.Flights:
        """Candidates laid out for the engine; those of the campaign's own task where no ends are given."""
        initial, target = ends or (self.task.initial_state, self.task.target_state)
        if ends is None and target.ndim == 2:
            target = np.tile(target, (len(genes), 1, 1))
        return candidates(
            self.family, genes, initial, target, self.task.steps,
            excitation=excitation, hold_back=hold_back, limits=self.limits,
        )  # fmt: skip

    def _judged(
        self,
        members: Sequence[_core.Model],
        flights: _core.Flights,
        noise: Floats | None,
        disturbances: Floats | None,
        *,
        offsets: Floats | None = None,
        measured: bool = False,
    ) -> Judged:
        """Flights on members, each under every draw of what is given."""
        return Judged(
            *qualities(
                members, flights, self.quality.engine, self.signals,
                noise=noise, offsets=offsets, disturbances=disturbances, measured=measured, workers=self.workers,
            )
        )  # fmt: skip
