"""Hypothesis: all that is believed of a system at one point of its identification, as one value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.identification.evidence import CORRELATED, Evidence, price
from twinloop.identification.places import check_places
from twinloop.identification.records import Run
from twinloop.identification.search.structure import Sum, total
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.candidates import Candidates
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation
from twinloop.records import Recorded, beside
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class Fit(Recorded, kind="fit"):
    """A model whose constants were tuned on predictions.

    Args:
        model: the tuned one.
        observer: all chains, with the noise under which its predictions were made.
        chi_squared: of the whitened prediction errors; infinite where the model diverges on its own runs.
        readings: that counted.
        covariance: of the constants and lags that were free; empty where a small change makes the model diverge.
        length: description length of the readings by the innovations of its observer; infinite where none is known.
    """

    model: _core.Model
    observer: tuple[Chain, ...]
    chi_squared: float
    readings: int
    covariance: Floats
    length: float = math.inf

    @property
    def stable(self) -> bool:
        """Whether the model stays near its own runs."""
        return bool(np.isfinite(self.chi_squared))


@dataclass(frozen=True, eq=False)
class Hypothesis(Recorded, kind="hypothesis"):
    """What is believed. A proposal makes others of it by `replace`; nothing in it ever changes.

    Args:
        form: what outputs mean.
        offsets: by how much later than those of the driven states each state's readings were taken from it (n_x,), s.
        runs: the records as they are read under it: moved by the offsets, with outliers weighed 0, and with the states
            that features are made of, once a model has smoothed them.
        actuation: lags, delays and hidden states of the law.
        alike: groups of commands that share a lag and a delay.
        candidates: the terms to choose from.
        driven: chains that outputs drive, with a first guess of their noise.
        given: chains that other states drive, with their noise.
        sums: terms that drive each of `driven`, with the noise under which they were found.
        from_above: sums that were found with the noise from above, for where the model of `sums` diverges.
        fit: the model of the sums; None until it is tuned.
        smoothed: whether the states in `runs` were smoothed by a model.
        of_part: whether a part of the only run has led to it.
        start: number of the start that has led to it; what it draws is a part of the unit of work of that number.
        searches: how many searches have led to it; the next one draws from the next part of that unit.
    """

    form: str
    offsets: Floats
    runs: tuple[Run, ...]
    actuation: Actuation
    alike: tuple[tuple[int, ...], ...]
    candidates: Candidates
    driven: tuple[Chain, ...]
    given: tuple[Chain, ...]
    start: int
    sums: tuple[Sum, ...] = ()
    from_above: tuple[Sum, ...] = ()
    fit: Fit | None = None
    smoothed: bool = False
    of_part: bool = False
    searches: int = 0

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Hypothesis:
        found = super()._read(record, where, given)
        signals = beside(Signals, given, f"{where}.signals")
        sums, chains = (*found.sums, *found.from_above), (*found.driven, *found.given)
        check_places(where, signals, found.pool, sums, chains, found.actuation)
        return found

    @property
    def pool(self) -> Pool:
        """All expressions; terms are entered in a copy only (`Candidates.growing`)."""
        return self.candidates.pool

    @property
    def terms(self) -> int:
        """Number of terms, of all sums."""
        return sum(len(found.weights) for found in self.sums)

    @property
    def beside_few(self) -> bool:
        """Whether its terms are of higher rungs or evolved, which may stand in for others, and few stand beside them.

        The few are those of the sums from above.
        """
        terms = [term for found in self.sums for term in found.weights]
        return bool(self.from_above) and self.pool.rung(terms) > 0

    @property
    def length(self) -> float:
        """Description length of the sums."""
        return total(self.sums)

    @property
    def evidence(self) -> Evidence:
        """What the readings say for it."""
        fit = self.fit
        paid = price(
            self.form,
            self.actuation,
            self.alike,
            len(self.offsets),
            tuned=fit is not None,
            readings=0 if fit is None else fit.readings,
        )
        if fit is not None:
            return Evidence(fitted=True, stable=fit.stable, smoothed=False, length=fit.length + paid)
        correlated = CORRELATED * sum(found.chain.motion.correlated > 0.0 for found in self.sums)
        return Evidence(
            fitted=False, stable=True, smoothed=self.smoothed, length=self.length + correlated + paid
        )

    def next_unit(self, unit: Unit) -> Unit:
        """The part of an identification's unit of work from which the next search draws."""
        return unit.part(self.start, self.searches + 1)

    def searched(self, sums: Sequence[Sum]) -> Hypothesis:
        """The same with the sums of one more search, not fitted yet."""
        return replace(self, sums=tuple(sums), searches=self.searches + 1, fit=None)
